#!/usr/bin/env python3
"""Our path tracer beside Mitsuba 3, on the same scene files.

  reference   renders converged references with Mitsuba, in passes that are kept: run it again for more of them
  measure     times `noisefloor render` and Mitsuba in turns, and scores both against the references

Needs numpy, mitsuba (tried with 3.9) and OpenEXR 3.3 or later. Mitsuba's LLVM variants need a libLLVM, named by DRJIT_LIBLLVM_PATH where it
is not found; without one, only scalar_rgb runs. Method and results: mitsuba.md beside this file; how far pictures agree: agreement.py.
"""

import argparse
import datetime
import hashlib
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

try:
    import drjit as dr
    import mitsuba as mi
    import numpy as np
    import OpenEXR
except ImportError as missing:
    sys.exit(f"{missing.name or missing} is missing: pip install mitsuba OpenEXR numpy")

EPSILON = 0.01  # of relMSE, as in `noisefloor render --against`
TRIM = 0.001  # share of the pixels, those with the largest errors, that the trimmed relMSE leaves out
PASS = 32  # samples per pixel in one pass of a reference
LLVM, SCALAR = "llvm_ad_rgb", "scalar_rgb"


def say(*words):
    print(*words, file=sys.stderr, flush=True)


def seed(stream, index):
    """Seeds that lie far apart: neighbours can share random numbers in Mitsuba's scalar variants."""
    digest = hashlib.sha256(f"{stream} {index}".encode()).digest()
    return int.from_bytes(digest[:4], "little")


def scene_name(path):
    """The file's name, or its folder's for the many scenes that are called scene.xml."""
    return path.resolve().parent.name if path.stem == "scene" else path.stem


def usable(variant):
    """Whether Mitsuba has this variant and it runs here."""
    try:
        mi.set_variant(variant)
        return True
    except ImportError as error:
        say(f"{variant} is left out: {' '.join(str(error).split())}")
        return False


class Mitsuba:
    """One scene in one variant."""

    def __init__(self, variant, path, size, depth):
        mi.set_variant(variant)
        start = time.perf_counter()
        self.scene = mi.load_file(str(path))
        dr.sync_thread()
        self.load_seconds = time.perf_counter() - start
        self.variant = variant
        film = self.scene.sensors()[0].film()
        if "BoxFilter" not in str(film.rfilter()):
            sys.exit(f'{path}: set <rfilter type="box"/> in its film; noisefloor has no other filter to compare with')
        width, height = film.size()
        if width * size[1] != height * size[0]:
            sys.exit(f"{path}: its picture is {width}x{height}; choose a --size of that shape, so that the view stays the same")
        sensor = mi.traverse(self.scene.sensors()[0])
        sensor["film.size"] = size
        sensor.update()
        self.integrator = mi.load_dict({"type": "path", "max_depth": depth})

    def render(self, spp, seed):
        """Linear RGB (height, width, 3)."""
        mi.set_variant(self.variant)
        image = mi.render(self.scene, spp=spp, seed=seed, integrator=self.integrator)
        return np.array(image, dtype=np.float64)[..., :3]


class Noisefloor:
    """One scene in our command."""

    variant = "noisefloor"

    def __init__(self, command, path, size, depth, threads):
        self.command, self.path, self.size, self.depth, self.threads = command, path, size, depth, threads
        start = time.perf_counter()
        _, report = self.run(2, 0, (16, 16))
        # As little as it can render; its clock starts when the scene is there
        self.load_seconds = time.perf_counter() - start - report["seconds_total"]

    def run(self, spp, seed, size):
        with tempfile.TemporaryDirectory() as out:
            words = [self.command, "render", self.path, "--criterion", f"spp:{spp}", "--size", f"{size[0]}x{size[1]}"]
            words += ["--max-depth", self.depth, "--seed", seed, "--threads", self.threads]
            words += ["--autosave", 0, "--out", out, "--quiet"]
            try:
                done = subprocess.run([str(w) for w in words], capture_output=True, text=True)
            except OSError as error:
                sys.exit(f"{self.command} cannot be run ({error}): build it, and name it with --noisefloor")
            if done.returncode != 0:
                sys.exit(f"{' '.join(str(w) for w in words)}\nfailed with exit code {done.returncode}: {done.stderr}")
            return read_exr(Path(out, "image.exr")), json.loads(Path(out, "report.json").read_text())

    def render(self, spp, seed):
        image, report = self.run(spp, seed, self.size)
        self.seconds = report["seconds_total"]
        return image


def read_exr(path):
    """Linear RGB (height, width, 3)."""
    try:
        return OpenEXR.File(str(path)).channels()["RGB"].pixels.astype(np.float64)
    except (RuntimeError, OSError, KeyError) as error:
        sys.exit(f"{path} cannot be read as an RGB picture: {error}")


class Reference:
    """Mean of many passes, kept in two halves so that its own noise is known."""

    def __init__(self, folder, path, size, depth):
        self.file = Path(folder, f"{scene_name(path)}-{size[0]}x{size[1]}-depth{depth}.npz")
        self.scene = hashlib.sha256(path.read_bytes()).hexdigest()
        self.sums, self.passes = np.zeros((2, size[1], size[0], 3)), 0
        if self.file.exists():
            with np.load(self.file) as kept:
                if kept["scene"] != self.scene:
                    sys.exit(f"{self.file} belongs to another state of {path}: delete it, or choose another --references")
                self.sums, self.passes = kept["sums"], int(kept["passes"])

    @property
    def spp(self):
        return PASS * self.passes

    @property
    def mean(self):
        return self.sums.sum(0) / self.passes

    @property
    def noise(self):
        """Squared noise of the mean: unbiased for each value, but from one difference only."""
        a, b = (self.passes + 1) // 2, self.passes // 2
        return (self.sums[0] / a - self.sums[1] / b) ** 2 * (a * b / self.passes**2)

    def add(self, image):
        self.sums[self.passes % 2] += image
        self.passes += 1

    def save(self):
        """As .npz to go on from, and as .exr for `noisefloor render --against`."""
        self.file.parent.mkdir(parents=True, exist_ok=True)
        partial = self.file.with_suffix(".partial.npz")
        np.savez(partial, sums=self.sums, passes=self.passes, scene=self.scene)
        partial.replace(self.file)
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": self.mean.astype(np.float32)}).write(str(self.file.with_suffix(".exr")))


def rel(squares, reference):
    """Squared errors relative to a reference, each pixel's mean over its channels."""
    return (squares / (reference**2 + EPSILON)).mean(-1).ravel()


def trimmed(errors):
    return float(np.sort(errors)[: len(errors) - round(TRIM * len(errors))].mean())


def mean_and_error(values):
    """Mean over pixels, and its standard error; box-filtered pixels are independent."""
    return float(values.mean()), float(values.std() / np.sqrt(len(values)))


def reference(args):
    variant = LLVM if usable(LLVM) else SCALAR
    for path in args.scenes:
        kept = Reference(args.references, path, args.size, args.max_depth)
        renderer = Mitsuba(variant, path, args.size, args.max_depth)
        saved = time.monotonic()
        while kept.spp < args.spp or kept.passes < 2:
            image = renderer.render(PASS, seed("reference", kept.passes))
            if not np.isfinite(image).all():
                sys.exit(f"{path}: Mitsuba's pass {kept.passes} has values that are not finite")
            kept.add(image)
            if time.monotonic() - saved > 60 or kept.spp >= args.spp:
                kept.save()
                saved = time.monotonic()
                say(f"{scene_name(path)}: {kept.spp} of {args.spp} spp")
        errors = rel(kept.noise, kept.mean)
        print(f"{kept.file}: {kept.spp} spp, relMSE {errors.mean():.2e}, trimmed {trimmed(errors):.2e}")


def measure_scene(args, path, variants):
    kept = Reference(args.references, path, args.size, args.max_depth)
    if kept.passes < 2:
        sys.exit(f"{kept.file} is missing: make it with `{Path(__file__).name} reference {path}`")
    truth, noise = kept.mean, rel(kept.noise, kept.mean)
    make = {"noisefloor": lambda: Noisefloor(args.noisefloor, path, args.size, args.max_depth, args.threads)}
    for variant in variants:
        make[variant] = lambda variant=variant: Mitsuba(variant, path, args.size, args.max_depth)

    # Load three times, since the first fills the caches of the disk; compile Mitsuba's kernels
    loaded = {name: [new() for _ in range(3)] for name, new in make.items()}
    rows = {name: {"load": statistics.median(r.load_seconds for r in each)} for name, each in loaded.items()}
    renderers = [each[-1] for each in loaded.values()]
    for renderer in renderers[1:]:
        renderer.render(args.spp, 0)

    # Measure in turns, so that whatever else the machine does falls on all
    images = {name: [] for name in make}
    for row in rows.values():
        row.update(seconds=[], cpu_seconds=[], relmse=[], trimmed=[])
    for turn in range(args.rounds):
        for renderer in renderers:
            row, cpu, start = rows[renderer.variant], sum(os.times()[:4]), time.perf_counter()
            image = renderer.render(args.spp, seed(renderer.variant, turn))
            seconds = time.perf_counter() - start
            row["cpu_seconds"].append(sum(os.times()[:4]) - cpu)
            row["seconds"].append(getattr(renderer, "seconds", seconds))
            errors = rel((image - truth) ** 2, truth)
            row["relmse"].append(float(errors.mean()))
            row["trimmed"].append(trimmed(errors))
            images[renderer.variant].append(image)
            say(f"{scene_name(path)}, round {turn + 1}, {renderer.variant}: {row['seconds'][-1]:.2f} s")

    # What is not noise: (mean - truth)^2 less the noise of both
    for name, each in images.items():
        if args.rounds > 1:
            mean, variance = np.mean(each, 0), np.var(each, 0, ddof=1) / args.rounds
            rows[name]["systematic"] = mean_and_error(rel((mean - truth) ** 2 - variance, truth) - noise)
        rows[name]["mean"] = np.mean(each, (0, 1, 2)).tolist()
    return {
        "scene": scene_name(path),
        "reference": {"spp": kept.spp, "relmse": noise.mean(), "trimmed": trimmed(noise), "mean": truth.mean((0, 1)).tolist()},
        "renderers": rows,
    }


def table(scene, args):
    """The scene's results in Markdown."""
    of = scene["reference"]
    lines = [f"**{scene['scene']}**; reference: {of['spp']:,} spp, its own relMSE {of['relmse']:.1e}, trimmed {of['trimmed']:.1e}", ""]
    lines += ["| | seconds | of ours | M samples/s | CPU s | load s | relMSE | trimmed | relMSE × s | trimmed × s | systematic |"]
    lines += ["|---|" + "---|" * 10]
    median, mean = statistics.median, statistics.fmean
    ours = median(scene["renderers"]["noisefloor"]["seconds"])
    for name, row in scene["renderers"].items():
        seconds, error, core = median(row["seconds"]), mean(row["relmse"]) - of["relmse"], mean(row["trimmed"])
        samples = args.size[0] * args.size[1] * args.spp / seconds / 1e6
        systematic = "{:.1e} ± {:.1e}".format(*row["systematic"]) if "systematic" in row else "–"
        lines.append(
            f"| {name} | {seconds:.2f} | {seconds / ours:.2f} | {samples:.2f} | {median(row['cpu_seconds']):.2f} | {row['load']:.2f} "
            f"| {error:.2e} | {core:.2e} | {error * seconds:.3f} | {core * seconds:.3f} | {systematic} |"
        )
    return "\n".join(lines) + "\n"


def processor():
    info = Path("/proc/cpuinfo")
    names = [line.split(": ")[1] for line in info.read_text().splitlines() if "model name" in line] if info.exists() else []
    return names[0] if names else platform.processor()


def measure(args):
    variants = [v for v in (SCALAR, LLVM) if usable(v)]
    dr.set_thread_count(args.threads)
    try:
        version = subprocess.run([args.noisefloor, "--version"], capture_output=True, text=True).stdout.strip()
    except OSError as error:
        sys.exit(f"{args.noisefloor} cannot be run ({error}): build it, and name it with --noisefloor")
    about = {
        "date": datetime.date.today().isoformat(),
        "machine": f"{processor()}, {os.cpu_count()} logical processors, {platform.system()}",
        "versions": {"noisefloor": version, "mitsuba": mi.__version__, "drjit": dr.__version__, "python": platform.python_version()},
        "settings": {k: getattr(args, k) for k in ("size", "max_depth", "spp", "rounds", "threads")},
        "epsilon": EPSILON,
        "trim": TRIM,
    }
    scenes = [measure_scene(args, path, variants) for path in args.scenes]
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "results.json").write_text(json.dumps({**about, "scenes": scenes}, indent=1) + "\n")
    head = f"{about['date']}, {about['machine']}; {version}, Mitsuba {mi.__version__} (Dr.Jit {dr.__version__}). "
    head += f"{args.size[0]}×{args.size[1]}, {args.spp} spp, paths of up to {args.max_depth} segments, {args.threads} threads, "
    head += f"medians of {args.rounds} rounds.\n"
    report = "\n".join([head] + [table(scene, args) for scene in scenes])
    (args.out / "results.md").write_text(report)
    print(report)


def whole(text):
    """A number of things, for argparse."""
    if int(text) < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return int(text)


def size(text):
    """WIDTHxHEIGHT, for argparse."""
    try:
        width, height = (whole(x) for x in text.split("x"))
        return width, height
    except ValueError:
        raise argparse.ArgumentTypeError("expected WIDTHxHEIGHT, such as 512x512") from None


def scene(text):
    """A file that exists, for argparse."""
    if not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"{text} is not there")
    return Path(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)

    def command(run, help):
        sub = commands.add_parser(run.__name__, help=help)
        sub.set_defaults(run=run)
        sub.add_argument("scenes", nargs="+", type=scene, metavar="SCENE.xml")
        sub.add_argument("--references", type=Path, default=Path("references"), help="folder of the references [references]")
        sub.add_argument("--size", type=size, default=(512, 512), metavar="WxH", help="[512x512]")
        sub.add_argument("--max-depth", type=whole, default=65, help="longest path in segments, whatever the file says [65]")
        return sub

    sub = command(reference, "render converged references")
    sub.add_argument("--spp", type=whole, default=4096, help="samples per pixel, with those already there [4096]")
    sub = command(measure, "time and score both renderers")
    sub.add_argument("--noisefloor", default="target/release/noisefloor", help="our command [target/release/noisefloor]")
    sub.add_argument("--spp", type=whole, default=64, help="samples per pixel [64]")
    sub.add_argument("--rounds", type=whole, default=5, help="[5]")
    sub.add_argument("--threads", type=whole, default=os.cpu_count(), help="of each renderer [one to a logical processor]")
    sub.add_argument("--out", type=Path, default=Path("results"), help="folder for results.json and results.md [results]")
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
