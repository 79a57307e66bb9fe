#!/usr/bin/env python3
"""Prints the tables of docs/denoising.md from what denoising.sh has measured: `denoising.py denoising.csv`."""

import collections
import csv
import itertools
import sys

import numpy

LIMITS = [0.1, 0.2, 0.3, 0.9]
# What estimates are held to is the limit over this: nothing, and `ESTIMATE_ERRS_BY` of noisefloor-denoise
MARGINS = [1.0, 1.5]
# JODs below this are the same to everyone
LEAST = 1e-4
# Samples per pixel before the first verdict of the command
FIRST = 16


def read(path):
    """Of each (scene, spp, tile) what was found, by kind; and the truth's own noise by (scene, tile)."""
    found, truth = collections.defaultdict(dict), {}
    for row in csv.DictReader(open(path)):
        value = float(row["jods_lost"]), float(row["rms"])
        if row["kind"] == "truth":
            truth[row["scene"], row["tile"]] = value
        else:
            found[row["scene"], int(row["spp"]), row["tile"]][row["kind"]] = value
    return found, truth


def ranks(values):
    places = numpy.empty(len(values))
    places[numpy.argsort(values, kind="stable")] = numpy.arange(len(values))
    return places


def line(name, rows, guided=""):
    true, estimate = (numpy.array([row[guided + kind] for row in rows]) for kind in ["true", "estimate"])
    rank = numpy.corrcoef(ranks(true[:, 0]), ranks(estimate[:, 0]))[0, 1]
    logs = numpy.log(numpy.maximum(estimate[:, 0], LEAST) / numpy.maximum(true[:, 0], LEAST))
    bias, error = numpy.exp(logs.mean()), numpy.exp(abs(logs).mean())
    rms = numpy.sqrt((estimate[:, 1] ** 2).mean() / (true[:, 1] ** 2).mean())
    print(f"| {name} | {len(rows)} | {rank:.2f} | ×{bias:.2f} | ×{error:.2f} | ×{rms:.2f} |")


def first(found, scene, tile, kind, limit):
    """The first level of a tile that has lost no more than the limit; twice the last one if none."""
    levels = sorted(spp for s, spp, t in found if (s, t) == (scene, tile) and spp >= FIRST)
    return next((spp for spp in levels if found[scene, spp, tile][kind][0] <= limit), 2 * levels[-1])


def stops(found, truth, limit, margin, guided=""):
    """Tiles whose truth has itself lost more than half of the limit cannot be scored: whether they stopped early is not known."""
    samples, stopped, more, scored, worst, logs = collections.Counter(), 0, 0, 0, 0.0, []
    for scene, tile in truth:
        last = max(spp for s, spp, t in found if (s, t) == (scene, tile))
        need = {kind: first(found, scene, tile, kind, limit) for kind in [guided + "true", "noisy"]}
        need[guided + "estimate"] = first(found, scene, tile, guided + "estimate", limit / margin)
        samples.update(need)
        at = need[guided + "estimate"]
        if at > last:
            continue
        stopped += 1
        if need["noisy"] <= last:
            logs.append(numpy.log(need["noisy"] / at))
        if truth[scene, tile][0] > 0.5 * limit:
            continue
        scored += 1
        lost = found[scene, at, tile][guided + "true"][0] / limit
        more, worst = more + (lost > 1), max(worst, lost)
    saved = samples["noisy"] / samples[guided + "estimate"]
    typical = f"×{numpy.exp(numpy.mean(logs)):.2f}" if logs else "–"
    print(f"| {limit} | {limit / margin:.2f} | {stopped} of {len(truth)} | {more} of {scored} | ×{worst:.1f} "
          f"| {samples[guided + 'estimate']:,} | {samples[guided + 'true']:,} | {samples['noisy']:,} | ×{saved:.2f} | {typical} |")


HEADER = ("\n| limit, JOD | estimate | tiles stopped | lost more | worst | samples | with the truth known | without denoising | saved | "
          "saved by the typical tile |\n|---|---|---|---|---|---|---|---|---|---|")


def guides(found, truth):
    """What albedo and normals gain, by scene: of tiles with a usable truth, the ratio of true losses, and who stops when."""
    print("\n| | tiles | true loss, 16 spp | 64 spp | 256 spp | samples to 0.3 JOD without | with |\n|---|---|---|---|---|---|---|")
    for scene in dict.fromkeys(key[0] for key in found):
        if any("guided-true" not in row for key, row in found.items() if key[0] == scene):
            continue
        ratios = []
        for spp in [16, 64, 256]:
            rows = [row for key, row in found.items() if key[:2] == (scene, spp)]
            pairs = [(max(r["guided-true"][0], LEAST), max(r["true"][0], LEAST)) for r in rows]
            ratios.append(numpy.exp(numpy.mean([numpy.log(a / b) for a, b in pairs])) if pairs else float("nan"))
        tiles = [tile for s, tile in truth if s == scene]
        without, with_guides = (sum(first(found, scene, t, kind, 0.3) for t in tiles) for kind in ["estimate", "guided-estimate"])
        print(f"| {scene} | {len(tiles)} | " + " | ".join(f"×{r:.2f}" for r in ratios) + f" | {without:,} | {with_guides:,} |")


def main():
    found, truth = read(sys.argv[1])
    good = {key: row for key, row in found.items() if truth[key[0], key[2]][1] < 0.5 * row["true"][1]}
    print("| | tiles | rank | bias | error | RMS |\n|---|---|---|---|---|---|")
    for scene in dict.fromkeys(key[0] for key in good):
        line(scene, [row for key, row in good.items() if key[0] == scene])
    line(f"**all** (of {len(found)})", list(good.values()))
    guided = [row for row in good.values() if "guided-true" in row]
    if guided:
        line("with albedo and normals", guided, "guided-")
    for spp in sorted({key[1] for key in good}):
        line(f"{spp} spp", [row for key, row in good.items() if key[1] == spp])
    print(HEADER)
    for limit, margin in itertools.product(LIMITS, MARGINS):
        stops(found, truth, limit, margin)
    if guided:
        scenes = {key[0] for key, row in found.items() if "guided-true" in row}
        some = {key: value for key, value in truth.items() if key[0] in scenes}
        for kind in ["", "guided-"]:
            print(f"\nThe {len(scenes)} scenes with albedo and normals, {'with' if kind else 'without'} them:")
            print(HEADER)
            for limit, margin in itertools.product(LIMITS, MARGINS):
                stops(found, some, limit, margin, kind)
        guides(found, truth)


main()
