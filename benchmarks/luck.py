#!/usr/bin/env python3
"""Does a picture's seed decide whether it is done? Renders scenes with many seeds each, and prints Markdown.

    luck.py NOISEFLOOR OUT [--seeds 20] [--size 96x96] [--tile 32] [--max-spp 500] SCENE...

For each scene: samples per pixel over seeds, and seeds that stop more than a quarter of their tiles at less than a quarter
of what the median seed takes. Renders that are there already (OUT/SCENE-SEED.csv) are not repeated.
"""
import argparse
import csv
import statistics
import subprocess
import tempfile
from pathlib import Path

arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
arguments.add_argument("noisefloor")
arguments.add_argument("out", type=Path)
arguments.add_argument("scenes", nargs="+")
for name, default in [("--seeds", 20), ("--size", "96x96"), ("--tile", 32), ("--max-spp", 500)]:
    arguments.add_argument(name, default=default, type=type(default))
args = arguments.parse_args()


def rendered(scene, seed):
    kept = args.out / f"{scene}-{seed}.csv"
    if not kept.exists():
        with tempfile.TemporaryDirectory() as folder:
            command = [args.noisefloor, "render", scene, "--size", args.size, "--tile", str(args.tile)]
            command += ["--seed", str(seed), "--max-spp", str(args.max_spp), "--out", folder]
            subprocess.run(command, check=True, capture_output=True)
            kept.write_text((Path(folder) / "stops.csv").read_text())
    return list(csv.DictReader(kept.read_text().splitlines()))


args.out.mkdir(parents=True, exist_ok=True)
print("| scene | seeds | samples per pixel, over seeds | seeds that stop a quarter of their tiles too soon |")
print("|---|---|---|---|")
for scene in args.scenes:
    pictures = [rendered(scene, seed) for seed in range(1, args.seeds + 1)]
    means = [statistics.mean(int(tile["spp"]) for tile in tiles) for tiles in pictures]
    median = statistics.median(means)
    early = [sum(t["reason"] == "converged" and int(t["spp"]) < median / 4 for t in tiles) / len(tiles) for tiles in pictures]
    lucky = sum(share > 0.25 for share in early)
    print(f"| {scene} | {len(pictures)} | {min(means):.0f} to {max(means):.0f}, median {median:.0f} | {lucky} |", flush=True)
