#!/usr/bin/env python3
"""Prints the tables of docs/denoising.md from what denoising.sh has measured: `denoising.py denoising.csv`."""

import collections
import csv
import sys

import numpy

LIMITS = [0.04, 0.1, 0.3, 1.0]
# JODs below this are the same to everyone
LEAST = 1e-4


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


def line(name, rows):
    true, estimate = (numpy.array([row[kind] for row in rows]) for kind in ["true", "estimate"])
    rank = numpy.corrcoef(ranks(true[:, 0]), ranks(estimate[:, 0]))[0, 1]
    logs = numpy.log(numpy.maximum(estimate[:, 0], LEAST) / numpy.maximum(true[:, 0], LEAST))
    bias, error = numpy.exp(logs.mean()), numpy.exp(abs(logs).mean())
    rms = numpy.sqrt((estimate[:, 1] ** 2).mean() / (true[:, 1] ** 2).mean())
    print(f"| {name} | {len(rows)} | {rank:.2f} | ×{bias:.2f} | ×{error:.2f} | ×{rms:.2f} |")


def first(found, scene, tile, kind, limit):
    """The first level of a tile that has lost no more than the limit; twice the last one if none."""
    levels = sorted(spp for s, spp, t in found if (s, t) == (scene, tile))
    return next((spp for spp in levels if found[scene, spp, tile][kind][0] <= limit), 2 * levels[-1])


def stops(found, truth, limit):
    most = 2 * max(spp for _, spp, _ in found)
    samples, stopped, early, logs = collections.Counter(), 0, 0, []
    for scene, tile in truth:
        need = {kind: first(found, scene, tile, kind, limit) for kind in ["estimate", "true", "noisy"]}
        samples.update(need)
        if need["estimate"] < most:
            stopped += 1
            early += found[scene, need["estimate"], tile]["true"][0] > 2 * limit
            if need["noisy"] < most:
                logs.append(numpy.log(need["noisy"] / need["estimate"]))
    saved, typical = samples["noisy"] / samples["estimate"], numpy.exp(numpy.mean(logs))
    print(f"| {limit} | {stopped} of {len(truth)} | {early} | {samples['estimate']:,} | {samples['true']:,} "
          f"| {samples['noisy']:,} | ×{saved:.2f} | ×{typical:.2f} |")


def main():
    found, truth = read(sys.argv[1])
    good = {key: row for key, row in found.items() if truth[key[0], key[2]][1] < 0.5 * row["true"][1]}
    print("| | tiles | rank | bias | error | RMS |\n|---|---|---|---|---|---|")
    for scene in dict.fromkeys(key[0] for key in good):
        line(scene, [row for key, row in good.items() if key[0] == scene])
    line(f"**all** (of {len(found)})", list(good.values()))
    for spp in sorted({key[1] for key in good}):
        line(f"{spp} spp", [row for key, row in good.items() if key[1] == spp])
    print("\n| limit, JOD | tiles stopped | early | samples | with the truth known | without denoising | saved | "
          "saved by the typical tile |\n|---|---|---|---|---|---|---|---|")
    for limit in LIMITS:
        stops(found, truth, limit)


main()
