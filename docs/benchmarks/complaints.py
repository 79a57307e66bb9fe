#!/usr/bin/env python3
"""What users complain of in adaptive samplers: the pictures and numbers of complaints.md.

    complaints.py run --noisefloor ../../target/release/noisefloor --out OUT
    complaints.py show --compared DIR --out OUT
    complaints.py run --only-rest …, and show --parts resting --out OUT      frames of a camera at rest alone

`run` renders what is needed besides a comparison into OUT; what is there already is not rendered again. `show` reads that and the
output folders of `noisefloor compare` below DIR (criteria.md has the command), prints the numbers, and writes the pictures into OUT.
Needs numpy, OpenEXR, pillow and matplotlib.
"""

import argparse
import csv
import glob
import os
import subprocess
import sys

import numpy as np

from renderers import mask, pixels, report, stops

HERE = os.path.dirname(os.path.abspath(__file__))
TILE = 64
SMALL = 32
EXPOSURES = ("0.1", "1", "10")
# The camera of the Cornell box moves to the right, by about two pixels a frame.
FRAMES = [f"{0.015 * i:.3f}" for i in range(4)]
REFERENCE_SPP = 4000
RESTING = {"oracle": ["--schedule", "every"], "blocks": ["--blocks", "16"]}


def render(noisefloor, scene, out, *options, tile=TILE):
    if os.path.exists(os.path.join(out, "report.json")) and report(out)["complete"]:
        return
    print(os.path.basename(out), flush=True)
    command = [noisefloor, "render", scene, "--tile", str(tile), "--quiet", "--force", "--out", out, *options]
    subprocess.run(command, check=True)


def run(args):
    folder = lambda *name: os.path.join(args.out, "-".join(name))
    for exposure in EXPOSURES:
        display = ["--tone-mapping", "srgb", "--exposure", exposure]
        render(args.noisefloor, "softbox", folder("exposure", exposure), "--size", "256x256", "--max-spp", "4000", *display)
    size = ["--size", "128x128"]
    render(args.noisefloor, "glass-spheres", folder("glass"), "--max-spp", "4000", *size, tile=SMALL)
    render(args.noisefloor, "glass-spheres", folder("glass", "reference"), "--criterion", "spp:12000", "--seed", "9", *size)
    with open(os.path.join(HERE, "../../fixtures/cornell-box.xml")) as file:
        box = file.read()
    size = ["--size", "192x192"]
    for i, x in enumerate(FRAMES):
        scene = folder("frame", f"{i}.xml")
        with open(scene, "w") as file:
            file.write(box.replace('origin="0, 1, 3.82" target="0, 1, 0"', f'origin="{x}, 1, 3.82" target="{x}, 1, 0"'))
        render(args.noisefloor, scene, folder("frame", str(i), "same"), "--seed", "1", *size)
        render(args.noisefloor, scene, folder("frame", str(i), "other"), "--seed", str(100 + i), *size)
        fixed = str(round(np.mean([int(r["spp"]) for r in stops(folder("frame", "0", "other"))])))
        render(args.noisefloor, scene, folder("frame", str(i), "uniform"), "--seed", str(100 + i), "--criterion", f"spp:{fixed}", *size)
        reference = ["--seed", "77", "--criterion", f"spp:{REFERENCE_SPP}"]
        render(args.noisefloor, scene, folder("frame", str(i), "reference"), *reference, *size)
    rest(args)


def rest(args):
    """Frames of a camera at rest, each with a seed of its own: what differs is noise, without any reference."""
    folder = lambda *name: os.path.join(args.out, "-".join(name))
    for i in range(len(FRAMES)):
        for kind, options in RESTING.items():
            seed = ["--size", "192x192", "--seed", str(200 + i)]
            render(args.noisefloor, "cornell-box", folder("rest", str(i), kind), *options, *seed)
        for kind in RESTING:
            spp = str(round(report(folder("rest", "0", kind))["samples"] / 192**2))
            uniform = ["--size", "192x192", "--seed", str(300 + i), "--criterion", f"spp:{spp}"]
            render(args.noisefloor, "cornell-box", folder("rest", str(i), kind, "uniform"), *uniform)


def rows(path):
    with open(path) as file:
        return list(csv.DictReader(file))


def picture(path):
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB"))


def luma(rgb):
    """Of a picture as it is displayed, in 8-bit steps."""
    return rgb.astype(float) @ np.array([0.2126, 0.7152, 0.0722])


def of_tile(image, row, width=TILE, height=TILE):
    x, y = int(row["x"]), int(row["y"])
    return image[y : y + height, x : x + width]


def larger(image, times):
    return image.repeat(times, 0).repeat(times, 1)


def save_grid(path, columns, gap=6):
    """Columns of pictures of one size, with white between."""
    from PIL import Image

    rows = []
    for line in zip(*columns):
        height = line[0].shape[0]
        parts = [part for image in line for part in (image, np.full((height, gap, 3), 255, np.uint8))][:-1]
        rows += [np.concatenate(parts, 1), np.full((gap, sum(p.shape[1] for p in parts), 3), 255, np.uint8)]
    # 256 colours: small enough to be committed.
    Image.fromarray(np.concatenate(rows[:-1], 0)).quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


def difference(image, reference, times):
    """Grey is none."""
    grey = np.clip(128 + times * (luma(image) - luma(reference)), 0, 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, -1)


def compared(folder):
    """Scenes of the comparisons, by name: folder, and rows of tiles by criterion."""
    scenes = {}
    for path in sorted(glob.glob(os.path.join(folder, "**/tiles.csv"), recursive=True)):
        by_criterion = {}
        for row in rows(path):
            by_criterion.setdefault(row["criterion"], []).append(row)
        scenes[os.path.basename(os.path.dirname(path))] = os.path.dirname(path), by_criterion
    return scenes


def file_of(criterion):
    return criterion.replace(":", "-") + ".png"


def noise_in(folder, criterion, reference, row):
    image = picture(os.path.join(folder, file_of(criterion)))
    return mask(of_tile(luma(image) - luma(reference), row)).std()


CRITERIA = ["oracle", "cycles:0.12", "dammertz:0.012", "relative-error:0.45"]


def dark(args, scenes):
    """Samples and noise in the darkest quarter of the tiles, against those in the brightest."""
    print("\n## dark and bright tiles\n\n| scene | criterion | spp dark | spp bright | noise left dark | bright |\n|---|---|---|---|---|---|")
    columns, most = [], None
    for name, (folder, criteria) in scenes.items():
        reference = picture(os.path.join(folder, "reference.png"))
        tiles = sorted(criteria["oracle"], key=lambda row: of_tile(luma(reference), row).mean())
        quarter = max(1, len(tiles) // 4)
        for criterion in CRITERIA:
            spp = {row["tile"]: int(row["spp"]) for row in criteria[criterion]}
            counts = [np.mean([spp[t["tile"]] for t in part]) for part in (tiles[:quarter], tiles[-quarter:])]
            noise = [
                np.median([noise_in(folder, criterion, reference, t) for t in part])
                for part in (tiles[:quarter], tiles[-quarter:])
            ]
            print(f"| {name} | {criterion} | {counts[0]:.0f} | {counts[1]:.0f} | {noise[0]:.2f} | {noise[1]:.2f} |")
        row = tiles[0]
        spread = np.ptp([noise_in(folder, criterion, reference, row) for criterion in CRITERIA])
        # The picture is of a tile without bright places.
        dark_all_over = np.percentile(of_tile(luma(reference), row), 95) < 128
        if dark_all_over and (most is None or spread > most[0]):
            most = spread, name, row
    _, name, row = most
    folder, _ = scenes[name]
    reference = picture(os.path.join(folder, "reference.png"))
    for criterion in [None, *CRITERIA]:
        image = reference if criterion is None else picture(os.path.join(folder, file_of(criterion)))
        part = of_tile(image, row)
        columns.append([larger(part, 3), larger(difference(part, of_tile(reference, row), 8), 3)])
    print(f"\nPicture: {name}, darkest tile: reference, {', '.join(CRITERIA)}; below, the difference 8 times enlarged")
    save_grid(os.path.join(args.out, "complaints-dark.png"), columns)


def seams(args, scenes):
    """Differences of neighbouring pixels' errors across the borders of tiles, against those inside."""
    print("\n## seams\n\n| scene | energy of steps across borders / inside | largest step of the mean, in standard errors |\n|---|---|---|")
    worst = None
    for name, (folder, criteria) in scenes.items():
        reference = picture(os.path.join(folder, "reference.png"))
        oracle = picture(os.path.join(folder, "oracle.png"))
        error = luma(oracle) - luma(reference)
        spp = {(int(r["x"]), int(r["y"])): int(r["spp"]) for r in criteria["oracle"]}
        across, inside, steps = [], [], []
        for turn, plane in ((False, error), (True, error.T)):
            for at in range(TILE, plane.shape[1], TILE):
                for y in range(0, plane.shape[0], TILE):
                    rows = slice(y, y + TILE)
                    step = plane[rows, at] - plane[rows, at - 1]
                    across.append((step**2).mean())
                    inside.append(np.mean([(plane[rows, at + d] - plane[rows, at + d - 1]) ** 2 for d in (-9, -5, 5, 9)]))
                    sides = [plane[rows, at - 8 : at].ravel(), plane[rows, at : at + 8].ravel()]
                    deviation = np.sqrt(sum(side.var() / side.size for side in sides))
                    steps.append((sides[1].mean() - sides[0].mean()) / max(deviation, 0.05))
                    pair = [(at - TILE, y), (at, y)] if not turn else [(y, at - TILE), (y, at)]
                    ratio = max(spp[p] for p in pair) / min(spp[p] for p in pair)
                    if not turn and (worst is None or ratio > worst[0]):
                        worst = ratio, name, pair, [spp[p] for p in pair]
        print(f"| {name} | {np.sum(across) / np.sum(inside):.2f} | {np.max(np.abs(steps)):.1f} |")
    ratio, name, (left, _), counts = worst
    folder, _ = scenes[name]
    both = {"x": left[0], "y": left[1]}
    cut = lambda file: of_tile(picture(os.path.join(folder, file)), both, 2 * TILE)
    columns = [[larger(cut(f), 3)] for f in ("reference.png", "oracle.png")]
    columns.append([larger(difference(cut("oracle.png"), cut("reference.png"), 8), 3)])
    print(f"\nPicture: {name}, tiles that stopped at {counts[0]} and {counts[1]} spp, side by side: reference, oracle, difference 8 times enlarged")
    save_grid(os.path.join(args.out, "complaints-seams.png"), columns)


def caustics(args):
    """Tiles of glass-spheres, by the noise that is left."""
    folder, truth = os.path.join(args.out, "glass"), os.path.join(args.out, "glass-reference")
    error = 255 * (pixels(folder) - pixels(truth))
    noise = {row["tile"]: mask(of_tile(error, row, SMALL, SMALL)).std() for row in stops(folder)}
    order = sorted(stops(folder), key=lambda row: -noise[row["tile"]])
    print("\n## caustics (glass-spheres)\n\n| tile | spp | reason | noise left |\n|---|---|---|---|")
    for row in order[:4] + order[-2:]:
        print(f"| {row['tile']} | {row['spp']} | {row['reason']} | {noise[row['tile']]:.2f} |")
    image, reference = (picture(os.path.join(f, "image.png")) for f in (folder, truth))
    columns = []
    for row in order[:3]:
        parts = [of_tile(p, row, SMALL, SMALL) for p in (reference, image)]
        columns.append([larger(parts[0], 6), larger(parts[1], 6), larger(difference(parts[1], parts[0], 8), 6)])
    print("Picture: the three tiles with the most noise left: reference, at the stop, difference 8 times enlarged")
    save_grid(os.path.join(args.out, "complaints-caustics.png"), columns)


def displayed(args):
    print("\n## the picture that is displayed (softbox)\n\n| exposure | mean spp | least | most |\n|---|---|---|---|")
    columns = []
    for exposure in EXPOSURES:
        folder = os.path.join(args.out, f"exposure-{exposure}")
        spp = [int(row["spp"]) for row in stops(folder)]
        print(f"| {exposure} | {np.mean(spp):.0f} | {min(spp)} | {max(spp)} |")
        image, heat = (picture(os.path.join(folder, f)) for f in ("image.png", "stops.png"))
        columns.append([larger(image, 2), heat])
    from PIL import Image

    width = columns[0][0].shape[1]
    fit = lambda p: np.asarray(Image.fromarray(p).resize((width, round(p.shape[0] * width / p.shape[1])), Image.LANCZOS))
    save_grid(os.path.join(args.out, "complaints-displayed.png"), [[fit(p) for p in column] for column in columns])


def ends(args):
    """Open tiles over samples, to the end."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 3.2))
    for name in [*(f"exposure-{e}" for e in EXPOSURES), "glass", "frame-0-other"]:
        folder = os.path.join(args.out, name)
        line, width = rows(os.path.join(folder, "timeline.csv")), report(folder)["width"]
        spp = [int(r["samples"]) / width / report(folder)["height"] for r in line]
        label = {"glass": "glass-spheres", "frame-0-other": "cornell-box"}.get(name, name.replace("exposure-", "softbox, exposure "))
        axes.step(spp, [int(r["active_tiles"]) / len(stops(folder)) for r in line], where="post", label=label)
    axes.set(xscale="log", xlabel="samples per pixel, mean over the picture", ylabel="tiles still open", ylim=(-0.02, 1.02))
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(os.path.join(args.out, "complaints-ends.svg"))


def meaning(args, scenes):
    """Noise left in tiles that a criterion stopped, by scene: what its threshold means there."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(CRITERIA), figsize=(10, 3.4), sharey=True)
    print("\n## what a threshold means\n\n| criterion | scenes with stopped tiles | median noise left, least scene | most scene | ratio |\n|---|---|---|---|---|")
    for plot, criterion in zip(axes, CRITERIA):
        medians = {}
        for place, (name, (folder, criteria)) in enumerate(scenes.items()):
            reference = picture(os.path.join(folder, "reference.png"))
            most = max(int(row["spp"]) for of in criteria.values() for row in of)
            done = [row for row in criteria[criterion] if int(row["spp"]) < most]
            noise = [noise_in(folder, criterion, reference, row) for row in done]
            plot.plot([place] * len(noise), noise, ".", color="tab:blue", alpha=0.6)
            if noise:
                medians[name] = np.median(noise)
        values = [value for value in medians.values() if value > 0]
        print(f"| {criterion} | {len(medians)} | {min(values):.2f} | {max(values):.2f} | {max(values) / min(values):.2f} |")
        plot.set_title(criterion, fontsize=10)
        plot.set_xticks(range(len(scenes)), scenes, rotation=90, fontsize=7)
        plot.set_yscale("log")
        plot.grid(alpha=0.3)
    axes[0].set_ylabel("noise left in a stopped tile, 1/255")
    figure.tight_layout()
    figure.savefig(os.path.join(args.out, "complaints-meaning.svg"))


def slower(args, scenes):
    import matplotlib.pyplot as plt

    print("\n## against no adaptivity\n\n| scene | spp mean | of the worst tile | uniform/this by FLIP | by butteraugli | its own time |\n|---|---|---|---|---|---|")
    names, gains = [], []
    for name, (folder, _) in scenes.items():
        for row in rows(os.path.join(os.path.dirname(folder), "runs.csv")):
            if row["scene"] != name or row["criterion"] != "oracle":
                continue
            number = lambda key: float(row[key]) if row[key] else float("nan")
            share = number("criterion_seconds") / number("source_seconds")
            names.append(name)
            gains.append([number("uniform_over_this"), number("uniform_over_this_butteraugli"), number("spp_most") / number("spp_mean")])
            print(f"| {name} | {number('spp_mean'):.0f} | {number('spp_most'):.0f} | {gains[-1][0]:.2f} | {gains[-1][1]:.2f} | {100 * share:.1f} % |")
    figure, axes = plt.subplots(figsize=(9, 3.4))
    place = np.arange(len(names))
    for i, label in enumerate(["equal worst tile by FLIP", "equal worst tile by butteraugli", "all tiles as long as the last"]):
        axes.bar(place + 0.27 * (i - 1), [g[i] for g in gains], 0.25, label=label)
    axes.axhline(1, color="black", linewidth=0.8)
    axes.set_xticks(place, names, rotation=30, fontsize=8)
    axes.set_ylabel("samples of uniform / of the oracle")
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(os.path.join(args.out, "complaints-slower.svg"))


def flicker(args):
    """Noise that changes from frame to frame, and what of it is change of the number of samples."""
    print("\n## flicker\n\n| | change of noise from frame to frame, median tile | worst tile | spp of one tile over the frames, most/least, worst tile |\n|---|---|---|---|")
    columns = []
    frames = range(len(FRAMES))
    folder = lambda i, kind: os.path.join(args.out, f"frame-{i}-{kind}")
    truth = [pixels(folder(i, "reference")) for i in frames]
    for kind, label in (("other", "oracle, a new seed each frame"), ("same", "oracle, one seed"), ("uniform", "uniform, the mean spp of the oracle")):
        errors = [255 * (pixels(folder(i, kind)) - truth[i]) for i in frames]
        tiles = stops(folder(0, kind))
        changes = [mask(b - a) for a, b in zip(errors, errors[1:])]
        noise = [np.median([of_tile(c, row).std() for c in changes]) for row in tiles]
        counts = np.array([[int(row["spp"]) for row in stops(folder(i, kind))] for i in frames])
        ratio = (counts.max(0) / counts.min(0)).max()
        print(f"| {label} | {np.median(noise):.2f} | {max(noise):.2f} | {ratio:.2f} |")
        image = picture(os.path.join(folder(1, kind), "image.png"))
        step = np.clip(128 + 8 * (errors[1] - errors[0]), 0, 255).astype(np.uint8)
        columns.append([larger(image, 2), larger(np.repeat(step[..., None], 3, -1), 2)])
    print(f"One picture's noise times √2 is what independent frames differ by. The references ({REFERENCE_SPP} spp) are in it.")
    save_grid(os.path.join(args.out, "complaints-flicker.png"), columns)


def resting(args):
    """Change of the noise between frames of a camera at rest."""
    print("\n## flicker at rest\n\n| | mean spp | change of noise, median tile | worst tile | worst block |\n|---|---|---|---|---|")
    for kind in RESTING:
        for name in (kind, f"{kind}-uniform"):
            folders = [os.path.join(args.out, f"rest-{i}-{name}") for i in range(len(FRAMES))]
            shown = [255 * pixels(folder) for folder in folders]
            changes = [mask(b - a) for a, b in zip(shown, shown[1:])]
            tiles = [np.median([of_tile(c, row).std() for c in changes]) for row in stops(folders[0])]
            corners = [{"x": x, "y": y} for y in range(0, 192, 16) for x in range(0, 192, 16)]
            blocks = [np.median([of_tile(c, corner, 16, 16).std() for c in changes]) for corner in corners]
            spp = np.mean([report(folder)["samples"] / 192**2 for folder in folders])
            print(f"| {name} | {spp:.0f} | {np.median(tiles):.2f} | {max(tiles):.2f} | {max(blocks):.2f} |")


# What is shown, and of what: comparisons or renders
OF_COMPARISONS = {"dark": dark, "seams": seams, "meaning": meaning, "slower": slower}
OF_RENDERS = {"caustics": caustics, "displayed": displayed, "ends": ends, "flicker": flicker, "resting": resting}


def show(args):
    global TILE
    TILE = args.tile
    scenes = compared(args.compared) if args.compared else {}
    for name in args.parts.split(",") if args.parts else [*OF_COMPARISONS, *OF_RENDERS]:
        if name in OF_RENDERS:
            OF_RENDERS[name](args)
        else:
            OF_COMPARISONS[name](args, scenes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("run")
    one.add_argument("--noisefloor", required=True)
    one.add_argument("--only-rest", action="store_true", help="frames of a camera at rest, and nothing else")
    two = commands.add_parser("show")
    two.add_argument("--compared", help="output folders of comparisons")
    two.add_argument("--tile", type=int, default=TILE, help="of the comparisons")
    two.add_argument("--parts", help="what to show, as in dark,seams,resting; all without it")
    for command in (one, two):
        command.add_argument("--out", required=True)
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    {"run": rest if args.command == "run" and args.only_rest else run, "show": show}[args.command](args)


if __name__ == "__main__":
    sys.exit(main())
