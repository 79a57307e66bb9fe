#!/usr/bin/env python3
"""The table of criteria.md "Against uniform sampling": criteria.py FOLDER reads the runs.csv of all comparisons below a folder.
The standard library is enough."""

import csv
import glob
import os
import statistics
import sys

SHOWN = {
    "oracle:fine": "oracle",
    "cycles:0.081": "Cycles",
    "dammertz:0.0046": "Dammertz",
    "relative-error:0.17": "rel. error",
    "luxcore:0.311": "LuxCore",
}
JOD, FLIP = "uniform_over_this_cvvdp", "uniform_over_this"


def cell(run):
    """Mean samples, tiles if not all stopped, and uniform samples over these; a dash for what was not run."""
    if run is None:
        return "–"
    stopped = "" if run["tiles_converged"] == run["tiles"] else f" ({run['tiles_converged']}/{run['tiles']})"
    ratio = f"{float(run[JOD]):.2f}" if run[JOD] else "–"
    return f"{float(run['spp_mean']):.0f}{stopped}, {ratio}"


def line(title, cells):
    print(f"| {title} | " + " | ".join(cells) + " |")


def main():
    scenes = {}
    for path in sorted(glob.glob(os.path.join(sys.argv[1], "**", "runs.csv"), recursive=True)):
        with open(path) as file:
            for run in csv.DictReader(file):
                scenes.setdefault(run["scene"], {})[run["criterion"]] = run
    shown = [spec for spec in SHOWN if any(spec in runs for runs in scenes.values())]
    line("scene", [SHOWN[spec] for spec in shown])
    print("|---" * (len(shown) + 1) + "|")
    for scene, runs in scenes.items():
        line(scene, [cell(runs.get(spec)) for spec in shown])
    for title, key, of in [
        ("*median, by JOD*", JOD, statistics.median),
        ("*lowest, by JOD*", JOD, min),
        ("*median, by FLIP*", FLIP, statistics.median),
    ]:
        cells = []
        for spec in shown:
            runs = [of_scene[spec] for of_scene in scenes.values() if spec in of_scene]
            # A criterion that stopped no tile is uniform sampling itself, up to the limit
            ratios = [float(run[key]) for run in runs if run[key] and int(run["tiles_converged"]) > 0]
            cells.append(f"{of(ratios):.2f}" if ratios else "–")
        line(title, cells)


if __name__ == "__main__":
    main()
