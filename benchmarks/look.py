"""Looks at a stopped picture as its viewers do, with the package `cvvdp` and no code of this project, for figures.py:

    pip install cvvdp pillow scipy OpenEXR

Pictures are folders of `noisefloor render`."""
import csv
import json
import math
import pathlib

import numpy as np
import OpenEXR
import pycvvdp
import torch
from PIL import Image
from scipy.ndimage import uniform_filter

torch.set_num_threads(1)
mapped = pycvvdp.cvvdp(display_name="standard_fhd", heatmap="raw", quiet=True)
plain = pycvvdp.cvvdp(display_name="standard_fhd", quiet=True)

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def load(folder):
    """Linear RGB and samples of each pixel."""
    finished = folder / "image-denoised.exr"
    with OpenEXR.File(str(finished if finished.exists() else folder / "image.exr")) as file:
        channels = {key: channel.pixels for part in file.parts for key, channel in part.channels.items()}
    rgb = channels["RGB"]
    samples = np.zeros(rgb.shape[:2])
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


def people(judged):
    """By scene, of figures.judged(): of each zone, as people stopped there, contrast in its worst window, JOD lost by its worst
    64x64, and by all of it."""
    for scene, last, many, early, n, zones in judged:
        last = last.astype(np.float32)
        of_one = (early.astype(np.float32) - last) / math.sqrt(1 / n - 1 / many)
        # The last picture contains the samples of the earlier ones
        noise = [1 / max(1 / min(float(r["human_spp"]), 0.999 * many) - 1 / many, 1e-9) for r in zones]
        typical = math.exp(np.mean(np.log(noise)))
        noisy = np.clip(last + of_one / math.sqrt(typical), 0, 1)
        narrow, wide = contrast(noisy, last, 28), contrast(noisy, last, 64)
        found = []
        for r, m in zip(zones, noise):
            x, y, w, h = box = [int(r[k]) for k in ("x", "y", "width", "height")]
            field = wide[inside(box, 64)]
            v, u = np.unravel_index(field.argmax(), field.shape)
            test = last + of_one / math.sqrt(m)
            part, zone = np.s_[y + v : y + v + 64, x + u : x + u + 64], np.s_[y : y + h, x : x + w]
            c = narrow[inside(box, 28)].max() * math.sqrt(typical / m)
            found.append((c, lost(test[part], last[part]), lost(test[zone], last[zone])))
        yield scene, *zip(*found)


def picture(out, scaled):
    """JOD lost by the worst window of 64 pixels of `stopped` in a folder, and contrast in its worst window of 28, against
    `reference`, of another seed, both at its exposure. scaled: the difference is, by sqrt(N / (N + n)), for the reference's noise."""
    stopped, reference = pathlib.Path(out, "stopped"), pathlib.Path(out, "reference")
    gain = json.loads((reference / "report.json").read_text())["exposure"]
    (rgb, n), (truth, many) = load(stopped), load(reference)
    scale = np.sqrt(many / (many + n))[..., None] if scaled else 1
    test, truth = (np.asarray(shown(a, gain), dtype=np.float32) / 255 for a in (truth + (rgb - truth) * scale, truth))
    h, w = truth.shape[:2]
    crops = (np.s_[y : y + 64, x : x + 64] for y in range(0, h - 63, 16) for x in range(0, w - 63, 16))
    return max(lost(test[crop], truth[crop]) for crop in crops), contrast(test, truth, 28)[inside((0, 0, w, h), 28)].max()
