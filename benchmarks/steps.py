#!/usr/bin/env python3
"""What steps between verdicts do to the error against people: the table of verdicts.md.

    noisefloor-lab evaluate --table fixtures/human-table.csv --leave-one-scene-out --csv zones.csv
    benchmarks/steps.py zones.csv

A tile stops at the first verdict at or after its predicted threshold. No luck is in it: the pictures of a zone are given.
"""

import csv
import math
import sys

STEPS = {"none": (1, 0), "fine, from 50": (10, 50), "fine, from 100": (10, 100), "every 20": (20, 20), "every 100": (100, 100)}


def main():
    with open(sys.argv[1]) as file:
        zones = [(float(row["human_spp"]), float(row["predicted_spp"])) for row in csv.DictReader(file) if row["censored"] == "false"]
    print("| verdicts | mean spp | error | bias | below half |\n|---|---|---|---|---|")
    for name, (step, first) in STEPS.items():
        stops = [max(first, math.ceil(predicted / step - 1e-9) * step) if step > 1 else predicted for _, predicted in zones]
        ratios = [math.log(stop / human) for stop, (human, _) in zip(stops, zones)]
        mean = lambda values: sum(values) / len(values)
        error, bias = math.exp(mean([abs(ratio) for ratio in ratios])), math.exp(mean(ratios))
        early = 100 * mean([ratio < math.log(0.5) for ratio in ratios])
        print(f"| {name} | {mean(stops):.0f} | ×{error:.2f} | ×{bias:.2f} | {early:.1f} % |")


if __name__ == "__main__":
    main()
