#!/usr/bin/env python3
"""One model, several renderers: the same scene through every source, each stopped by the oracle.

    renderers.py run --noisefloor ../target/release/noisefloor --out OUT [--size 256x256] [SOURCE=SCENE ...]
    renderers.py show OUT

`run` renders every source twice, with two seeds, into OUT/SOURCE-SEED; what is there already is not rendered again. Without
SOURCE=SCENE, the Cornell box of fixtures/ through all of them. `show` prints a table and writes
OUT/renderers.png: pictures above, stop maps below.

Noise that is left is measured, not taken from the oracle: two runs that share no random number differ by it, and the deviation of
the noise mask (3x3 Gaussian, sigma 1) of their difference, over sqrt(2), is that of one. Needs numpy, OpenEXR and pillow.
"""

import argparse
import csv
import json
import os
import subprocess
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
FIXTURES = os.path.join(HERE, "../fixtures")
CFG = os.path.join(FIXTURES, "cornell-box/cornell-box.cfg")
CORNELL_BOX = {
    "ptwne": "cornell-box",
    "mitsuba": os.path.join(FIXTURES, "cornell-box.xml"),
    "cycles": os.path.join(FIXTURES, "cornell-box/cornell-box.py"),
    "luxcore": CFG,
    "luxcore-sobol": CFG,
    "luxcore-bidir": CFG,
    "luxcore-metropolis": CFG,
}
SEEDS = (1, 2)
TILE = 64


def run(args):
    scenes = dict(pair.split("=", 1) for pair in args.scenes) or CORNELL_BOX
    for source, scene in scenes.items():
        for seed in SEEDS:
            out = os.path.join(args.out, f"{source}-{seed}")
            if complete(out):
                continue
            command = [args.noisefloor, "render", scene, "--source", source, "--size", args.size, "--tile", str(TILE)]
            command += ["--seed", str(seed), "--max-spp", str(args.max_spp), "--out", out, "--quiet", "--force"]
            print(source, seed, flush=True)
            subprocess.run(command, check=True)


def report(folder):
    with open(os.path.join(folder, "report.json")) as file:
        return json.load(file)


def complete(folder):
    return os.path.exists(os.path.join(folder, "report.json")) and report(folder)["complete"]


def pixels(folder):
    """Tone-mapped, display-encoded luminance, as the oracle shows it (Reinhard 2002, sRGB, Rec.709)."""
    import OpenEXR

    with OpenEXR.File(os.path.join(folder, "image.exr")) as file:
        channels = file.channels()
        rgb = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1)
    rgb = rgb.astype(float) * report(folder)["exposure"]
    weights = np.array([0.2126, 0.7152, 0.0722])
    shown = np.clip(rgb / (1 + rgb @ weights)[..., None], 0, 1)
    encoded = np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * np.maximum(shown, 1e-9) ** (1 / 2.4) - 0.055)
    return encoded @ weights


def mask(plane):
    k = np.exp(-np.array([1.0, 0.0, 1.0]) / 2)
    k /= k.sum()
    padded = np.pad(plane, 1, mode="reflect")
    rows = k[0] * padded[:, :-2] + k[1] * padded[:, 1:-1] + k[2] * padded[:, 2:]
    return plane - (k[0] * rows[:-2] + k[1] * rows[1:-1] + k[2] * rows[2:])


def stops(folder):
    with open(os.path.join(folder, "stops.csv")) as file:
        return list(csv.DictReader(file))


def show(args):
    from PIL import Image

    names = [n for n in CORNELL_BOX if all(complete(os.path.join(args.out, f"{n}-{seed}")) for seed in SEEDS)]
    print("| source | mean at the stop | worst tile | saved | noise left, median tile | worst | seconds | oracle's share |")
    print("|---|---|---|---|---|---|---|---|")
    columns = []
    for name in names:
        folders = [os.path.join(args.out, f"{name}-{seed}") for seed in SEEDS]
        counts = np.array([[int(row["spp"]) for row in stops(f)] for f in folders])
        noise = 255 * mask(pixels(folders[0]) - pixels(folders[1])) / np.sqrt(2)
        left = [
            noise[int(r["y"]) : int(r["y"]) + int(r["height"]), int(r["x"]) : int(r["x"]) + int(r["width"])].std()
            for r in stops(folders[0])
        ]
        reports = [report(folder) for folder in folders]
        total = sum(r["seconds_total"] for r in reports)
        oracle = sum(r["seconds_oracle"] for r in reports)
        saved = 1 - counts.mean() / counts.max(axis=1).mean()
        print(
            f"| {name} | {counts.mean():.0f} | {counts.max(axis=1).mean():.0f} | {100 * saved:.0f} % | {np.median(left):.2f} "
            f"| {max(left):.2f} | {total / 2:.1f} | {100 * oracle / total:.1f} % |"
        )
        pictures = [Image.open(os.path.join(folders[0], f)).convert("RGB") for f in ("image.png", "stops.png")]
        width = pictures[0].width
        pictures = [p.resize((width, round(p.height * width / p.width)), Image.LANCZOS) for p in pictures]
        columns.append(np.concatenate([np.asarray(p) for p in pictures], 0))
    height = min(c.shape[0] for c in columns)
    gap = np.full((height, 6, 3), 255, np.uint8)
    row = [part for column in columns for part in (column[:height], gap)][:-1]
    Image.fromarray(np.concatenate(row, 1)).save(os.path.join(args.out, "renderers.png"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("run")
    one.add_argument("scenes", nargs="*", metavar="SOURCE=SCENE")
    one.add_argument("--noisefloor", required=True)
    one.add_argument("--out", required=True)
    one.add_argument("--size", default="256x256")
    one.add_argument("--max-spp", type=int, default=10000)
    two = commands.add_parser("show")
    two.add_argument("out")
    args = parser.parse_args()
    {"run": run, "show": show}[args.command](args)


if __name__ == "__main__":
    sys.exit(main())
