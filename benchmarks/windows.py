#!/usr/bin/env python3
"""Where people look, from the pictures themselves: predicts people's thresholds with the package `cvvdp` (no code of this
project), by the root mean square of visible contrast in the worst window of each zone, and by means over the zone.

    pip install cvvdp pillow scipy; benchmarks/windows.py FOLDER-WITH-lisic9-AND-lisic-two

The stimulus of n samples beside a last picture of N that contains them is noise of m samples, 1/m = 1/n - 1/N. Noise is
taken from an early picture and laid over the last one in the strength of the scene's mean threshold; contrast is in
proportion to it. Scenes are left out in turn, both Sdb* together. Weights are by ridge regression on ln m."""
import csv, math, pathlib, sys
import numpy as np, torch
from PIL import Image
from scipy.ndimage import uniform_filter
import pycvvdp

GROUPS = lambda scene: "Sdb" if scene.startswith("Sdb") else scene
root = pathlib.Path(sys.argv[1])
metric = pycvvdp.cvvdp(display_name="standard_fhd", heatmap="raw", quiet=True)
zones = []
for folder in ("lisic9", "lisic-two"):
    rows = list(csv.DictReader(open(root / folder / "thresholds.csv")))
    for scene in sorted({r["scene"] for r in rows}):
        of = [r for r in rows if r["scene"] == scene]
        files = sorted((root / folder / scene).glob("*.png"), key=lambda p: int(p.stem))
        read = lambda p: np.asarray(Image.open(p).convert("RGB"), dtype=np.float32) / 255
        last, N = read(files[-1]), int(files[-1].stem)
        early = [p for p in files if int(p.stem) <= N / 3][-1]
        n0 = int(early.stem)
        unit = (read(early) - last) / math.sqrt(1 / n0 - 1 / N)
        as_noise = lambda n: 1 / max(1 / n - 1 / N, 1e-9)
        human = [as_noise(min(float(r["human_spp"]), 0.999 * N)) for r in of]
        h = math.exp(np.mean(np.log(human)))
        noisy = np.clip(last + unit / math.sqrt(h), 0, 1)
        _, stats = metric.predict(noisy, last, dim_order="HWC")
        raw = stats["heatmap"].squeeze().float().cpu().numpy()
        lost = np.maximum(10 * raw, 0)
        # JODs lost -> difference (Mantiuk et al. 2024, 3.7) -> contrast
        difference = np.where(lost > 0.04396 * 0.1 ** 0.9302, (lost / 0.04396) ** (1 / 0.9302),
                              lost / (0.04396 * 0.1 ** (0.9302 - 1)))
        energy = difference ** (2 / 2.2644)
        light = np.log(np.mean(last @ np.array([0.2126, 0.7152, 0.0722])) ** 2.2 + 0.002)
        for r, m in zip(of, human):
            x, y, w, hh = (int(r[k]) for k in ("x", "y", "width", "height"))
            part, d = energy[y:y + hh, x:x + w], difference[y:y + hh, x:x + w]
            pooled = {"order 4 over the zone": (d ** 4).mean() ** 0.25, "RMS contrast over the zone": math.sqrt(part.mean())}
            for edge in (16, 20, 28, 36, 64):
                inside = slice(edge // 2, -(edge // 2))
                pooled[f"worst window of {edge}"] = math.sqrt(uniform_filter(part, edge)[inside, inside].max())
            grown = {k: math.log(v) / (2.2644 if k.startswith("order") else 1) for k, v in pooled.items()}
            zones.append(dict(scene=scene, group=GROUPS(scene), human=float(r["human_spp"]), m=m, N=N, h=h, light=light,
                              first=float(r["first_spp"]), last=float(r["last_spp"]), **grown))
        print(scene, flush=True, file=sys.stderr)

scenes = sorted({z["scene"] for z in zones})
human = np.array([z["human"] for z in zones])
names = [k for k in zones[0] if k.startswith(("order", "RMS", "worst"))]
print("| pooling | one constant: error, worst scene, early | with the picture's noise and light: error, worst, early |")
print("|---|---|---|")
for name in names:
    # ln of the noise of one sample, in the unit of contrast
    noise = np.array([z[name] + 0.5 * math.log(z["h"]) for z in zones])
    of_scene = np.array([np.quantile([n for n, o in zip(noise, zones) if o["scene"] == z["scene"]], 7 / 8) for z in zones])
    light = np.array([z["light"] for z in zones])
    goal = np.log([z["m"] for z in zones])
    cells = []
    for extra in (np.zeros((len(zones), 0)), np.c_[of_scene - noise, light]):
        predicted = np.zeros(len(zones))
        for group in {z["group"] for z in zones}:
            train = np.array([z["group"] != group for z in zones])
            x = np.c_[extra, np.ones(len(zones))]
            rest = goal - 2 * noise
            mean = x[train].mean(0); mean[-1] = 0
            centred = x - mean
            penalty = np.diag([1.0] * extra.shape[1] + [0.0])
            w = np.linalg.solve(centred[train].T @ centred[train] + penalty, centred[train].T @ rest[train])
            predicted[~train] = (2 * noise + centred @ w)[~train]
        spp = np.array([np.clip(1 / (math.exp(-p) + 1 / z["N"]), z["first"], z["last"]) for p, z in zip(predicted, zones)])
        ratio = np.log(spp / human)
        worst = max(np.abs(ratio[[z["scene"] == s for z in zones]]).mean() for s in scenes)
        cells.append(f"x{math.exp(np.abs(ratio).mean()):.2f}, {math.exp(worst):.2f}, {100 * np.mean(ratio < math.log(0.5)):.0f} %")
    print(f"| {name} | {cells[0]} | {cells[1]} |", flush=True)
