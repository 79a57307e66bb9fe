#!/usr/bin/env python3
"""The tables of criteria.md and blocks.md: criteria.py FOLDER > criteria.csv puts the runs.csv of all comparisons below a folder
together, and prints the tables to standard error. The standard library is enough."""

import csv
import glob
import math
import os
import sys

FINE = "oracle:fine:min-spp=50"
# As it was typed before it had a name, and as it is typed now
OLDER = {
    "oracle:spaced=10:min-spp=100": "oracle:fine",
    "oracle:spaced=10:min-spp=50": FINE,
    "oracle:schedule=every:batch=100": "oracle:every=100",
}
SHOWN = {
    "oracle:every=100": "oracle, every 100",
    "oracle": "oracle, every 20",
    "oracle:fine": "oracle, fine",
    FINE: "oracle, fine, from 50",
    FINE + ":blocks=16": "with blocks of 16",
    FINE + ":blocks=32": "with blocks of 32",
    "cycles:0.033": "Cycles 0.033",
    "cycles:0.12": "Cycles 0.12",
    "dammertz:0.0026": "Dammertz 0.0026",
    "dammertz:0.012": "Dammertz 0.012",
    "relative-error:0.21": "relative error 0.21",
    "relative-error:0.45": "relative error 0.45",
    "luxcore": "LuxCore",
}
RATIOS = {
    "uniform_over_this": "FLIP, tile",
    "uniform_over_this_butteraugli": "butteraugli, tile",
    "uniform_over_this_cvvdp": "JOD, tile",
    "uniform_over_this_block": "FLIP, block",
    "uniform_over_this_bad_block": "FLIP, 1 %",
    "uniform_over_this_block_butteraugli": "butteraugli, block",
    "uniform_over_this_seconds": "FLIP, tile, seconds",
}


def say(line):
    print(line, file=sys.stderr)


def number(text):
    return f"{float(text):.2f}" if text else "–"


def scenes_table(by_source):
    say("| scene | who | spp | stopped | " + " | ".join(RATIOS.values()) + " |\n" + "|---" * (len(RATIOS) + 4) + "|")
    for (scene, source), criteria in by_source.items():
        name = scene if source.startswith("ptwne") else f"{scene}, {source.split(' ')[0]}"
        for spec, title in SHOWN.items():
            run = criteria.get(spec)
            if run is None:
                continue
            spp, stopped = f"{float(run['spp_mean']):.0f}", f"{run['tiles_converged']}/{run['tiles']}"
            say(f"| {name} | {title} | {spp} | {stopped} | " + " | ".join(number(run[key]) for key in RATIOS) + " |")


def means_table(by_source):
    """Geometric means over scenes in which the oracle stopped all tiles and uniform sampling got there."""
    whole = lambda criteria: all(r["tiles"] == r["tiles_converged"] for spec, r in criteria.items() if spec.startswith("oracle"))
    scenes = [criteria for criteria in by_source.values() if FINE in criteria and whole(criteria)]
    oracles = [spec for spec in SHOWN if spec.startswith("oracle") and all(spec in criteria for criteria in scenes)]
    say(f"\nGeometric means over {len(scenes)} scenes, where every ratio is known:\n")
    say("| who | spp | " + " | ".join(RATIOS.values()) + " |\n" + "|---" * (len(RATIOS) + 2) + "|")
    for spec in oracles:
        cells = []
        for key in ["spp_mean", *RATIOS]:
            known = [c for c in scenes if all(c[other][key] for other in oracles)]
            logs = [math.log(float(c[spec][key])) for c in known]
            mean = math.exp(sum(logs) / len(logs)) if logs else float("nan")
            cells.append(f"{mean:.0f}" if key == "spp_mean" else f"{mean:.2f} ({len(known)})")
        say(f"| {SHOWN[spec]} | " + " | ".join(cells) + " |")


def main():
    runs = []
    for path in sorted(glob.glob(os.path.join(sys.argv[1], "**/runs.csv"), recursive=True)):
        with open(path) as file:
            runs += list(csv.DictReader(file))
    by_source = {}
    for run in runs:
        for older, newer in OLDER.items():
            run["criterion"] = run["criterion"].replace(older, newer)
        by_source.setdefault((run["scene"], run["source"]), {})[run["criterion"]] = run
    out = csv.DictWriter(sys.stdout, runs[0].keys(), lineterminator="\n")
    out.writeheader()
    out.writerows(runs)
    scenes_table(by_source)
    means_table(by_source)


if __name__ == "__main__":
    sys.exit(main())
