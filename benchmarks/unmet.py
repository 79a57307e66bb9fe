#!/usr/bin/env python3
"""Light of known rate and brightness that few samples find: which tiles does the estimate of unmet light hold?

Needs numpy. Pictures of 128×128 pixels in 16 tiles have light 1 with normal noise whose deviation is 1 in a sample; on a
disc of AREA pixels a sample finds light with chance P, which makes up BRIGHTNESS of the rest there. A tile is held if
what it is likely to lack (crates/noisefloor/src/unmet.rs, written again here) is more than 1 % of its light: half of
what is seen of a wave as wide as a window. Prints Markdown.
"""
import numpy as np

SIZE, TILE, PLACE, SEEDS, SEEN = 128, 32, 28 * 28, 12, 0.01
rng = np.random.default_rng(7)


def highest(half):
    """The largest of the nine values around each pixel."""
    padded = np.pad(half, 1, mode="edge")
    return np.max([padded[y : y + SIZE, x : x + SIZE] for y in range(3) for x in range(3)], axis=0)


def by_tile(plane):
    count = SIZE // TILE
    return plane.reshape(count, TILE, count, TILE).sum((1, 3), dtype="f8")


def lacked(a, b):
    once = 0.5 * (np.maximum(a - highest(b), 0) + np.maximum(b - highest(a), 0))
    light, squares = by_tile(once), by_tile(once.astype("f8") ** 2)
    result = np.zeros_like(light)
    for y, x in np.ndindex(light.shape):
        near = np.s_[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        for scope in (near, np.s_[:, :]):
            if (total := light[scope].sum()) > 0:
                density = total / (light[scope].size * TILE * TILE)
                finds = density * PLACE * total / squares[scope].sum()
                result[y, x] = max(result[y, x], (density - light[y, x] / TILE**2) / (1 + finds))
    return result


def render(spp, area, chance, brightness, deviation=1.0):
    """Both halves, and where and how often light was found."""
    y, x = np.mgrid[:SIZE, :SIZE]
    disc = (y - 70) ** 2 + (x - 60) ** 2 < area / np.pi
    halves, found = [], np.zeros((SIZE, SIZE))
    for _ in range(2):
        hits = np.where(disc, rng.binomial(spp // 2, chance, disc.shape), 0)
        noise = rng.standard_normal(disc.shape) * deviation / np.sqrt(spp // 2)
        halves.append(np.maximum(1 + noise, 0) + hits * (brightness / chance if chance else 0) / (spp // 2))
        found += hits
    return *halves, disc, found


def share(values):
    return f"{100 * np.mean(np.array(values) > SEEN):.0f} %" if values else "–"


def main():
    print("| light on | brightness | chance | spp | finds | held, of tiles that lack it | held, of tiles beside it |")
    print("|---|---|---|---|---|---|---|")
    for area, brightness, chances in ((3000, 0.05, (1e-3, 1e-5)), (3000, 0.3, (1e-3, 1e-4, 1e-5)), (3000, 2, (1e-4, 1e-5, 1e-6)), (300, 2, (1e-3, 1e-4))):
        for chance in chances:
            for spp in (16, 48, 100, 400):
                finds, lack, beside = 0, [], []
                for _ in range(SEEDS):
                    a, b, disc, found = render(spp, area, chance, brightness)
                    held, covered, found = lacked(a, b), by_tile(disc * 1.0) / TILE**2, by_tile(found)
                    finds += found.sum() / SEEDS
                    # Where at least three finds are known, luck is over
                    if found.sum() >= 3:
                        lack += list(held[(covered > 0.05) & (found == 0)])
                        beside += list(held[covered == 0])
                print(f"| {area} pixels | {100 * brightness:.0f} % | {chance:.0e} | {spp} | {finds:.1f} | {share(lack)} | {share(beside)} |")
    print("\n| noise of a sample | spp | noise of the mean | most that a tile lacks |")
    print("|---|---|---|---|")
    for deviation in (0.3, 3, 10):
        for spp in (16, 1000):
            most = max(lacked(*render(spp, 0, 0, 0, deviation)[:2]).max() for _ in range(SEEDS))
            print(f"| {deviation} | {spp} | {100 * deviation / spp**0.5:.1f} % | {100 * most:.3f} % |")


if __name__ == "__main__":
    np.seterr(divide="ignore", invalid="ignore")
    main()
