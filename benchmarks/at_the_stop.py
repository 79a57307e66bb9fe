#!/usr/bin/env python3
"""JOD that the tiles of a picture have lost: at_the_stop.py [--noisefloor FILE] [--tile N] PICTURE REFERENCE [OUT.png]

PICTURE and REFERENCE are folders that `noisefloor render` wrote, with different seeds, or EXR files with `:SPP` behind their names
(`:0` takes a picture as it is, denoised for instance). Both are tone mapped with the exposure of the reference (Reinhard), cut into
tiles, written as 8-bit PNG, and given to `noisefloor metrics`.

A reference of N samples adds its own noise to that of n samples, so the difference of the two is scaled by sqrt(N / (N + n)): it
is then as strong as that of n samples alone. Prints a table line: worst and median JOD lost so, and the worst as it is. OUT.png gets
picture (left) and reference (right), unscaled. Needs numpy, OpenEXR and pillow.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import tempfile

import numpy as np
import OpenEXR
from PIL import Image

LAYER = "ViewLayer.Combined"
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def load(name):
    """Linear RGB and samples of each pixel."""
    folder = pathlib.Path(name)
    path, _, spp = (str(folder / "image.exr"), "", None) if folder.is_dir() else name.rpartition(":")
    if not folder.is_dir():
        path, spp = name.rsplit(":", 1)
    with OpenEXR.File(path) as file:
        channels = {key: channel.pixels for part in file.parts for key, channel in part.channels.items()}
    key = next((k for k in ("RGB", "RGBA", LAYER) if k in channels), None)
    rgb = channels[key][..., :3] if key else np.stack([channels[c] for c in "RGB"], -1)
    samples = np.full(rgb.shape[:2], float(spp or 0))
    if folder.is_dir():
        with open(folder / "stops.csv") as file:
            for t in csv.DictReader(file):
                x, y, w, h = (int(t[k]) for k in ("x", "y", "width", "height"))
                samples[y : y + h, x : x + w] = float(t["spp"])
    return rgb.astype(float), samples


def exposure(rgb):
    lit = (rgb @ WEIGHTS)[(rgb @ WEIGHTS) > 0]
    delta = 1e-4 * np.exp(np.log(lit).mean())
    return 0.18 / np.exp(np.log(lit + delta).mean())


def shown(rgb, gain):
    rgb = np.maximum(rgb * gain, 0)
    rgb = np.clip(rgb / (1 + rgb @ WEIGHTS)[..., None], 0, 1)
    encoded = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * np.maximum(rgb, 1e-9) ** (1 / 2.4) - 0.055)
    return Image.fromarray(np.round(encoded * 255).astype(np.uint8))


def lost(noisefloor, picture, reference, folder):
    paths = [str(pathlib.Path(folder) / name) for name in ("a.png", "b.png")]
    picture.save(paths[0])
    reference.save(paths[1])
    answer = subprocess.run([noisefloor, "metrics", *paths, "--json"], capture_output=True, check=True, text=True)
    return 10 - json.loads(answer.stdout)["cvvdp_jod"]


def measure(noisefloor, picture, reference, tile):
    """JOD lost by tile, with the difference scaled and as it is; and both pictures as they are shown."""
    (rgb, n), (truth, many) = load(picture), load(reference)
    gain = exposure(truth)
    scale = np.where(n > 0, np.sqrt(many / np.maximum(many + n, 1)), 1)[..., None]
    a, b, own = shown(truth + (rgb - truth) * scale, gain), shown(truth, gain), shown(rgb, gain)
    scaled, plain = [], []
    with tempfile.TemporaryDirectory() as folder:
        for y in range(0, a.height, tile):
            for x in range(0, a.width, tile):
                box = (x, y, min(x + tile, a.width), min(y + tile, a.height))
                scaled.append(lost(noisefloor, a.crop(box), b.crop(box), folder))
                plain.append(lost(noisefloor, own.crop(box), b.crop(box), folder))
    return scaled, plain, own, b, n, many


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--noisefloor", default="target/release/noisefloor")
    parser.add_argument("--tile", type=int, default=64)
    parser.add_argument("--pngs", metavar="FOLDER", help="write shown and scaled pictures there")
    parser.add_argument("picture")
    parser.add_argument("reference")
    parser.add_argument("out", nargs="?")
    args = parser.parse_args()
    scaled, plain, own, truth, n, many = measure(args.noisefloor, args.picture, args.reference, args.tile)
    print(f"| {args.picture} | {n.min():.0f}–{n.max():.0f} | {many.mean():.0f} | {max(scaled):.2f} | "
          f"{np.median(scaled):.2f} | {max(plain):.2f} |")
    print("  " + " ".join(f"{v:.2f}" for v in scaled))
    if args.out:
        both = Image.new("RGB", (own.width * 2 + 8, own.height), "white")
        both.paste(own, (0, 0))
        both.paste(truth, (own.width + 8, 0))
        both.save(args.out)


if __name__ == "__main__":
    main()
