#!/usr/bin/env python3
"""Looks at a stopped picture as its viewers do, with the package `cvvdp` and no code of this project:

    pip install cvvdp pillow scipy OpenEXR
    look.py people FOLDER-WITH-lisic9-AND-lisic-two     what the worst places of zones had lost where people stopped
    look.py picture STOPPED REFERENCE                   the same of a picture

STOPPED and REFERENCE are folders of `noisefloor render`, with different seeds. Both are shown at the exposure
of the reference. The difference is scaled by sqrt(N / (N + n)) for the noise of the reference."""
import csv, json, math, pathlib, sys
import numpy as np, torch
from PIL import Image
from scipy.ndimage import uniform_filter
import OpenEXR
import pycvvdp

torch.set_num_threads(1)
mapped = pycvvdp.cvvdp(display_name="standard_fhd", heatmap="raw", quiet=True)
plain = pycvvdp.cvvdp(display_name="standard_fhd", quiet=True)

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def load(name):
    """Linear RGB and samples of each pixel."""
    folder = pathlib.Path(name)
    if folder.is_dir():
        finished = folder / "image-denoised.exr"
        path, spp = str(finished if finished.exists() else folder / "image.exr"), None
    else:
        path, spp = name.rsplit(":", 1)
    with OpenEXR.File(path) as file:
        channels = {key: channel.pixels for part in file.parts for key, channel in part.channels.items()}
    key = next((k for k in ("RGB", "RGBA", "ViewLayer.Combined") if k in channels), None)
    rgb = channels[key][..., :3] if key else np.stack([channels[c] for c in "RGB"], -1)
    samples = np.full(rgb.shape[:2], float(spp or 0))
    if folder.is_dir():
        with open(folder / "stops.csv") as file:
            for t in csv.DictReader(file):
                x, y, w, h = (int(t[k]) for k in ("x", "y", "width", "height"))
                samples[y : y + h, x : x + w] = float(t["spp"])
    return rgb.astype(float), samples


def shown(rgb, gain):
    rgb = np.maximum(rgb * gain, 0)
    rgb = np.clip(rgb / (1 + rgb @ WEIGHTS)[..., None], 0, 1)
    encoded = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * np.maximum(rgb, 1e-9) ** (1 / 2.4) - 0.055)
    return Image.fromarray(np.round(encoded * 255).astype(np.uint8))


def contrast(test, truth, edge):
    """Root mean square of visible contrast in a window around each pixel (Mantiuk et al. 2024, 3.7, turned back)."""
    _, stats = mapped.predict(test, truth, dim_order="HWC")
    lost = np.maximum(10 * stats["heatmap"].squeeze().float().cpu().numpy(), 0)
    difference = np.where(lost > 0.04396 * 0.1 ** 0.9302, (lost / 0.04396) ** (1 / 0.9302),
                          lost / (0.04396 * 0.1 ** (0.9302 - 1)))
    return np.sqrt(uniform_filter(difference ** (2 / 2.2644), edge))


def lost(test, truth):
    """JOD that a crop has lost, as an 8-bit picture of its own."""
    bits = lambda a: np.round(np.clip(a, 0, 1) * 255).astype(np.uint8)
    return 10 - float(plain.predict(bits(test), bits(truth), dim_order="HWC")[0])


def inside(box, edge):
    x, y, w, h = box
    half = edge // 2
    return slice(y + half, y + h - half), slice(x + half, x + w - half)


def people(root):
    print("### people-lost\n| | contrast, worst window of a zone | JOD lost by its worst 64×64 | by the zone |")
    print("|---|---|---|---|")
    for folder in ("lisic9", "lisic-two"):
        rows = list(csv.DictReader(open(root / folder / "thresholds.csv")))
        for scene in sorted({r["scene"] for r in rows}):
            files = sorted((root / folder / scene).glob("*.png"), key=lambda p: int(p.stem))
            read = lambda p: np.asarray(Image.open(p).convert("RGB"), dtype=np.float32) / 255
            last, many = read(files[-1]), int(files[-1].stem)
            early = [p for p in files if int(p.stem) <= many / 3][-1]
            of_one = (read(early) - last) / math.sqrt(1 / int(early.stem) - 1 / many)
            zones = [r for r in rows if r["scene"] == scene]
            # The last picture contains the samples of the earlier ones
            noise = [1 / max(1 / min(float(r["human_spp"]), 0.999 * many) - 1 / many, 1e-9) for r in zones]
            typical = math.exp(np.mean(np.log(noise)))
            noisy = np.clip(last + of_one / math.sqrt(typical), 0, 1)
            narrow, wide = contrast(noisy, last, 28), contrast(noisy, last, 64)
            c, crops, whole = [], [], []
            for r, m in zip(zones, noise):
                x, y, w, h = box = [int(r[k]) for k in ("x", "y", "width", "height")]
                c.append(narrow[inside(box, 28)].max() * math.sqrt(typical / m))
                field = wide[inside(box, 64)]
                v, u = np.unravel_index(field.argmax(), field.shape)
                test = last + of_one / math.sqrt(m)
                part = slice(y + v, y + v + 64), slice(x + u, x + u + 64)
                crops.append(lost(test[part], last[part]))
                zone = slice(y, y + h), slice(x, x + w)
                whole.append(lost(test[zone], last[zone]))
            print(f"| {scene} | {math.exp(np.mean(np.log(c))):.2f} ({min(c):.2f} to {max(c):.2f}) | {np.mean(crops):.2f} "
                  f"({min(crops):.2f} to {max(crops):.2f}) | {np.mean(whole):.2f} |", flush=True)


def pictures(stopped, reference, scaled):
    gain = json.load(open(pathlib.Path(reference) / "report.json"))["exposure"]
    (rgb, n), (truth, many) = load(stopped), load(reference)
    scale = np.sqrt(many / (many + n))[..., None] if scaled else 1
    return [np.asarray(shown(a, gain), dtype=np.float32) / 255 for a in (truth + (rgb - truth) * scale, truth)]


def picture(stopped, reference):
    print("### first-picture\n| | JOD lost by the worst window of 64 pixels | contrast in the worst window of 28 |\n|---|---|---|")
    for scaled in (True, False):
        test, truth = pictures(stopped, reference, scaled)
        h, w = truth.shape[:2]
        narrow = contrast(test, truth, 28)[inside((0, 0, w, h), 28)]
        crop = lambda x, y: lost(test[y:y + 64, x:x + 64], truth[y:y + 64, x:x + 64])
        worst = max(crop(x, y) for y in range(0, h - 63, 16) for x in range(0, w - 63, 16))
        print(f"| {'scaled' if scaled else 'as it is'} | {worst:.2f} | {narrow.max():.2f} |")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["people", root]:
            people(pathlib.Path(root))
        case ["picture", stopped, reference]:
            picture(stopped, reference)
        case _:
            sys.exit(__doc__)
