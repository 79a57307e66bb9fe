#!/usr/bin/env python3
"""Where samples go in pictures of some size, by every rule at once: docs/benchmarks/denoised.md.

    larger.py render EXAMPLE OUT MOST SCENE…    stores levels of two seeds, and a reference; EXAMPLE is `denoised_corpus` of noisefloor-cli; goes on where it stopped
    larger.py gather OUT > larger.csv
    larger.py tables larger.csv                 every rule, played on what is stored
    larger.py plot larger.csv OUT.svg           loss against run time; needs matplotlib

A scene's folder has `1` and `2`, the seeds: halves at levels of samples, and what Open Image Denoise makes of them. A tile is sampled on
only to four times what it, or one beside it, needs for a loss that is hardly noticed; beyond that, losses are taken to fall as they do
on average. The reference has four times the samples of each tile, of a third seed, and is joined with the last level of the other seed.
Needs numpy."""
import csv
import pathlib
import subprocess
import sys

import numpy as np

from figures import factor, table

LIMIT, LEAST, DECAY = 0.3, 1e-3, 0.38
# Tiles whose reference has itself lost as much are left out
NOISY_REFERENCE = 0.1
# The rule: power, step, medians that the hardest counts as at most, margin from 16 tiles on, the least that an estimate counts as, how
# near a need has to be that is not looked at a third time, and the powers of an estimate, of earlier ones, and of those around it
TOGETHER, STEP, MEDIANS, MARGIN, FLOOR, FORESEEN = 0.85, 1.2, 8, 1.2, 1 / 4, 2
OWN, EARLIER, AROUND = 0.4, 0.3, 0.3
# The schedule: samples that counts are multiples of, and how much they grow at the least and at the most
GRID, GROWS = 16, (1.5, 4)
# What verdicts count the mean of four as
GAIN = 0.97
SIZE, TILE = (240, 135), 32
SEEDS = ("1", "2")
REFERENCE_SEED, REFERENCE_TIMES = "77", 4
RULES = ("dammertz", "relative-error", "cycles")
# The constants that agree with people (docs/benchmarks/stops.md)
PEOPLE = {"dammertz": 0.0046, "relative-error": 0.17, "cycles": 0.081}
MEASURES = {"worst": np.max, "19 of 20": lambda v: np.quantile(v, 0.95), "median": np.median, "mean": np.mean}
COLUMNS = "count seconds estimate noise unmet true true_denoised noisy noisy_denoised".split()


def places(length):
    """Where tiles begin and end along a side: what is left of less than half a tile is joined to the last."""
    count = max((2 * length + TILE) // (2 * TILE), 1)
    return [(i * TILE, (i + 1) * TILE if i + 1 < count else length) for i in range(count)]


TILES = [(*x, *y) for y in places(SIZE[1]) for x in places(SIZE[0])]


def load(path, channels=3):
    return np.fromfile(path, dtype="<f4").astype(np.float64).reshape(SIZE[1], SIZE[0], channels)


def counts(folder):
    """Samples and seconds of each tile, and what it would lose that lacks light, by level."""
    found = {}
    for row in csv.DictReader(open(folder / "counts.csv")):
        found.setdefault(int(row["level"]), []).append((int(row["spp"]), float(row["seconds"]), float(row["unmet"])))
    return {level: np.array(rows) for level, rows in found.items()}


def last(folder):
    """The last level's picture, and the samples of each of its pixels."""
    level, rows = max(counts(folder).items())
    picture = 0.5 * (load(folder / f"a-{level:05}.f32") + load(folder / f"b-{level:05}.f32"))
    return picture, per_pixel(rows[:, 0])


def per_pixel(spp):
    plane = np.empty((SIZE[1], SIZE[0], 1))
    for value, (left, right, top, bottom) in zip(spp, TILES):
        plane[top:bottom, left:right] = value
    return plane


def render(example, folder, most, *scenes):
    size = "x".join(map(str, SIZE))
    for scene in scenes:
        out = pathlib.Path(folder, pathlib.Path(scene).parent.name)
        runs = [subprocess.Popen([example, "levels", out / seed, scene, size, seed, most]) for seed in SEEDS]
        if any([run.wait() for run in runs]):
            print(f"{out.name}: failed", flush=True)
            continue
        done = out / f"reference-{REFERENCE_SEED}.f32"
        spp = REFERENCE_TIMES * np.max([max(counts(out / seed).items())[1][:, 0] for seed in SEEDS], axis=0).astype(int)
        if not done.exists():
            np.savetxt(out / "reference-spp.txt", spp, "%d")
            subprocess.run([example, "reference", out, scene, size, REFERENCE_SEED, *map(str, spp)], check=True)
        join(out, spp)
        for seed in SEEDS:
            for command in ("estimate", "rivals"):
                said = subprocess.run([example, command, out / seed], capture_output=True, check=True).stdout
                (out / seed / f"{command}.csv").write_bytes(said)
        print(f"{out.name}: done", flush=True)


def join(out, spp):
    """Writes for each seed its reference, as two pictures that lie as far from their mean as its own noise is strong."""
    one, n = load(out / f"reference-{REFERENCE_SEED}.f32"), per_pixel(spp)
    for seed, other_seed in zip(SEEDS, SEEDS[::-1]):
        other, m = last(out / other_seed)
        mean, noise = (one * n + other * m) / (n + m), (one - other) * np.sqrt(n * m) / (n + m)
        (mean + noise).astype("<f4").tofile(out / seed / "reference-a.f32")
        (mean - noise).astype("<f4").tofile(out / seed / "reference-b.f32")


def gather(out):
    rows = csv.writer(sys.stdout, lineterminator="\n")
    rows.writerow(["scene", "seed", "spp", "tile", *COLUMNS, *RULES])
    for folder in sorted(pathlib.Path(out).glob("*/[12]")):
        if not (folder / "rivals.csv").exists():
            continue
        found = {}
        for _, spp, tile, kind, own, around in csv.reader(open(folder / "estimate.csv")):
            found[int(spp), kind.replace("-", "_"), int(tile)] = float(own) if kind == "noise" else min(float(own), float(around))
        levels = counts(folder)
        # The least constant of those tried with which a tile is done by each level
        least = np.full((len(RULES), len(levels), len(TILES)), np.inf)
        for rule, constant, stops in csv.reader(open(folder / "rivals.csv")):
            for tile, letter in enumerate(stops):
                if letter != "-":
                    at = least[RULES.index(rule), ord(letter) - ord("a"):, tile]
                    at[...] = np.minimum(at, float(constant))
        for tile in range(len(TILES)):
            lead = [folder.parent.name, folder.name]
            truth = [f"{found[0, kind, tile]:.3f}" for kind in ("reference", "reference_denoised")]
            rows.writerow([*lead, 0, tile, *[""] * 5, *truth, *[""] * (len(COLUMNS) - 7 + len(RULES))])
            for i, (level, known) in enumerate(sorted(levels.items())):
                spp, seconds, unmet = known[tile]
                losses = [found[level, kind, tile] for kind in COLUMNS[2:] if kind != "unmet"]
                values = [f"{v:.3f}" for v in (*losses[:2], unmet, *losses[2:])]
                rows.writerow([*lead, level, tile, int(spp), f"{seconds:.3f}", *values, *(f"{v:.4g}" for v in least[:, i, tile])])


class Picture:
    """All that is known of a scene and seed, by level and tile."""

    def __init__(self, rows):
        self.spp = np.array(sorted({int(r["spp"]) for r in rows} - {0}), dtype=float)
        self.reference = np.array([float(r["true"]) for r in rows if r["spp"] == "0"])
        shape = (len(self.spp), len(self.reference))
        at = {int(n): i for i, n in enumerate(self.spp)}
        for key in (*COLUMNS, *RULES):
            plane = np.full(shape, np.nan)
            for r in rows:
                if r["spp"] != "0":
                    plane[at[int(r["spp"])], int(r["tile"])] = float(r[key])
            setattr(self, key.replace("-", "_"), plane)
        # A tile that is not sampled any more loses as losses fall on average
        further = (self.count / self.spp[:, None]).clip(None, 1)
        for key, decay in (("true", DECAY), ("true_denoised", DECAY), ("estimate", DECAY), ("noise", 0.5), ("noisy", 0.5), ("noisy_denoised", 0.5)):
            setattr(self, key, getattr(self, key) * further**decay)
        # What a sample of each tile costs
        self.cost = self.seconds[-1] / self.count[-1]
        self.good = self.reference < NOISY_REFERENCE

    def says(self):
        """What a verdict says of each tile and level: the least of both pictures, unless light is likely to lack."""
        either = np.minimum(GAIN * self.estimate, self.noise)
        return np.where(self.unmet > LIMIT, np.inf, either)


def read(path):
    kept = {}
    for row in csv.DictReader(open(path)):
        kept.setdefault(row["scene"], {}).setdefault(row["seed"], []).append(row)
    return {scene: [Picture(rows) for rows in seeds.values()] for scene, seeds in kept.items()}


def above(picture):
    return np.append(picture.spp, 2 * picture.spp[-1])


def first_below(values, limit, first, spp):
    below = (values <= limit) & (spp >= first)[:, None]
    return np.where(below.any(0), below.argmax(0), len(spp))


def lost_at(picture, levels, key):
    """What each tile has lost at its level; of one that was never satisfied, at the last there is."""
    return getattr(picture, key)[np.minimum(levels, len(picture.spp) - 1), np.arange(len(levels))]


class Outcome:
    """Of a rule in one picture: the last level of each tile, whether it let the tile go there, and which tiles it shows as rendered."""

    def __init__(self, picture, levels, done=None, undenoised=None):
        self.picture, self.levels = picture, levels
        self.done = levels < len(picture.spp) if done is None else done
        self.undenoised = np.zeros(len(levels), bool) if undenoised is None else undenoised

    def lost(self, reference):
        key, noisy = ("true", "noisy") if reference == "noisy" else ("true_denoised", "noisy_denoised")
        lost = np.where(self.undenoised, lost_at(self.picture, self.levels, noisy), lost_at(self.picture, self.levels, key))
        return lost[self.picture.good]

    def samples(self):
        return above(self.picture)[self.levels][self.picture.good].mean()

    def seconds(self):
        """Of tiles with a reference."""
        return (above(self.picture)[self.levels] * self.picture.cost)[self.picture.good].sum()

    def let_go(self):
        return self.done[self.picture.good]


def neighbours(tile):
    across, down = len(places(SIZE[0])), len(places(SIZE[1]))
    y, x = divmod(tile, across)
    near = lambda at, count: range(max(at - 1, 0), min(at + 2, count))
    return [j * across + i for j in near(y, down) for i in near(x, across) if (i, j) != (x, y)]


def play(picture, first=16, margin=MARGIN, power=TOGETHER, powers=(OWN, EARLIER, AROUND), most=MEDIANS):
    """The rule as it runs, with its schedule: the last level of each tile, whether it was satisfied, and whether by its noise.
    The last of the levels is what tiles count that are never satisfied."""
    spp, limit, (own, earlier, around) = above(picture), LIMIT / margin, powers
    last, tiles = len(spp) - 1, np.arange(len(picture.reference))
    said = np.log(np.maximum(GAIN * picture.estimate, FLOOR * LIMIT / MARGIN)) + DECAY * np.log(picture.spp)[:, None]
    at_one, undenoised = np.full(len(tiles), np.nan), np.zeros(len(tiles), bool)
    levels, need, looked, verdicts = np.full(len(tiles), np.searchsorted(spp, first)), np.full(len(tiles), -1.0), tiles, 0
    while True:
        looked = np.array([i for i in looked if need[i] < 0 and levels[i] < last], int)
        verdicts += len(looked) > 0
        before, new = ~np.isnan(at_one), said[levels[looked], looked]
        at_one[looked] = np.where(np.isnan(at_one[looked]), new, (own * new + earlier * at_one[looked]) / (own + earlier))
        expected = 0.0 * tiles
        for i in looked:
            n, near = picture.spp[levels[i]], at_one[neighbours(i)]
            pooled = (own + earlier) * at_one[i] + around * near[~np.isnan(near)].mean()
            own_estimate, noise = GAIN * picture.estimate[levels[i], i], picture.noise[levels[i], i]
            lost = own_estimate if own_estimate < FLOOR * LIMIT / MARGIN else np.exp(pooled - DECAY * np.log(n))
            dark, undenoised[i] = picture.unmet[levels[i], i] > LIMIT, lost > limit
            denoised, as_rendered = n * (lost / limit) ** (1 / DECAY), n * (noise / limit) ** 2
            expected[i] = 2 * n if dark else min(denoised, as_rendered)
            if min(lost, noise) <= limit and not dark:
                need[i] = n
            elif not dark and before[i] and expected[i] <= FORESEEN * n:
                need[i], undenoised[i] = expected[i], as_rendered < denoised
        needs = np.where(need >= 0, need, spp[levels])
        hardest = min(needs.max(), most * np.sort(needs)[len(needs) // 2])
        wanted = np.maximum(needs, needs**power * hardest ** (1 - power))
        go = (levels < last) & ((need < 0) | (need > spp[levels]) | (wanted >= STEP * spp[levels]))
        if not go.any():
            return levels, need >= 0, undenoised, verdicts
        for i in np.flatnonzero(go):
            n = spp[levels[i]]
            missing = np.ceil((wanted if need[i] >= 0 else expected)[i] / GRID) * GRID - n
            grown = n + np.clip(max(min(GRID / go.mean(), n), missing), (GROWS[0] - 1) * n, (GROWS[1] - 1) * n)
            levels[i] = min(max(np.searchsorted(spp, grown // GRID * GRID), levels[i] + 1), last)
        looked = np.flatnonzero(go)


def ours(picture, **how):
    levels, done, undenoised, _ = play(picture, **how)
    return Outcome(picture, levels, done, done & undenoised)


def together(picture):
    """One count for all, where all tiles are satisfied."""
    passed = (picture.says() <= LIMIT / MARGIN).all(1) & (picture.spp >= 16)
    return Outcome(picture, np.full(len(picture.reference), passed.argmax() if passed.any() else len(picture.spp)))


def rival(picture, rule, constant):
    return Outcome(picture, first_below(getattr(picture, rule.replace("-", "_")), constant * (1 + 1e-3), 16, picture.spp))


def hindsight(scenes, rule):
    """With the largest constant that keeps 19 of 20 tiles within the limit in all other scenes."""
    tried = PEOPLE[rule] * np.exp(0.1 * np.arange(-30, 41))
    beyond = {}
    for scene, pictures in scenes.items():
        outcomes = [[rival(p, rule, constant) for p in pictures] for constant in tried]
        beyond[scene] = np.array([[sum((o.lost("noisy")[o.let_go()] > LIMIT).sum() for o in some), sum(o.let_go().sum() for o in some)]
                                  for some in outcomes])
    best = {}
    for scene in scenes:
        worse, of = sum((found for other, found in beyond.items() if other != scene), np.zeros((len(tried), 2))).T
        kept = worse <= 0.05 * of
        best[scene] = tried[np.flatnonzero(kept)[-1]] if kept.any() else tried[0]
    return best


def rules(scenes):
    """Every rule in every picture, by its name."""
    alone = lambda picture: ours(picture, powers=(1, 0, 0))
    every = {"ours": ours, "ours, each estimate by itself": alone, "one count, when all are satisfied": together}
    found = {label: {scene: [rule(p) for p in pictures] for scene, pictures in scenes.items()} for label, rule in every.items()}
    for rule in RULES:
        best = hindsight(scenes, rule)
        found[f"{rule}, in hindsight"] = {s: [rival(p, rule, best[s]) for p in pictures] for s, pictures in scenes.items()}
    found["the truth known"] = {s: [Outcome(p, first_below(p.true, LIMIT, 16, p.spp)) for p in pictures] for s, pictures in scenes.items()}
    return found


def mean_over(outcomes, measure, reference):
    return np.mean([measure(o.lost(reference)) for o in outcomes])


def uniform_as_good(pictures, lost, measure, reference):
    """Samples after which one count for all has lost as little, a mean of the seeds; and `<` or `≈` where that is before the first
    level or beyond the last, where losses are taken to fall as they do on average."""
    key = "true" if reference == "noisy" else "true_denoised"
    spp = pictures[0].spp
    curve = np.minimum.accumulate([np.mean([measure(getattr(p, key)[i][p.good]) for p in pictures]) for i in range(len(spp))])
    lost = max(lost, LEAST)
    if curve[0] <= lost:
        return spp[0], "<"
    if curve[-1] > lost:
        return spp[-1] * (curve[-1] / lost) ** (1 / DECAY), "≈"
    at = int(np.argmax(curve <= lost))
    share = np.log(curve[at - 1] / lost) / np.log(curve[at - 1] / curve[at])
    return spp[at - 1] * (spp[at] / spp[at - 1]) ** share, ""


def compared(pictures, outcomes, reference):
    """Samples, seconds, four measures, and by each of these what uniform takes of the samples, and of the seconds."""
    samples, seconds = np.mean([o.samples() for o in outcomes]), np.mean([o.seconds() for o in outcomes])
    a_sample = np.mean([p.cost[p.good].sum() for p in pictures])
    lost = {by: mean_over(outcomes, measure, reference) for by, measure in MEASURES.items()}
    same = {by: uniform_as_good(pictures, lost[by], measure, reference) for by, measure in MEASURES.items()}
    return samples, seconds, lost, {by: (n, sign, n / samples, n * a_sample / seconds) for by, (n, sign) in same.items()}


def tables(rows):
    """Against references of noisy pictures, which the pages have, and of denoised ones."""
    scenes = read(rows)
    played = rules(scenes)
    uniform = [f"uniform, by {by}" for by in MEASURES]
    for reference, name in (("noisy", "larger"), ("denoised", "larger-denoised")):
        rows = []
        for scene, pictures in scenes.items():
            outcomes = played["ours"][scene]
            _, _, _, same = compared(pictures, outcomes, reference)
            beyond = sum((o.lost(reference)[o.let_go()] > LIMIT).sum() for o in outcomes)
            losses = (", ".join(f"{m(o.lost(reference)):.2f}" for m in MEASURES.values()) for o in outcomes)
            rows.append([scene, " / ".join(f"{o.samples():.0f}" for o in outcomes), " / ".join(losses),
                         f"{beyond} of {sum(o.let_go().sum() for o in outcomes)}",
                         *(f"{sign}{' ' if sign else ''}{n:.0f}, {factor(ratio)}" for n, sign, ratio, _ in same.values()),
                         factor(same["worst"][3])])
        table(name, ["samples, two seeds", "worst, 19 of 20, median, mean", "beyond 0.3", *uniform, "in seconds, worst"], rows)
        rows = []
        for label, by_scene in played.items():
            found = [compared(scenes[s], outcomes, reference) for s, outcomes in by_scene.items()]
            lost = np.concatenate([o.lost(reference)[o.let_go()] for outcomes in by_scene.values() for o in outcomes])
            cells = [f"{np.exp(np.log([f[0] for f in found]).mean()):.0f}", f"{(lost > LIMIT).sum()} of {len(lost)}",
                     factor(lost.max(initial=0) / LIMIT)]
            for by in MEASURES:
                ratios = [f[3][by][2] for f in found]
                cells.append(f"{factor(np.median(ratios))} ({min(ratios):.2f} to {max(ratios):.2f}; {sum(r < 1 for r in ratios)})")
            rows.append([label, *cells])
        table(name.replace("larger", "larger-rules"), ["samples", "beyond 0.3", "at most", *uniform], rows)
        mine = {s: compared(scenes[s], played["ours"][s], reference)[3] for s in scenes}
        for label, by_scene in played.items():
            theirs = {s: compared(scenes[s], by_scene[s], reference)[3] for s in scenes}
            ahead = {by: [s for s in scenes if theirs[s][by][2] > mine[s][by][2] * 1.001] for by in MEASURES}
            print(f"- {label}: better than ours by " + "; ".join(f"{by} in {len(some)} ({', '.join(some)})" for by, some in ahead.items()))


def plot(rows, out):
    """Loss against processor seconds: one count for all (lines), ours (rings), plain rules with their best constants (crosses)."""
    import matplotlib
    matplotlib.use("svg")
    # Text as text, and the same file for the same rows
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "noisefloor", "font.size": 9})
    from matplotlib import pyplot

    scenes = read(rows)
    best = {rule: hindsight(scenes, rule) for rule in RULES}
    across = 5
    down = -(-len(scenes) // across)
    figure, panels = pyplot.subplots(down, across, figsize=(11, 2.5 * down), squeeze=False)
    for panel in panels.flat[len(scenes):]:
        panel.axis("off")
    for panel, (scene, pictures) in zip(panels.flat, scenes.items()):
        mean = lambda outcomes, by: (np.mean([o.seconds() for o in outcomes]), mean_over(outcomes, MEASURES[by], "noisy"))
        uniform = [[Outcome(p, np.full(len(p.reference), i)) for p in pictures] for i in range(len(pictures[0].spp))]
        for by, colour in (("worst", "#c0392b"), ("median", "#2c7fb8")):
            panel.plot(*zip(*(mean(outcomes, by) for outcomes in uniform)), "-", color=colour, marker=".", linewidth=1, markersize=4)
            plain = [mean([rival(p, rule, best[rule][scene]) for p in pictures], by) for rule in RULES]
            panel.plot(*zip(*plain), "x", color=colour, markersize=5)
            panel.plot(*mean([ours(p) for p in pictures], by), "o", color=colour, markersize=8, markerfacecolor="none", markeredgewidth=1.6)
        panel.axhline(LIMIT, color="grey", linewidth=0.7, linestyle=":")
        panel.set(xscale="log", yscale="log", title=scene, ylim=(0.02, 2.5))
        panel.set_yticks([0.03, 0.1, 0.3, 1.0], ["0.03", "0.1", "0.3", "1"])
        panel.minorticks_off()
        low, high = panel.get_xlim()
        ticks = [t for t in (0.3, 1, 3, 10, 30, 100) if low <= t <= high]
        panel.set_xticks(ticks, [f"{t:g}" for t in ticks])
    figure.supxlabel("processor seconds")
    figure.supylabel("JOD lost")
    figure.tight_layout()
    figure.savefig(out, metadata={"Date": None})


if __name__ == "__main__":
    if sys.argv[1:2] not in (["render"], ["gather"], ["tables"], ["plot"]):
        sys.exit(__doc__)
    globals()[sys.argv[1]](*sys.argv[2:])
