#!/usr/bin/env python3
"""What a corpus of small scenes says of the estimate of denoised pictures, and of where samples go: docs/benchmarks/where.md.

    random_scenes.py SCENES 8                           writes scenes of four families
    denoised_corpus.py mitsuba VARIANT OUT SCENE.xml…   renders halves and references of 128×128 pixels by Mitsuba (cuda_ad_rgb)
    denoised_corpus render OUT/NAME SCENE.xml 128       denoises them (an example of noisefloor-cli; renders what is not there)
    denoised_corpus estimate OUT/NAME > OUT/NAME/estimate.csv
    denoised_corpus.py gather EXAMPLE OUT > denoised-corpus.csv
    denoised_corpus.py tables denoised-corpus.csv

The parts of the estimate are computed here a second time, with numpy, and no code of noisefloor-denoise; the example is asked for
JODs only, and those of `check` come from the PyPI package cvvdp. Needs numpy and scipy; mitsuba, or pycvvdp, where asked for."""
import argparse
import csv
import itertools
import pathlib
import subprocess
import sys

import numpy as np

EDGE, TILE, SQUARE = 128, 32, 64
TILES = [(x, y) for y in range(0, EDGE, TILE) for x in range(0, EDGE, TILE)]
# Of both halves together
LEVELS = np.array([16, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024])
REFERENCE, AT_ONCE = 8192, 512
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
LIMIT, LEAST, DECAY = 0.3, 1e-3, 0.38
# Tiles whose reference has itself lost as much are left out
NOISY_REFERENCE = 0.1
# The rule: power, step, margin from 16 tiles on
TOGETHER, STEP, MARGIN = 0.72, 1.2, 1.1
BEFORE = 1.5
# What verdicts count the mean of four as
GAIN = 0.97
COLUMNS = "estimate true true_denoised noisy noise variance sum change dammertz relative cycles".split()
# The constants that agree with people (criteria.md), and those that are tried
PEOPLE = {"dammertz": 0.0046, "relative": 0.17, "cycles": 0.081}
TRIED = np.exp(0.05 * np.arange(-30, 61))


def load(folder, name, channels=3):
    values = np.fromfile(folder / name, dtype="<f4").astype(np.float64)
    return values.reshape(EDGE, EDGE, channels) if channels > 1 else values.reshape(EDGE, EDGE)


def mitsuba(args):
    import mitsuba as mi

    mi.set_variant(args.variant)
    for path in map(pathlib.Path, args.scenes):
        out = args.out / path.parent.name
        out.mkdir(parents=True, exist_ok=True)
        scene = mi.load_file(str(path))
        take = lambda spp, seed: np.array(mi.render(scene, spp=spp, seed=seed), dtype=np.float64)
        for half, name in enumerate("ab", 1):
            total = 0.0
            for i, level in enumerate(LEVELS):
                step = int(level - (LEVELS[i - 1] if i else 0)) // 2
                total = total + take(step, 1000 * half + i) * step
                (total / (level // 2)).astype("<f4").tofile(out / f"{name}-{level:05}.f32")
            rest = REFERENCE // AT_ONCE
            (sum(take(AT_ONCE, 1000 * (half + 2) + i) for i in range(rest)) / rest).astype("<f4").tofile(out / f"reference-{name}.f32")


class Display:
    """Reinhard's operator as noisefloor has it, with the exposure that this picture asks for."""

    def __init__(self, picture):
        light = picture @ LUMINANCE
        light = light[light > 0]
        mean = np.exp(np.log(light).mean())
        self.exposure = 0.18 / np.exp(np.log(1e-4 * mean + light).mean())

    def luma(self, picture):
        exposed = np.maximum(picture * self.exposure, 0)
        linear = np.minimum(exposed / (1 + exposed @ LUMINANCE)[..., None], 1)
        return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-12) ** (1 / 2.4) - 0.055) @ LUMINANCE


def split(plane, level):
    from scipy.ndimage import convolve1d

    spline = np.zeros(4 * 2**level + 1)
    spline[:: 2**level] = np.array([1, 4, 6, 4, 1]) / 16
    rest = convolve1d(convolve1d(plane, spline, axis=1, mode="mirror"), spline, axis=0, mode="mirror")
    return plane - rest, rest


def around(plane, radius):
    """The mean of what lies in the picture, and of how many pixels."""
    from scipy.ndimage import uniform_filter

    inside = uniform_filter(np.ones_like(plane), 2 * radius + 1, mode="constant")
    return uniform_filter(plane, 2 * radius + 1, mode="constant") / inside, inside * (2 * radius + 1) ** 2


def common(a, b, radius, errors):
    """What two residuals have in common, scale by scale, less so many standard errors of it."""
    found = np.zeros_like(a)
    for scale in range(6):
        (fine_a, a), (fine_b, b) = (split(a, scale), split(b, scale)) if scale < 5 else ((a, a), (b, b))
        product = fine_a * fine_b
        shared, count = around(product, radius)
        energy, _ = around(0.25 * (fine_a + fine_b) ** 2, radius)
        spread = np.maximum(around(product**2, radius)[0] - shared**2, 0)
        # Of a scale, as many values are independent as fit
        shared = shared - errors * np.sqrt(spread * np.minimum(2 * 4.0**scale / count, 1))
        found += np.sqrt(np.clip(shared / np.maximum(energy, 1e-30), 0, 1)) * 0.5 * (fine_a + fine_b)
    return found


def planes(folder, level, display):
    """What is shown; half the difference of the denoised halves; both residuals; how far all samples, denoised, are from the mean."""
    a, b, da, db, once = (load(folder, f"{name}-{level:05}.f32") for name in ("a", "b", "da", "db", "once"))
    mean = np.maximum(0.5 * (da + db), 0)
    step = np.maximum(0.02 * mean.max(axis=2), 1e-4 / display.exposure)
    residuals = [np.zeros((EDGE, EDGE)), np.zeros((EDGE, EDGE))]
    for c in range(3):
        up, down = mean.copy(), mean.copy()
        up[..., c], down[..., c] = mean[..., c] + step, np.maximum(mean[..., c] - step, 0)
        slope = (display.luma(up) - display.luma(down)) / (up[..., c] - down[..., c])
        for residual, noisy, denoised in zip(residuals, (a, b), (da, db)):
            residual += slope * (noisy[..., c] - denoised[..., c])
    shown, one, other = display.luma(mean), display.luma(da), display.luma(db)
    most = 0.5 * np.abs(one - other)
    held = np.clip((shown - 0.5 * (one + other)) / np.maximum(most, 1e-30), 0, 1) ** 2
    difference = 0.5 * (1 + held) * (one - other)
    difference = -difference if (difference**3).sum() < 0 else difference
    clean = np.where(difference > 0, shown - held * np.abs(one - other), shown)
    return clean, difference, *(np.clip(r, -0.5, 0.5) for r in residuals), display.luma(once) - shown


def square(x, y):
    at = lambda v: min(max(v + TILE // 2 - SQUARE // 2, 0), EDGE - SQUARE)
    return at(x), at(y)


class Jods:
    """Pairs for the example, and what it says of them: the lesser of a tile and the square around it."""

    def __init__(self, example):
        self.example, self.data, self.keys = example, [], []

    def ask(self, key, shown, field):
        for tile, (x, y) in enumerate(TILES):
            for (left, top), edge in (((x, y), TILE), (square(x, y), SQUARE)):
                reference = shown[top:top + edge, left:left + edge]
                test = reference + field[top:top + edge, left:left + edge]
                self.data.append(np.array([edge, edge], dtype="<u4").tobytes() + test.astype("<f4").tobytes() + reference.astype("<f4").tobytes())
                self.keys.append((*key, tile))

    def answers(self):
        said = subprocess.run([self.example, "jods"], input=b"".join(self.data), capture_output=True, check=True).stdout.split()
        found = {}
        for key, lost in zip(self.keys, map(float, said)):
            found[key] = min(found.get(key, 10.0), lost)
        return found


def tiles_of(plane):
    return plane.reshape(EDGE // TILE, TILE, EDGE // TILE, TILE).swapaxes(1, 2).reshape(len(TILES), -1)


def near(plane, reduce):
    """The least, or the largest, of each pixel and its eight neighbours."""
    beside = np.pad(plane, 1, mode="edge")
    rows = reduce.reduce([beside[:, i:i + EDGE] for i in range(3)])
    return reduce.reduce([rows[i:i + EDGE] for i in range(3)])


def plain_rules(folder, exposure):
    """By level and tile: the mean error of Dammertz et al.'s criterion, without its factor for the area; the least constant for which 95 % of
    the pixels have a small relative error, as in Mitsuba 0.6; and the least of those tried with which Cycles has stopped (noisefloor-rivals)."""
    from scipy.stats import t as student

    enough = int(np.ceil(0.95 * TILE * TILE)) - 1
    found = {name: np.full((len(LEVELS), len(TILES)), np.inf) for name in PEOPLE}
    constants = PEOPLE["cycles"] * TRIED
    converged = np.zeros((len(constants), EDGE, EDGE), bool)
    before, (samples, mean, squares, batches) = {"a": 0.0, "b": 0.0}, (0.0, 0.0, 0.0, 0)
    for i, level in enumerate(LEVELS):
        halves = {half: exposure * load(folder, f"{half}-{level:05}.f32") for half in "ab"}
        both = 0.5 * (halves["a"] + halves["b"])
        apart, light = 0.5 * np.abs(halves["a"] - halves["b"]).sum(-1), both.sum(-1)
        found["dammertz"][i] = tiles_of(np.where(light > 0, apart / np.sqrt(np.maximum(light, 1e-30)), 0)).mean(1)

        more = (level - (LEVELS[i - 1] if i else 0)) / 2
        for half in "ab":
            now = halves[half] @ LUMINANCE * level / 2
            batch, before[half] = (now - before[half]) / more, now
            samples, batches = samples + more, batches + 1
            step = batch - mean
            mean = mean + step * more / samples
            squares = squares + step * (batch - mean) * more
        width = student.ppf(0.975, batches - 1) * np.sqrt(squares / (batches - 1) / samples)
        relative = width / np.maximum(mean, 0.01 * (both @ LUMINANCE).mean())
        found["relative"][i] = np.sort(tiles_of(relative), axis=1)[:, enough]

        light = np.maximum(light, 0)
        error = apart / (1e-4 + np.where(light < 1, np.sqrt(light), light))
        for constant, own in zip(constants, converged):
            done = np.kron((found["cycles"][:i + 1].min(0) <= constant).reshape(EDGE // TILE, -1), np.ones((TILE, TILE), bool))
            if done.all():
                continue
            if level >= np.ceil(16 / constant**0.3):
                own |= error < constant
            # What has not converged keeps its neighbours, unless its tile is done
            own &= near(own | done, np.logical_and) | done
            passed = np.sort(tiles_of(own), axis=1)[:, -enough - 1] & ~tiles_of(done).all(1)
            found["cycles"][i, passed] = np.minimum(found["cycles"][i, passed], constant)
    found["cycles"] = np.minimum.accumulate(found["cycles"])
    return found


def dammertz(errors, constant):
    """Dammertz et al.'s criterion: the level at which each tile is done, of the mean errors of levels × rows × columns of tiles, as
    noisefloor-rivals has it. A block of tiles is done when √(its share of the picture) times its error is small; else it is cut in two."""
    count, rows, columns = errors.shape
    levels = np.full((rows, columns), count)

    def refine(level, top, bottom, left, right):
        own = errors[level, top:bottom, left:right]
        error = np.sqrt(own.size / (rows * columns)) * own.mean()
        if error < constant:
            levels[top:bottom, left:right] = level
        elif error < 256 * constant and own.size > 1:
            wide = bottom - top == 1 or (right - left > 1 and right - left >= bottom - top)
            sums = np.cumsum(own.sum(0 if wide else 1))
            cut = int(np.argmin(np.abs(2 * sums[:-1] - sums[-1]))) + 1
            halves = ([(top, bottom, left, left + cut), (top, bottom, left + cut, right)] if wide
                      else [(top, top + cut, left, right), (top + cut, bottom, left, right)])
            return [block for half in halves for block in refine(level, *half)]
        else:
            return [(top, bottom, left, right)]
        return []

    blocks = [(0, rows, 0, columns)]
    for level in range(count):
        blocks = [block for old in blocks for block in refine(level, *old)]
    return levels


def gather(args):
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(["scene", "spp", "tile", *COLUMNS])
    for folder in sorted(args.out.iterdir()):
        if not (folder / "estimate.csv").exists():
            continue
        found = {}
        for _, spp, tile, kind, own, around_ in csv.reader(open(folder / "estimate.csv")):
            found[int(spp), kind.replace("-", "_"), int(tile)] = min(float(own), float(around_))
        display = Display(0.5 * (load(folder, "reference-a.f32") + load(folder, "reference-b.f32")))
        jods = Jods(args.example)
        for level in LEVELS:
            shown, difference, a, b, change = planes(folder, level, display)
            jods.ask((level, "variance"), shown, difference)
            jods.ask((level, "sum"), shown, 1.4 * difference + common(a, b, 16, 1.0))
            jods.ask((level, "change"), shown, 1.4 * difference + 1.5 * change)
            jods.ask((level, "noise"), load(folder, f"on-{level:05}.luma", 1), load(folder, f"noise-{level:05}.luma", 1))
        found.update(jods.answers())
        for name, planes_ in plain_rules(folder, display.exposure).items():
            found.update({(level, name, tile): v for level, own in zip(LEVELS, planes_) for tile, v in enumerate(own)})
        for tile in range(len(TILES)):
            truth = [f"{found[0, kind, tile]:.3f}" for kind in ("reference", "reference_denoised")]
            rows.writerow([folder.name, 0, tile, "", *truth, *[""] * (len(COLUMNS) - 3)])
            for level in LEVELS:
                values = (f"{found[level, name, tile]:{'.4g' if name in PEOPLE else '.4f'}}" for name in COLUMNS)
                rows.writerow([folder.name, level, tile, *values])


def check(args):
    """True losses of squares of 64 by the PyPI package, beside those of the example."""
    import pycvvdp

    metric = pycvvdp.cvvdp(display_name="standard_fhd", quiet=True)
    ratios = []
    for folder in args.folders:
        said = {(int(r[1]), r[3], int(r[2])): float(r[5]) for r in csv.reader(open(folder / "estimate.csv"))}
        truth = 0.5 * (load(folder, "reference-a.f32") + load(folder, "reference-b.f32"))
        display = Display(truth)
        for level in (32, 128):
            shown, reference = display.luma(load(folder, f"shown-{level:05}.f32")), display.luma(truth)
            for tile, (x, y) in enumerate(TILES):
                if (x // TILE + y // TILE) % 3:
                    continue
                left, top = square(x, y)
                grey = [np.repeat(p[top:top + SQUARE, left:left + SQUARE, None], 3, 2).astype(np.float32) for p in (shown, reference)]
                lost = 10 - float(metric.predict(*grey, dim_order="HWC")[0])
                ratios.append((lost, said[level, "true", tile]))
                print(f"{folder.name} {level} {tile}: {lost:.4f} {said[level, 'true', tile]:.4f}")
    pairs = np.array(ratios)
    print(f"largest difference {np.abs(pairs[:, 0] - pairs[:, 1]).max():.5f} of {len(pairs)}")


def family(name):
    head = name.rsplit("-", 1)[0]
    return head if head in ("rooms", "glass", "outside", "leaves") else "files"


class Corpus:
    """All values by scene, level and tile."""

    def __init__(self, path):
        rows = list(csv.DictReader(open(path)))
        self.names = sorted({row["scene"] for row in rows})
        shape = (len(self.names), len(LEVELS), len(TILES))
        self.values = {name: np.full(shape, np.nan) for name in COLUMNS}
        self.reference = np.full((shape[0], shape[2]), np.nan)
        place, level = {n: i for i, n in enumerate(self.names)}, {int(n): i for i, n in enumerate(LEVELS)}
        for row in rows:
            s, t = place[row["scene"]], int(row["tile"])
            if row["spp"] == "0":
                self.reference[s, t] = float(row["true"])
                continue
            for name in COLUMNS:
                self.values[name][s, level[int(row["spp"])], t] = float(row[name])
        self.true, self.good = self.values["true"], self.reference < NOISY_REFERENCE
        self.families = np.array([family(name) for name in self.names])
        # Scenes with a reference in half of their tiles at least
        self.scenes = [s for s in range(shape[0]) if self.good[s].sum() >= len(TILES) // 2]


SPP = np.append(LEVELS, 2 * LEVELS[-1]).astype(float)


def first_below(values, limit, first):
    """The first level at which each tile is at most at its limit; beyond the last one if none."""
    below = (values <= limit) & (LEVELS >= first)[None, :, None]
    return np.where(below.any(1), below.argmax(1), len(LEVELS))


def play(estimate, first, limit, power, spp=SPP, share=1):
    """The rule as it runs, in one picture of tiles × levels: the last level of each tile, and whether it was satisfied there.
    The last of `spp` is what tiles count that are never satisfied; others are drawn to what this share of them needs."""
    last = len(spp) - 1
    levels = np.full(len(estimate), np.searchsorted(spp, first))
    need, fresh = np.full(len(estimate), -1), np.ones(len(estimate), bool)
    while True:
        for i in np.flatnonzero(fresh):
            satisfied = levels[i] < last and estimate[i, levels[i]] <= limit
            need[i] = (need[i] if need[i] >= 0 else levels[i]) if satisfied else -1
        done = need >= 0
        most = np.quantile(np.where(done, spp[need], spp[levels]), share, method="higher")
        wanted = spp[np.maximum(need, 0)] ** power * most ** (1 - power)
        fresh = (levels < last) & (~done | (wanted >= STEP * spp[levels]))
        if not fresh.any():
            return levels, done
        levels = levels + fresh


def measures(lost):
    return [lost.max(), np.quantile(lost, 0.95), np.median(lost), lost.mean()]


def run(corpus, pictures, first, margin, power, estimate=None, share=1):
    """Samples and losses of each picture, a list of (scene, tile); and the losses, over the limit, of all tiles that were satisfied."""
    estimate = GAIN * corpus.values["estimate"] if estimate is None else estimate
    true = np.concatenate([corpus.true, corpus.true[:, -1:]], 1)
    rows, lost = [], []
    for picture in pictures:
        s, t = np.array(picture).T
        levels, done = play(estimate[s, :, t], first, LIMIT / margin, power, share=share)
        found = true[s, levels, t]
        rows.append([SPP[levels].mean(), *measures(found)])
        lost += [(family(corpus.names[scene]), value / LIMIT) for scene, value in zip(s[done], found[done])]
    return np.array(rows), lost


def mean_of(rows):
    return np.exp(np.log(np.maximum(rows, LEAST)).mean(0))


def pictures_of(corpus, scenes_each, count=24):
    draw = np.random.default_rng(7)
    chosen = [[s] for s in corpus.scenes] if scenes_each == 1 else [draw.choice(corpus.scenes, scenes_each, replace=False) for _ in range(count)]
    return [[(s, t) for s in some for t in range(len(TILES)) if corpus.good[s, t]] for some in chosen]


def where(corpus):
    print("\n| pictures | first | power | margin | samples | worst | most of 20 | median | mean | beyond | the worst of these |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    kinds = [("one tile", [[(s, t)] for s in corpus.scenes for t in range(16) if corpus.good[s, t]])]
    kinds += [("one scene, 16 tiles", pictures_of(corpus, 1)), ("four scenes", pictures_of(corpus, 4)), ("twelve scenes", pictures_of(corpus, 12))]
    tried = [(48, 1, 1.5, 1), (48, 1, 1.3, 1), (48, 0.72, 1.1, 1), (32, 0.72, 1.1, 1), (16, 0.72, 1.1, 1), (32, 0.5, 1.1, 1), (32, 0.72, 1.1, 0.95)]
    for (name, pictures), (first, power, margin, share) in itertools.product(kinds, tried):
        rows, lost = run(corpus, pictures, first, margin, power, share=share)
        beyond = np.array([value for _, value in lost])
        m = mean_of(rows)
        print(f"| {name} | {first} | {power}{'' if share == 1 else f', N of {share}'} | ×{margin} | {m[0]:.0f} | " + " | ".join(f"{v:.3f}" for v in m[1:])
              + f" | {100 * (beyond > 1).mean():.1f} % | ×{beyond.max():.2f} |", flush=True)
    _, lost = run(corpus, pictures_of(corpus, 1), 32, MARGIN, TOGETHER)
    for name in np.unique(corpus.families):
        values = np.array([value for kind, value in lost if kind == name])
        print(f"{name}: {(values > 1).sum()} of {len(values)} beyond, ×{values.max():.2f}")


def uniform_as_good(curve, lost):
    """Samples after which one count for all has lost as little; beyond the last level as losses fall on average."""
    curve, lost = np.minimum.accumulate(curve), max(lost, LEAST)
    if curve[0] <= lost:
        return SPP[0]
    if curve[-1] > lost:
        return SPP[len(LEVELS) - 1] * (curve[-1] / lost) ** (1 / DECAY)
    at = int(np.argmax(curve <= lost))
    share = np.log(curve[at - 1] / lost) / np.log(curve[at - 1] / curve[at])
    return SPP[at - 1] * (SPP[at] / SPP[at - 1]) ** share


def kept_without(corpus, own, beyond, let_go):
    """Which of the constants keep 19 of 20 tiles within the limit in all scenes of other families; of a mixed picture, in all that are
    not in it."""
    alone = len(set(own)) == 1
    others = corpus.families != corpus.families[own[0]] if alone else ~np.isin(np.arange(len(corpus.names)), own)
    return np.flatnonzero(beyond[:, others].sum(1) <= 0.05 * let_go[:, others].sum(1))


def our_hindsight(corpus, estimate):
    """The same of the margin, the least that keeps the promise in other scenes, each of which is a picture."""
    margins = np.arange(0.8, 1.6, 0.02)
    let_go, beyond = np.zeros((2, len(margins), len(corpus.names)), int)
    for i, margin in enumerate(margins):
        for s in corpus.scenes:
            t = np.flatnonzero(corpus.good[s])
            levels, done = play(estimate[s][:, t].T, 32, LIMIT / margin, TOGETHER)
            lost = corpus.true[s, np.minimum(levels, len(LEVELS) - 1), t]
            let_go[i, s], beyond[i, s] = done.sum(), (done & (lost > LIMIT)).sum()

    def play_one(picture):
        s, t = np.array(picture).T
        margin = margins[kept_without(corpus, s, beyond, let_go)[0]]
        return play(estimate[s, :, t], 32, LIMIT / margin, TOGETHER)[0], margin

    return play_one


def hindsight(corpus, rule):
    """A rule with the largest constant that keeps the promise in other scenes; and that constant."""
    constants = PEOPLE[rule] * TRIED
    true = np.concatenate([corpus.true, corpus.true[:, -1:]], 1)
    let_go, beyond = np.zeros((2, len(constants), len(corpus.names)), int)
    for i, constant in enumerate(constants):
        found = first_below(corpus.values[rule], constant * 1.0001, 16)
        own = corpus.good & (found < len(LEVELS))
        lost = np.take_along_axis(true, found[:, None, :], 1)[:, 0]
        let_go[i], beyond[i] = own.sum(1), (own & (lost > LIMIT)).sum(1)

    def play_one(picture):
        s, t = np.array(picture).T
        constant = constants[kept_without(corpus, s, beyond, let_go)[-1]]
        return first_below(corpus.values[rule], constant * 1.0001, 16)[s, t], constant

    return play_one


def dammertz_of(corpus):
    """People's constant, in the picture as a whole: scenes side by side, as square as they can be."""

    def play_one(picture):
        s, t = np.array(picture).T
        scenes, side = list(dict.fromkeys(s)), EDGE // TILE
        down = {1: 1, 4: 2, 12: 3}[len(scenes)]
        blocks = corpus.values["dammertz"][scenes].reshape(down, -1, len(LEVELS), side, side)
        levels = dammertz(blocks.transpose(2, 0, 3, 1, 4).reshape(len(LEVELS), down * side, -1), PEOPLE["dammertz"])
        levels = levels.reshape(down, side, -1, side).transpose(0, 2, 1, 3).reshape(len(scenes), len(TILES))
        return levels[[scenes.index(one) for one in s], t], PEOPLE["dammertz"]

    return play_one


def rivals(corpus):
    estimate = GAIN * corpus.values["estimate"]

    def ours(first, margin, power):
        def play_one(picture):
            s, t = np.array(picture).T
            return play(estimate[s, :, t], first, LIMIT / margin, power)[0], margin

        return play_one

    def one_count(picture):
        """When verdicts are satisfied with every tile."""
        s, t = np.array(picture).T
        passed = (estimate[s, :, t] <= LIMIT / MARGIN).all(0) & (LEVELS >= 32)
        return np.full(len(s), passed.argmax() if passed.any() else len(LEVELS)), MARGIN

    def people(rule):
        return lambda picture: (first_below(corpus.values[rule], PEOPLE[rule] * 1.0001, 16)[*np.array(picture).T], PEOPLE[rule])

    rules = {"before: to the limit, ×1.5, from 48": ours(48, BEFORE, 1), "**drawn together, ×1.1, from 32**": ours(32, MARGIN, TOGETHER),
             "drawn together, margin in hindsight": our_hindsight(corpus, estimate),
             "one count for all, when verdicts are satisfied with each": one_count, "Dammertz et al., people's": dammertz_of(corpus),
             "Dammertz et al., in hindsight": hindsight(corpus, "dammertz"), "relative error, people's": people("relative"),
             "relative error, in hindsight": hindsight(corpus, "relative"), "Cycles, people's": people("cycles"),
             "Cycles, in hindsight": hindsight(corpus, "cycles"),
             "the truth known": lambda picture: (first_below(corpus.true, LIMIT, 16)[*np.array(picture).T], LIMIT)}
    names = (np.max, lambda v: np.quantile(v, 0.95), np.median, np.mean)
    for key in ("true", "true_denoised"):
        values = np.concatenate([corpus.values[key], corpus.values[key][:, -1:]], 1)
        for title, each in (("one scene", 1), ("four scenes", 4), ("twelve scenes", 12)):
            pictures, ratios = pictures_of(corpus, each), {}
            print(f"\n### {title}, {key}\n\n| | samples | worst, most of 20, median, mean | beyond | uniform as good, and ahead in: worst | most of 20"
                  " | median | mean | better than ours by these |\n" + "|---" * 9 + "|")
            lines = {}
            for label, rule in rules.items():
                rows, let_go, used = [], [], []
                for picture in pictures:
                    s, t = np.array(picture).T
                    levels, constant = rule(picture)
                    lost, count = values[s, levels, t], SPP[levels].mean()
                    curves = [[f(values[s, l, t]) for l in range(len(LEVELS))] for f in names]
                    rows.append([count, *measures(lost), *(uniform_as_good(c, v) / count for c, v in zip(curves, measures(lost)))])
                    let_go += list(lost[levels < len(LEVELS)])
                    used.append(constant)
                rows, let_go = np.array(rows), np.array(let_go)
                ratios[label] = rows[:, 5:]
                m, middle = mean_of(rows), np.median(rows, axis=0)
                share = f"{100 * (let_go > LIMIT).mean():.1f} %" if len(let_go) else "–"
                lines[label] = (f"| {label} ({min(used):.3g} to {max(used):.3g}) | {m[0]:.0f} | " + ", ".join(f"{v:.2f}" for v in m[1:5])
                                + f" | {share} | " + " | ".join(f"×{middle[k]:.2f}, {(rows[:, k] < 0.999).sum()}" for k in range(5, 9)))
            mine = ratios["**drawn together, ×1.1, from 32**"]
            for label, line in lines.items():
                print(line + " | " + ", ".join(str(n) for n in (ratios[label] > 1.001 * mine).sum(0)) + f" of {len(mine)} |")


def estimates(corpus):
    """Linear in logarithms, fitted without the family of each scene; margins, too."""
    log = lambda values: np.log(np.maximum(values, LEAST))
    target, true = log(corpus.true), corpus.true
    usable = corpus.good[:, None, :] & (true > 0.02) & (true < 1.5)
    weight = np.exp(-0.25 * ((target - np.log(0.25)) / 0.8) ** 2)
    chosen = {"as it is": ["estimate"], "and the noise's own loss": ["estimate", "noise"], "variance alone": ["variance"],
              "1.4 variance, bias beyond chance": ["sum"], "the same and the noise's own loss": ["sum", "noise"],
              "1.4 variance, 1.5 of what twice the samples change": ["change"], "the same and the noise's own loss ": ["change", "noise"],
              "all of these": ["estimate", "variance", "sum", "change", "noise"]}
    print("\n| estimate | scatter near the limit | margin | samples | beyond | drawn together: margin | samples | mean loss | beyond |")
    print("|---|---|---|---|---|---|---|---|---|")
    pictures = pictures_of(corpus, 1)
    for label, columns in chosen.items():
        values = np.stack([np.ones_like(target), *(log(corpus.values[name]) for name in columns)], -1)
        predicted = np.empty_like(target)
        for name in np.unique(corpus.families):
            own = corpus.families == name
            fit = usable & ~own[:, None, None]
            if len(columns) == 1:
                shift = np.average((target - values[..., 1])[fit], weights=weight[fit] ** 2)
                predicted[own] = values[own][..., 1] + shift
            else:
                factors = np.linalg.lstsq(values[fit] * weight[fit][:, None], target[fit] * weight[fit], rcond=None)[0]
                predicted[own] = values[own] @ factors
        estimate = np.exp(predicted)
        near = usable & (np.abs(true - LIMIT) < 0.2)
        cells = []
        for power in (1, TOGETHER):
            rows, lost, margins = [], [], []
            for name in np.unique(corpus.families):
                split_ = [[p for p in pictures if (corpus.families[p[0][0]] == name) == own] for own in (True, False)]
                for margin in np.exp(np.arange(-0.2, 0.9, 0.03)):
                    _, others = run(corpus, split_[1], 32, margin, power, estimate)
                    if np.mean([value > 1 for _, value in others]) <= 0.05:
                        break
                found, own = run(corpus, split_[0], 32, margin, power, estimate) if split_[0] else (np.empty((0, 5)), [])
                rows, lost, margins = [*rows, *found], lost + own, [*margins, margin]
            m = mean_of(np.array(rows))
            cells += [f"×{min(margins):.2f} to ×{max(margins):.2f}", f"{m[0]:.0f}"] + ([f"{m[4]:.3f}"] if power < 1 else [])
            cells += [f"{100 * np.mean([value > 1 for _, value in lost]):.1f} %"]
        print(f"| {label} | ×{np.exp((predicted - target)[near].std()):.2f} | " + " | ".join(cells) + " |", flush=True)


def tables(args):
    corpus = Corpus(args.rows)
    print(f"{len(corpus.names)} scenes, {len(corpus.scenes)} with a reference; {(~corpus.good).sum()} of {corpus.good.size} tiles left out")
    where(corpus)
    rivals(corpus)
    estimates(corpus)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    command = commands.add_parser("mitsuba")
    command.add_argument("variant")
    command.add_argument("out", type=pathlib.Path)
    command.add_argument("scenes", nargs="+")
    command.set_defaults(run=mitsuba)
    command = commands.add_parser("gather")
    command.add_argument("example")
    command.add_argument("out", type=pathlib.Path)
    command.set_defaults(run=gather)
    command = commands.add_parser("check")
    command.add_argument("folders", nargs="+", type=pathlib.Path)
    command.set_defaults(run=check)
    command = commands.add_parser("tables")
    command.add_argument("rows", type=pathlib.Path)
    command.set_defaults(run=tables)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
