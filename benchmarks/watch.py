"""What a session says of samples that are wrong, and how often of samples that are right (docs/numerics.md).

    pip install ./crates/noisefloor-python && python benchmarks/watch.py [renders]

Pictures of 128×128 pixels in tiles of 64, in the batches that the session asks for: a ramp with stripes, in three
kinds of noise. In "fireflies" a hundredth of the samples has nearly all light.
"""

import sys
import warnings

import numpy as np

import noisefloor

EDGE = 128
Y, X = np.mgrid[:EDGE, :EDGE]
LIGHT = (0.05 + 0.3 * X / EDGE + 0.2 * ((X // 6 + Y // 9) % 2))[..., None] * np.array([1.0, 0.8, 0.5])
RENDERS = int(sys.argv[1]) if len(sys.argv) > 1 else 20


def batch(kind, seed, count, spp):
    """The mean of spp samples of each pixel: LIGHT times noise of mean 1."""
    random, shape = np.random.default_rng([seed, count]), (EDGE, EDGE, 1)
    if kind == "exponential":
        return LIGHT * random.gamma(spp, 1 / spp, shape)
    if kind == "two in three dark":
        return LIGHT * random.binomial(spp, 1 / 3, shape) * 3 / spp
    return LIGHT * (0.2 + random.binomial(spp, 0.01, shape) * 80 / spp)  # fireflies


def encoded(image):
    """As a screen gets it."""
    image = np.clip(image, 0, 1)
    return np.where(image < 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)


def blurred(image):
    return sum(np.roll(image, (y, x), (0, 1)) for y in (-1, 0, 1) for x in (-1, 0, 1)) / 9


def running():
    """A renderer that gives the mean of all samples so far."""
    total, had = 0, 0

    def render(kind, seed, count, spp):
        nonlocal total, had
        total, had = total + spp * batch(kind, seed, count, spp), had + spp
        return total / had

    return render


MISTAKES = {
    "none": lambda: batch,
    "the running mean": running,
    "the same random numbers in every batch": lambda: lambda kind, seed, count, spp: batch(kind, seed, 0, spp),
    "half of a batch is of the one before": lambda: lambda kind, seed, count, spp: (
        batch(kind, seed, count, spp) + batch(kind, seed, count + 1, spp)) / 2,
    "sRGB values": lambda: lambda *args: encoded(3 * batch(*args)),
    "8-bit values": lambda: lambda *args: np.round(255 * encoded(batch(*args))) / 255,
    "-1 everywhere": lambda: lambda *args: np.full((EDGE, EDGE, 3), -1.0),
    "NaN everywhere": lambda: lambda *args: np.full((EDGE, EDGE, 3), np.nan),
    "a filter of three pixels": lambda: lambda *args: blurred(batch(*args)),
}


def said(render, kind, seed, most=400):
    """What a session says first, whether a tile had stopped before, and at how many samples per pixel."""
    params = noisefloor.Params(tile=64, max_spp=10**6)
    session, had, stopped = noisefloor.Session(EDGE, EDGE, params=params), 0, False
    for count in range(10**9):
        spp = session.requests()[0].spp  # the batches that it asks for
        had += spp
        try:
            session.push_image(spp, render(kind, seed, count, spp))
            stops = session.judge()
        except noisefloor.FaultError as error:
            return "error", had, str(error), stopped
        if session.warnings:
            return "warning", had, session.warnings[0], stopped
        stopped = stopped or bool(stops)
        if session.done or had >= most:
            return None, had, "", stopped


warnings.simplefilter("ignore")
for mistake, make in MISTAKES.items():
    for kind in ("exponential", "two in three dark", "fireflies"):
        found = [said(make(), kind, seed) for seed in range(RENDERS)]
        told = [one for one in found if one[0]]
        where = f"at {np.median([one[1] for one in told]):.0f} spp: {told[0][2][:70]}" if told else ""
        kinds, late = "/".join(sorted({one[0] for one in told})), sum(one[3] for one in found)
        print(f"{mistake}; {kind}: {len(told)} of {RENDERS} {kinds}, {late} after a stop, {where}", flush=True)
