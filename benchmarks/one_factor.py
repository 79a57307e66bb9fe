"""What one factor for a group of people is worth: learned from half of SIN3D's zones, or from their other view.

    grep -v '^kitchen-view0\|^staircase2' fixtures/human-table.csv > nine.csv
    noisefloor-lab train --table nine.csv --out nine.nfm
    noisefloor-lab evaluate --table fixtures/human-table.csv --model nine.nfm --csv zones.csv
    benchmarks/one_factor.py zones.csv
"""

import csv
import math
import random
import sys

VIEWS = ("kitchen-view0", "staircase2-view0")


def error(logs):
    return math.exp(sum(map(abs, logs)) / len(logs))


with open(sys.argv[1]) as file:
    rows = list(csv.DictReader(file))
logs = {view: [math.log(float(r["human_spp"]) / float(r["predicted_spp"])) for r in rows if r["scene"] == view] for view in VIEWS}
mean = lambda logs: sum(logs) / len(logs)

random.seed(1)
for view, other in zip(VIEWS, reversed(VIEWS)):
    of, after, before = list(logs[view]), [], []
    for _ in range(4000):
        random.shuffle(of)
        half = len(of) // 2
        factor = mean(of[:half])
        before += of[half:]
        after += [log - factor for log in of[half:]]
    print(f"{view}: {len(of)} zones, factor x{math.exp(mean(of)):.2f}")
    print(f"  from half of its zones: x{error(before):.2f} -> x{error(after):.2f}")
    factor = mean(logs[other])
    print(f"  from the other view: x{error(of):.2f} -> x{error([log - factor for log in of]):.2f}")
