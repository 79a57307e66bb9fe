"""Error against time: how relMSE falls while the oracle stops tiles, and while all tiles get the same.

    python examples/8-python/error_against_time.py [plot.svg]

Time is counted in samples per pixel, which is what a renderer spends. The plot needs matplotlib.
"""

import sys

import numpy as np

import noisefloor

WIDTH, HEIGHT = 256, 192
PARAMS = noisefloor.Params(tile=64, max_spp=4000, schedule="growing")
Y, X = np.mgrid[:HEIGHT, :WIDTH] + 0.5
NOISE = np.where(X < WIDTH / 2, 0.3, 1.5)[..., None]  # of one sample, relative: the right half is harder
CLEAN = np.repeat((0.05 + np.exp(-((X - 90) ** 2 + (Y - 70) ** 2) / 4000))[..., None], 3, axis=2)


def render(tile, first, spp, seed):
    """The mean of spp new samples of each pixel of a tile."""
    noise = np.random.default_rng([seed, tile.index, first]).normal(size=(tile.height, tile.width, 1))
    return CLEAN[tile.slices] * (1 + noise * NOISE[tile.slices] / np.sqrt(spp))


def run(adaptive):
    """Samples per pixel and relMSE after each round, until the oracle has stopped every tile."""
    session, curve = noisefloor.Session(WIDTH, HEIGHT, params=PARAMS), []
    tiles = [request.tile for request in session.requests()]
    while not session.done:
        wanted = session.requests()
        first, spp = wanted[0].first, wanted[0].spp
        for tile in [request.tile for request in wanted] if adaptive else tiles:
            session.push(tile, spp, render(tile, first, spp, seed=1))
        session.judge()
        curve.append((session.spp().mean(), noisefloor.metrics(session.image(), CLEAN).rel_mse))
    return curve


curves = {"all tiles alike": run(adaptive=False), "the oracle stops tiles": run(adaptive=True)}
for name, curve in curves.items():
    print(name, *(f"{error:.2e} after {samples:6.1f} samples per pixel" for samples, error in curve), sep="\n  ")
if len(sys.argv) > 1:
    from matplotlib import pyplot

    for name, curve in curves.items():
        pyplot.loglog(*zip(*curve), marker=".", label=name)
    pyplot.xlabel("samples per pixel")
    pyplot.ylabel("relMSE")
    pyplot.legend()
    pyplot.savefig(sys.argv[1])
