"""A loop around any function that returns an array: here, a wall in the light of a lamp, with noise.

    python examples/8-python/any_function.py
"""

import numpy as np

import noisefloor

WIDTH, HEIGHT = 256, 192


def render(tile, first, spp):
    """The renderer: the mean of spp new samples of each pixel of a tile. Sample numbers make the seed, so that
    no sample is ever taken twice."""
    random = np.random.default_rng([tile.index, first])
    y, x = np.mgrid[tile.y:tile.y + tile.height, tile.x:tile.x + tile.width] + 0.5
    light = 0.05 + np.exp(-((x - 90) ** 2 + (y - 70) ** 2) / 4000)
    # A sample that is lit one time in four, and four times as bright then, has the right mean
    lit = random.binomial(spp, 0.25, light.shape) * 4 / spp
    return (light * lit)[..., None] * np.array([1.0, 0.9, 0.8])


session = noisefloor.Session(WIDTH, HEIGHT, params=noisefloor.Params(tile=64))
while not session.done:
    for request in session.requests():
        session.push(request.tile, request.spp, render(request.tile, request.first, request.spp))
    for stop in session.judge():
        print(f"tile {stop.tile.index:2}: {stop.reason} at {stop.spp} spp, P = {stop.probability:.3f}")

spp = session.spp()
print(f"{spp.mean():.0f} samples per pixel on average, where the worst tile needed {spp.max()}")
