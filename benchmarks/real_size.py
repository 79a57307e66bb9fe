#!/usr/bin/env python3
"""The oracle against uniform sampling in pictures of some size: real-size.md.

    real_size.py render OUT SCENE...     renders what is missing below OUT, cheapest first; goes on where it was stopped
    real_size.py measure OUT > rows.csv  JOD lost by the worst square of 64 pixels, by `noisefloor metrics`
    real_size.py package OUT SCENE       the same of one scene by the PyPI package cvvdp, no code of this project
    real_size.py table rows.csv          the tables of real-size.md
    real_size.py plot rows.csv OUT.svg   error against run time, of the denoised pictures; needs matplotlib

Each scene is rendered by the built-in path tracer: until the oracle stops all tiles, noisy and denoised; with one number of
samples for all pixels, which are denoised, too; and once with far more samples and another seed, as the reference. Its own
noise is not little where rooms are lit by windows, so everything is measured a second time against the denoised reference,
which has nearly none, but may have lost a little texture. Where the oracle gives tiles more samples than the reference has, another
render of the oracle, with a third seed, is the reference.
Rivals render noisy pictures, which are denoised when they are measured, if the package mitsuba-oidn is there.
Seconds are of the processor, the denoiser's process included. Needs numpy, OpenEXR and pillow."""
import argparse
import csv
import itertools
import json
import math
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import at_the_stop as shown  # noqa: E402

# Numbers of samples for all pixels; of a scene, up to half of its reference's
UNIFORM = tuple(32 << power for power in range(8))
# Those that tables show
SHOWN = (64, 256, 512)
# With the constants that agree with people (criteria.md)
RIVALS = {"cycles": "cycles:0.081", "dammertz": "dammertz:0.0046"}
EDGE = 64
# What is wrong with a picture of n samples is n^−DECAY, denoised and noisy
DECAY, NOISY_DECAY = 0.38, 0.5


def name(scene):
    path = pathlib.Path(scene)
    return path.parent.name if path.suffix and path.parent.name != "pbrt" else path.parent.parent.name if path.suffix else scene


def jobs(args):
    """What is rendered of a scene, folders and options: what each needs, and then what is good to have."""
    oidn, many = ["--denoise", "oidn"], str(args.reference)
    uniform = lambda spp: [*oidn, "--min-spp", str(spp), "--max-spp", str(spp)]
    needed = {
        "oracle-denoised": oidn,
        **{f"uniform-{spp}": uniform(spp) for spp in UNIFORM if 2 * spp <= args.reference},
        "reference": [*uniform(many), "--seed", "77"],
    }
    most = ["--max-spp", str(args.reference // 2)]
    more = {"reference-adaptive": [*oidn, "--seed", "78"], "oracle-denoised-2": [*oidn, "--seed", "2"], "oracle": most}
    return needed, more | {name: ["--criterion", criterion, "--tile", "32", *most] for name, criterion in RIVALS.items()}


def render(args):
    for part, scene in itertools.product((0, 1), args.scenes):
        for job, options in jobs(args)[part].items():
            out = pathlib.Path(args.out) / name(scene) / job
            done = out / "processor-seconds.json"
            if done.exists():
                continue
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            command = [args.noisefloor, "render", scene, "--source", args.source, "--size", args.size, "--seed", "1", "--out", str(out)]
            if "--seed" in options:
                del command[command.index("--seed"):command.index("--seed") + 2]
            if (out / "checkpoint.nfc").exists():
                command.append("--resume")
            run = subprocess.run([*command, *options], stderr=subprocess.PIPE, text=True)
            if run.returncode:
                print(f"{name(scene)}/{job}: {run.stderr[-400:]}", flush=True)
                break
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            done.write_text(json.dumps({"seconds": seconds, "resumed": "--resume" in command}))
            print(f"{name(scene)}/{job}: {seconds:.0f} s", flush=True)


def squares(height, width):
    """Squares side by side; the last ones lie at the edge."""
    places = lambda side: [*range(0, max(side - EDGE, 0), EDGE), max(side - EDGE, 0)]
    return [(x, y, x + EDGE, y + EDGE) for y in places(height) for x in places(width)]


def pictures(folder):
    """Both references as shown, and every other picture of a scene under their exposure, with its samples."""
    (noisy, many), clean = shown.load(folder / "reference"), shown.load(f"{folder}/reference/image-denoised.exr:0")[0]
    adaptive = folder / "reference-adaptive"
    if (adaptive / "processor-seconds.json").exists():
        better, spp = shown.load(adaptive)
        where = (spp > many)[..., None]
        noisy = np.where(where, better, noisy)
        clean = np.where(where, shown.load(f"{adaptive}/image-denoised.exr:0")[0], clean)
    gain = shown.exposure(noisy)
    yield shown.shown(noisy, gain), shown.shown(clean, gain)
    for job in sorted(folder.iterdir()):
        seconds = job / "processor-seconds.json"
        if job.name.startswith("reference") or not seconds.exists():
            continue
        _, spp = shown.load(job)
        kept = json.loads(seconds.read_text())
        # Of a run that was interrupted, only its end is known
        cost = math.nan if kept["resumed"] else kept["seconds"]
        meant = job.name.startswith("oracle-denoised")
        if not meant:
            yield job.name, shown.shown(shown.load(job)[0], gain), spp.mean(), cost
        if job.name in RIVALS:
            yield f"{job.name}-denoised", shown.shown(denoised(job, folder / "oracle-denoised"), gain), spp.mean(), cost
        if (job / "image-denoised.exr").exists():
            label = job.name if meant else f"{job.name}-denoised"
            yield label, shown.shown(shown.load(f"{job}/image-denoised.exr:0")[0], gain), spp.mean(), cost


def denoised(job, guides):
    """What Open Image Denoise makes of a picture that was rendered without it, with the albedo and normals of another render."""
    import mitsuba_oidn as oidn

    channels = {"color": job / "image.exr", "albedo": guides / "albedo.exr", "normal": guides / "normal.exr"}
    planes = {name: np.ascontiguousarray(shown.load(f"{path}:0")[0], dtype=np.float32) for name, path in channels.items()}
    device = oidn.Device(oidn.DeviceType.CPU)
    device.commit()
    task = device.new_filter("RT")
    task.hdr, task.quality = True, oidn.Quality.High
    planes["output"] = np.empty_like(planes["color"])
    for name, plane in planes.items():
        task.set_image(name, plane)
    task.execute()
    return planes["output"]


def measure(args, lost=None):
    rows = csv.writer(sys.stdout)
    rows.writerow("scene picture spp seconds worst most median worst_denoised most_denoised median_denoised".split())
    for folder in sorted(pathlib.Path(args.out).iterdir()):
        if not (folder / "reference" / "processor-seconds.json").exists() or getattr(args, "scene", folder.name) != folder.name:
            continue
        every = pictures(folder)
        references = next(every)
        with tempfile.TemporaryDirectory() as scratch:
            for label, picture, spp, seconds in every:
                one = lost or (lambda a, b: shown.lost(args.noisefloor, a, b, scratch))
                numbers = [spp, seconds]
                for truth in references:
                    values = [one(picture.crop(s), truth.crop(s)) for s in squares(truth.height, truth.width)]
                    numbers += [max(values), np.quantile(values, 0.95), np.median(values)]
                rows.writerow([folder.name, label, *(f"{v:.3f}" for v in numbers)])
                sys.stdout.flush()


def package(args):
    import pycvvdp

    metric = pycvvdp.cvvdp(display_name="standard_fhd", quiet=True)
    array = lambda picture: np.asarray(picture, dtype=np.float32) / 255
    measure(args, lambda a, b: 10 - float(metric.predict(array(a), array(b), dim_order="HWC")[0]))


def as_good(uniform, lost, decay):
    """Samples, or seconds, at which uniform sampling has lost as much: straight between two of them in logarithms; beyond the
    last, as pictures get better on average (docs/denoising.md); none below the first. And whether it is beyond."""
    for (low, before), (high, after) in zip(uniform, uniform[1:]):
        if before >= lost >= after:
            share = math.log(before / lost) / math.log(before / after)
            return low * (high / low) ** share, False
    last, left = uniform[-1]
    return (last * (left / lost) ** (1 / decay), True) if left > lost else (None, False)


def table(args):
    scenes = {}
    for row in csv.DictReader(open(args.rows)):
        numbers = {key: float(value) for key, value in row.items() if key not in ("scene", "picture")}
        scenes.setdefault(row["scene"], {})[row["picture"]] = numbers
    runs = {"denoised": ["oracle-denoised", "oracle-denoised-2"], "without the margin": ["oracle-denoised-without-margin"],
            "noisy": ["oracle"], **{f"{name}, denoised": [f"{name}-denoised"] for name in RIVALS}}
    for (kind, oracle), reference in itertools.product(runs.items(), ("_denoised", "")):
        suffix, decay = ("", NOISY_DECAY) if kind == "noisy" else ("-denoised", DECAY)
        print(f"\n| {kind}, {'denoised reference' if reference else 'reference'} | samples | seconds | worst, most of 20, median | "
              + " | ".join(f"uniform {n}" for n in SHOWN) + " | as good by the worst | by most of 20 | in seconds |")
        print("|---" * (7 + len(SHOWN)) + "|")
        ratios = {"worst": [], "most": [], "seconds": []}
        for scene, found in scenes.items():
            ours = [found[name] for name in oracle if name in found]
            if not ours:
                continue
            mean = lambda key: np.mean([one[key] for one in ours])
            uniform = [(n, found[f"uniform-{n}{suffix}"]) for n in UNIFORM if f"uniform-{n}{suffix}" in found]
            shown_at = dict(uniform)
            cells = [f"{shown_at[n]['worst' + reference]:.2f}, {shown_at[n]['most' + reference]:.2f}" if n in shown_at else ""
                     for n in SHOWN]
            for by, unit in (("worst", "spp"), ("most", "spp"), ("worst", "seconds")):
                # Of a run that was interrupted, the seconds are not known
                series = [(row[unit], row[by + reference]) for _, row in uniform if row[unit] > 0]
                lost, took = mean(by + reference), np.nanmean([one[unit] for one in ours])
                same, beyond = as_good(series, lost, decay)
                cells.append(f"{'≈ ' if beyond else ''}{same:.0f}, ×{same / took:.2f}" if same else f"< {series[0][0]:.0f}")
                ratios[by if unit == "spp" else unit] += [same / took] if same else []
            lost = " / ".join(", ".join(f"{one[key + reference]:.2f}" for key in ("worst", "most", "median")) for one in ours)
            spps = " / ".join(f"{one['spp']:.0f}" for one in ours)
            print(f"| {scene} | {spps} | {np.nanmean([one['seconds'] for one in ours]):.0f} | {lost} | " + " | ".join(cells) + " |")
        for by, found in ratios.items():
            if found:
                print(f"\nby {by}: median of {len(found)} ×{np.median(found):.2f}, lowest ×{min(found):.2f}")


def plot(args):
    import matplotlib
    matplotlib.use("svg")
    # Text as text, and the same file for the same rows
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "noisefloor", "font.size": 9})
    from matplotlib import pyplot

    scenes = {}
    for row in csv.DictReader(open(args.rows)):
        scenes.setdefault(row["scene"], []).append(row)
    across = min(len(scenes), 5)
    figure, panels = pyplot.subplots(-(-len(scenes) // across), across, figsize=(11, 2.7 * -(-len(scenes) // across)), squeeze=False)
    for panel, (scene, rows) in itertools.zip_longest(panels.flat, scenes.items(), fillvalue=(None, [])):
        if scene is None:
            panel.axis("off")
            continue
        # Of a run that was interrupted, the seconds are not known
        rows = [row for row in rows if float(row["seconds"]) > 0]
        uniform = [row for row in rows if row["picture"].startswith("uniform-") and row["picture"].endswith("-denoised")]
        uniform.sort(key=lambda row: float(row["spp"]))
        ours = [row for row in rows if row["picture"] in ("oracle-denoised", "oracle-denoised-2")]
        rivals = [row for row in rows if row["picture"].removesuffix("-denoised") in RIVALS and row["picture"].endswith("-denoised")]
        for key, colour in (("worst_denoised", "#c0392b"), ("median_denoised", "#2c7fb8")):
            at = lambda rows: ([float(row["seconds"]) for row in rows], [float(row[key]) for row in rows])
            panel.plot(*at(uniform), "-", color=colour, marker=".", linewidth=1)
            panel.plot(*at(rivals), "x", color=colour, markersize=6)
            panel.plot(*at(ours), "o", color=colour, markersize=7, markerfacecolor="none", markeredgewidth=1.6)
        panel.axhline(0.3, color="grey", linewidth=0.7, linestyle=":")
        panel.set(xscale="log", yscale="log", title=scene, ylim=(0.02, 2.5))
        panel.set_yticks([0.03, 0.1, 0.3, 1.0], ["0.03", "0.1", "0.3", "1"])
        panel.minorticks_off()
        ticks = [t for t in (10, 30, 100, 300, 1000) if panel.get_xlim()[0] <= t <= panel.get_xlim()[1]]
        panel.set_xticks(ticks, [str(t) for t in ticks])
    figure.supxlabel("processor seconds")
    figure.supylabel("JOD lost")
    figure.tight_layout()
    figure.savefig(args.out, metadata={"Date": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--noisefloor", default="target/release/noisefloor")
    commands = parser.add_subparsers(required=True)
    for command, words in {render: ["out", "scenes"], measure: ["out"], package: ["out", "scene"], table: ["rows"], plot: ["rows", "out"]}.items():
        sub = commands.add_parser(command.__name__)
        sub.set_defaults(run=command)
        for word in words:
            sub.add_argument(word, nargs="+" if word == "scenes" else None)
        if command is render:
            sub.add_argument("--size", default="480x270")
            sub.add_argument("--source", default="ptwne", help="the renderer, as of `noisefloor render`")
            sub.add_argument("--reference", type=int, default=4096)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
