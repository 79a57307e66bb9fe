#!/usr/bin/env python3
"""What an adapter costs: 100 samples a pixel through noisefloor, against 100 samples by the renderer alone.

    overhead.py --noisefloor ../target/release/noisefloor [--size 256] [--batches 5] [--rounds 3] [RENDERER ...]

In turns, round by round: the renderer's own Python renders the Cornell box of fixtures/ N times after a first render that warms it
up, each the whole picture with 100 samples in one call, and noisefloor renders the same scene tile by tile with N+1 batches of 100,
the first one not counted. Prints medians in seconds for 100 samples, and their ratio. Renderers: mitsuba, luxcore, cycles.
"""

import argparse
import csv
import glob
import json
import os
import statistics
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
FIXTURES = os.path.normpath(os.path.join(HERE, "../fixtures"))
TILE = 64

MITSUBA = """
import json, sys, time
import mitsuba as mi
size, spp, count = map(int, sys.argv[2:])
mi.set_variant("llvm_ad_rgb")
import drjit as dr
with open(sys.argv[1]) as file:
    scene = mi.load_string(file.read().replace('"512"', f'"{size}"'))
times = []
for turn in range(count + 1):
    begun = time.perf_counter()
    mi.render(scene, spp=spp, seed=turn).numpy()
    times.append(time.perf_counter() - begun)
print(json.dumps(times[1:]))
"""

LUXCORE = """
import json, os, sys, time
import numpy
import pyluxcore as lux
path, (size, spp, count) = sys.argv[1], map(int, sys.argv[2:])
os.chdir(os.path.dirname(path))
lux.Init(lambda message: None)
times = []
for turn in range(count + 1):
    config = lux.Properties(path)
    values = {"film.width": size, "film.height": size, "film.filter.type": "NONE", "renderengine.type": "PATHCPU",
              "sampler.type": "RANDOM", "sampler.random.adaptive.strength": 0.0, "path.clamping.variance.maxvalue": 0.0,
              "renderengine.seed": turn + 1, "native.threads.count": os.cpu_count()}
    for key, value in values.items():
        config.Set(lux.Property(key, [value]))
    scene = lux.Scene()
    scene.Parse(lux.Properties("cornell-box.scn"))
    session = lux.RenderSession(lux.RenderConfig(config, scene))
    begun = time.perf_counter()
    session.Start()
    film = session.GetFilm()
    done = 0.0
    while done < spp * size * size:
        time.sleep(0.005)
        done = film.GetStats().Get("stats.film.total.samplecount").GetFloat()
    seconds = time.perf_counter() - begun
    session.Stop()
    times.append(seconds * spp * size * size / done)
print(json.dumps(times[1:]), flush=True)
os._exit(0)
"""

CYCLES = """
import json, os, runpy, sys, time
import bpy
out = os.dup(1)
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
path, (size, spp, count) = sys.argv[1], map(int, sys.argv[2:])
runpy.run_path(path)
scene = bpy.context.scene
render, cycles = scene.render, scene.cycles
render.engine, cycles.device, render.use_persistent_data = "CYCLES", "CPU", True
render.resolution_x = render.resolution_y = size
render.resolution_percentage = 100
cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0.0
cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_auto_tile = False
cycles.sampling_pattern, cycles.samples = "TABULATED_SOBOL", spp
render.use_compositing = render.use_sequencer = False
times = []
for turn in range(count + 1):
    cycles.seed = turn
    begun = time.perf_counter()
    bpy.ops.render.render()
    times.append(time.perf_counter() - begun)
os.write(out, (json.dumps(times[1:]) + "\\n").encode())
os._exit(0)
"""

RENDERERS = {
    "mitsuba": (MITSUBA, os.path.join(FIXTURES, "cornell-box.xml")),
    "luxcore": (LUXCORE, os.path.join(FIXTURES, "cornell-box/cornell-box.cfg")),
    "cycles": (CYCLES, os.path.join(FIXTURES, "cornell-box/cornell-box.py")),
}
SPP = 100


def python(renderer):
    named = os.environ.get(f"NOISEFLOOR_{renderer.upper()}_PYTHON")
    if named:
        return named
    cache = os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~/.cache"))
    found = glob.glob(os.path.join(cache, f"noisefloor/{renderer}-*/bin/python"))
    if not found:
        sys.exit(f"{renderer} is not installed: noisefloor doctor --install {renderer}")
    return found[0]


def alone(renderer, args):
    program, scene = RENDERERS[renderer]
    environment = dict(os.environ)
    library = glob.glob("/usr/lib/*/libLLVM*19*")
    if library:
        environment.setdefault("DRJIT_LIBLLVM_PATH", library[0])
    command = [python(renderer), "-c", program, scene, str(args.size), str(SPP), str(args.batches)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True, env=environment)
    return json.loads(done.stdout.strip().splitlines()[-1])


def through(renderer, args):
    """Seconds for 100 samples of the whole picture, the first batch left out."""
    scene = RENDERERS[renderer][1]
    with tempfile.TemporaryDirectory() as out:
        command = [args.noisefloor, "render", scene, "--source", renderer, "--size", f"{args.size}x{args.size}"]
        command += ["--tile", str(TILE), "--criterion", f"spp:{SPP * (args.batches + 1)}", "--schedule", "every", "--batch", str(SPP)]
        subprocess.run(command + ["--quiet", "--autosave", "0", "--out", out], check=True)
        with open(os.path.join(out, "timeline.csv")) as file:
            rows = [(float(r["seconds"]), int(r["samples"])) for r in csv.DictReader(file)]
    pixels = args.size * args.size
    first = next(row for row in rows if row[1] >= SPP * pixels)
    (t0, n0), (t1, n1) = first, rows[-1]
    return (t1 - t0) / (n1 - n0) * SPP * pixels


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("renderers", nargs="*", default=list(RENDERERS), metavar="RENDERER")
    parser.add_argument("--noisefloor", required=True)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--batches", type=int, default=5)
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    print(f"| renderer, {args.size}x{args.size}, {SPP} samples | alone, s | through noisefloor, s | ratio |\n|---|---|---|---|")
    for renderer in args.renderers:
        own, ours = [], []
        for _ in range(args.rounds):
            own += alone(renderer, args)
            ours.append(through(renderer, args))
        a, b = statistics.median(own), statistics.median(ours)
        print(f"| {renderer} | {a:.2f} | {b:.2f} | {b / a:.3f} |", flush=True)


if __name__ == "__main__":
    main()
