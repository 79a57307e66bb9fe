#!/usr/bin/env python3
"""The table of criteria.md: criteria.py FOLDER > criteria.csv puts the runs.csv of all comparisons below a folder together, and prints the
table to standard error. The standard library is enough."""

import csv
import glob
import os
import sys

SHOWN = ["oracle", "cycles:0.036", "cycles:0.12", "dammertz", "dammertz:0.012", "relative-error", "relative-error:0.45", "luxcore"]


def main():
    runs = []
    for path in sorted(glob.glob(os.path.join(sys.argv[1], "**/runs.csv"), recursive=True)):
        with open(path) as file:
            runs += list(csv.DictReader(file))
    out = csv.DictWriter(sys.stdout, runs[0].keys(), lineterminator="\n")
    out.writeheader()
    out.writerows(runs)

    by_source = {}
    for run in runs:
        by_source.setdefault((run["scene"], run["source"]), {})[run["criterion"]] = run
    say = lambda line: print(line, file=sys.stderr)
    say("| scene | " + " | ".join(SHOWN) + " |\n" + "|---" * (len(SHOWN) + 1) + "|")
    for (scene, source), criteria in by_source.items():
        cells = []
        for name in SHOWN:
            run = criteria.get(name)
            if run is None:
                cells.append("")
                continue
            number = lambda key: f"{float(run[key]):.2f}" if run[key] else "–"
            ended = "" if run["tiles"] == run["tiles_converged"] else f" ({run['tiles_converged']}/{run['tiles']})"
            cells.append(f"{float(run['spp_mean']):.0f}{ended}, {number('uniform_over_this')}, {number('uniform_over_this_butteraugli')}")
        name = scene if source.startswith("ptwne") else f"{scene}, {source.split(' ')[0]}"
        say(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    sys.exit(main())
