"""Error against time: plots how relMSE falls while the oracle stops tiles, and while all tiles get the same.

    python examples/8-python/error_against_time.py [plot.svg]

Time is counted in samples per pixel, which is what a renderer spends. The plot is an SVG and needs no library.
"""

import sys

import numpy as np

import noisefloor

WIDTH, HEIGHT = 256, 192
PARAMS = noisefloor.Params(tile=64, max_spp=4000)
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
    return np.array(curve)


def plot(curves, path):
    """Two curves on logarithmic axes."""
    points = np.log10(np.concatenate(list(curves.values())))
    low, high = points.min(axis=0), points.max(axis=0)
    share = lambda values: (values - low) / (high - low)  # of the way along each axis
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 500 350" font-family="sans-serif">',
             '<g font-size="12"><rect width="500" height="350" fill="white"/>',
             '<path d="M60 20v280h420" fill="none" stroke="black"/>',
             '<text x="270" y="335" text-anchor="middle">samples per pixel</text>',
             '<text x="20" y="160" transform="rotate(-90 20 160)" text-anchor="middle">relMSE</text>']
    for end, (samples, error) in enumerate(10 ** np.array([low, high])):
        parts.append(f'<text x="{60 + 420 * end}" y="316" text-anchor="middle">{samples:.0f}</text>')
        parts.append(f'<text x="56" y="{304 - 280 * end}" text-anchor="end">{error:.0e}</text>')
    for number, (name, curve) in enumerate(curves.items()):
        colour = ("#d95f02", "#1b9e77")[number]
        line = " ".join(f"{60 + 420 * x:.1f},{300 - 280 * y:.1f}" for x, y in share(np.log10(curve)))
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<text x="320" y="{40 + 18 * number}" fill="{colour}">{name}</text>')
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(parts + ["</g></svg>\n"]))


curves = {"all tiles alike": run(adaptive=False), "the oracle stops tiles": run(adaptive=True)}
for name, curve in curves.items():
    print(f"{name}: relMSE {curve[-1][1]:.2e} with {curve[-1][0]:.0f} samples per pixel on average")
if len(sys.argv) > 1:
    plot(curves, sys.argv[1])
    print(f"plotted in {sys.argv[1]}")
