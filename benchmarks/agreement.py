#!/usr/bin/env python3
"""How far our pictures of a scene agree with Mitsuba's converged reference.

Prints relMSE, and with several pictures of different seeds what of it is not noise. With --png, draws noisefloor | Mitsuba | difference.
Needs what against_mitsuba.py needs, which makes the references; --png also Pillow.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from against_mitsuba import EPSILON, Reference, mean_and_error, read_exr, rel, scene, trimmed, whole


def compare(args):
    pictures = [read_exr(path) for path in args.pictures]
    height, width, _ = pictures[0].shape
    kept = Reference(args.references, args.scene, (width, height), args.max_depth)
    if kept.passes < 2 or any(p.shape != pictures[0].shape for p in pictures):
        sys.exit(f"pictures of one size are needed, and the reference of that size: {kept.file}")
    ours, truth = np.mean(pictures, 0), kept.mean
    errors, noise = rel((ours - truth) ** 2, truth), rel(kept.noise, truth)
    print(f"relMSE {errors.mean():.2e}, trimmed {trimmed(errors):.2e}; of the reference {noise.mean():.2e}, trimmed {trimmed(noise):.2e}")
    if len(pictures) > 1:
        own = rel(np.var(pictures, 0, ddof=1) / len(pictures), truth)
        rest, uncertain = mean_and_error(errors - own - noise)
        print(f"noise of ours {own.mean():.2e}; not noise {rest:.1e} ± {uncertain:.1e}")
    print("mean over the picture, ours / reference:", *(f"{x:.4f}" for x in ours.mean((0, 1)) / truth.mean((0, 1))))
    if args.png:
        draw(args, ours, truth)


def draw(args, ours, truth):
    """Panels side by side, each with its label."""
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        sys.exit("Pillow is missing: pip install pillow, or leave out --png")

    def blocks(picture, n):
        rows, columns = picture.shape[0] // n, picture.shape[1] // n
        return picture[: rows * n, : columns * n].reshape(rows, n, columns, n, 3).mean((1, 3))

    # The difference of luminance, in blocks large enough for their noise to be small
    a, b = (blocks(p, args.block * args.shrink) @ [0.2126, 0.7152, 0.0722] for p in (ours, truth))
    away = np.clip((a - b) / (b + EPSILON) / args.span, -1, 1)[..., None]
    red, blue = np.array([0.70, 0.02, 0.03]), np.array([0.02, 0.09, 0.65])
    difference = 1 - np.abs(away) * (1 - np.where(away > 0, red, blue))
    difference = difference.repeat(args.block, 0).repeat(args.block, 1)

    def encode(linear):
        linear = np.clip(linear, 0, 1)
        return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)

    edge = args.block * args.shrink
    labels = ["noisefloor", "Mitsuba", f"{edge}x{edge} blocks: blue -{args.span:.0%}, red +{args.span:.0%}"]
    pictures = [blocks(p, args.shrink) * args.exposure for p in (ours, truth)] + [difference]
    gap, line = 6, 20
    rows, columns, _ = pictures[0].shape
    sheet = Image.new("RGB", (3 * columns + 2 * gap, rows + line), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    for i, (label, picture) in enumerate(zip(labels, pictures)):
        x = i * (columns + gap)
        sheet.paste(Image.fromarray((encode(picture) * 255 + 0.5).astype(np.uint8)), (x, line))
        pen.text((x, 2), label, fill="black", font=font)
    sheet.save(args.png, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=scene, metavar="SCENE.xml")
    parser.add_argument("pictures", nargs="+", type=Path, metavar="OURS.exr", help="ours; several are averaged")
    parser.add_argument("--references", type=Path, default=Path("references"), help="folder of the references [references]")
    parser.add_argument("--max-depth", type=whole, default=65, help="of the reference [65]")
    parser.add_argument("--png", type=Path, help="picture to write")
    parser.add_argument("--shrink", type=whole, default=2, help="pixels of the renders to one of the picture, each way [2]")
    parser.add_argument("--block", type=whole, default=4, help="pixels of the picture to one of the difference, each way [4]")
    parser.add_argument("--exposure", type=float, default=1.0, help="factor on radiance [1]")
    parser.add_argument("--span", type=float, default=0.1, help="relative difference that has full colour [0.1]")
    compare(parser.parse_args())


if __name__ == "__main__":
    main()
