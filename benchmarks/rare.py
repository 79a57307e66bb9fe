#!/usr/bin/env python3
"""Are there white dots in tiles that are done? Renders scenes with rare light, and prints Markdown.

    rare.py NOISEFLOOR OUT [--seeds 2] [--size 96x96] [--tile 32] [--max-spp 400] [--mean-times 50] SCENE...

Each picture is held against one with 50 times the samples, of another seed. A dot is a pixel that the screen shows as white
(250 of 255 or more) where the reference is nowhere near it above 200. All dots of a place are put into the reference, and
`noisefloor metrics` says how many JODs this costs in the 64 pixels around: 0.3 and more is seen. Renders that are there
already are not repeated.

SCENE is a built-in scene, a file for Cycles (.py), or `glass` or `mirrors`: Mitsuba's Cornell box with a ball of either
under a lamp a hundredth as large.
"""
import argparse
import csv
import json
import re
import subprocess
from pathlib import Path

import numpy as np
from PIL import Image

arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
arguments.add_argument("noisefloor")
arguments.add_argument("out", type=Path)
arguments.add_argument("scenes", nargs="+")
for name, default in [("--seeds", 2), ("--size", "96x96"), ("--tile", 32), ("--max-spp", 400), ("--mean-times", 50)]:
    arguments.add_argument(name, default=default, type=type(default))
args = arguments.parse_args()
BOX = Path(__file__).parent.parent / "fixtures/cornell-box.xml"
BALLS = {
    "glass": '<bsdf type="dielectric"/>',
    "mirrors": '<bsdf type="roughconductor"><string name="material" value="Al"/><float name="alpha" value="0.03"/></bsdf>',
}


def source(scene):
    """How the command is told to render it."""
    if scene in BALLS:
        box = re.sub(r'<shape type="cube".*?</shape>', "", BOX.read_text(), flags=re.DOTALL)
        ball = '<shape type="sphere"><point name="center" x="{}" y="0.5" z="{}"/><float name="radius" value="0.45"/>{}</shape>'
        balls = ball.format(-0.4, -0.2, BALLS[scene]) + ball.format(0.45, 0.3, BALLS[scene])
        lamp = re.search(r'<shape type="rectangle" id="(?:Light|Lamp)".*?</shape>', box, flags=re.DOTALL)
        small = lamp[0].replace("<transform name=\"to_world\">", '<transform name="to_world"><scale value="0.1"/>', 1)
        small = re.sub(r'(<rgb name="radiance" value=")([^"]*)"', lambda m: m[1] + ", ".join(
            str(100 * float(v)) for v in m[2].split(",")) + '"', small)
        file = args.out / f"{scene}.xml"
        file.write_text(box.replace(lamp[0], small).replace("</scene>", balls + "</scene>"))
        return [str(file), "--source", "mitsuba"]
    return [scene, "--source", "cycles"] if scene.endswith(".py") else [scene]


def rendered(scene, name, *options):
    folder = args.out / f"{Path(scene).stem}-{name}"
    if not (folder / "report.json").exists():
        command = [args.noisefloor, "render", *source(scene), "--size", args.size, *map(str, options), "--out", str(folder)]
        subprocess.run(command, check=True, capture_output=True)
    return folder


def picture(folder):
    return np.asarray(Image.open(folder / "image.png").convert("RGB")).astype(int)


def jods_lost(picture, reference, place):
    """By the dots in a window."""
    y, x = (min(max(0, at - 32), max(0, side - 64)) for at, side in zip(place, reference.shape))
    for name, pixels in [("a", picture), ("b", reference)]:
        Image.fromarray(pixels[y:y + 64, x:x + 64].astype(np.uint8)).save(args.out / f"{name}.png")
    command = [args.noisefloor, "metrics", str(args.out / "a.png"), str(args.out / "b.png"), "--json"]
    return 10 - json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["cvvdp_jod"]


args.out.mkdir(parents=True, exist_ok=True)
print("| scene | samples of a pixel, mean | reference | tiles done | dots | seen | of these in tiles that are done |")
print("|---|---|---|---|---|---|---|")
for scene in args.scenes:
    runs = [rendered(scene, seed, "--tile", args.tile, "--seed", seed, "--max-spp", args.max_spp) for seed in range(1, args.seeds + 1)]
    tiles = [list(csv.DictReader((run / "stops.csv").open())) for run in runs]
    means = [sum(int(t["spp"]) for t in stops) / len(stops) for stops in tiles]
    spp = int(args.mean_times * max(means))
    converged = rendered(scene, "reference", "--criterion", f"spp:{spp}", "--max-spp", spp, "--seed", 99)
    truth = picture(converged)
    near = np.max([np.roll(truth.max(axis=2), (dy, dx), (0, 1)) for dy in (-1, 0, 1) for dx in (-1, 0, 1)], axis=0)
    dots, seen, done = 0, 0, 0
    for run, stops in zip(runs, tiles):
        shown = picture(run)
        white = (shown.min(axis=2) >= 250) & (near <= 200)
        dotted = np.where(white[..., None], shown, truth)
        for y, x in np.argwhere(white):
            dots += 1
            if jods_lost(dotted, truth, (y, x)) >= 0.3:
                seen += 1
                tile = next(t for t in stops if 0 <= x - int(t["x"]) < int(t["width"]) and 0 <= y - int(t["y"]) < int(t["height"]))
                done += tile["reason"] == "converged"
    finished = [sum(t["reason"] == "converged" for t in stops) for stops in tiles]
    mean, finished = ", ".join(f"{m:.0f}" for m in means), ", ".join(f"{n} of {len(tiles[0])}" for n in finished)
    print(f"| {Path(scene).stem} | {mean} | {spp} | {finished} | {dots} | {seen} | {done} |", flush=True)
