#!/usr/bin/env python3
"""LuxCore's halt threshold: guesses, fixed samples, and what `noisefloor tune` finds, for renderers.md.

    tune_luxcore.py SCENE.cfg WIDTHxHEIGHT FOLDER NOISEFLOOR [REFERENCE_SPP]
    tune.py measure FOLDER...                                                       pip install cvvdp pillow

Run it in the environment of `noisefloor doctor --install luxcore`, in the folder that the scene's names begin at. Pictures are denoised by
LuxCore's own Open Image Denoise and shown by its linear tone mapping, whose scale makes the log-average 0.18, with a gamma of 2.2. Guessed
thresholds are looked at every 64 samples, LuxCore's default; the one that is found every 16, as `tune` does. Two seeds, of fixed samples one; it goes on where
it was interrupted."""
import json
import pathlib
import resource
import subprocess
import sys
import time

import numpy  # before pyluxcore, which crashes if it loads numpy itself
import pyluxcore

THRESHOLDS = (0.2, 0.1, 10 / 256, 5 / 256, 0.01)
SAMPLES = (64, 256, 512)
MOST = 1024

scene, size, folder, noisefloor, *more = sys.argv[1:]
reference = int(more[0]) if more else 4096
width, height = map(int, size.split("x"))
folder = pathlib.Path(folder).resolve()
folder.mkdir(parents=True, exist_ok=True)
times = folder / "times.json"
done = json.loads(times.read_text()) if times.exists() else {}
pyluxcore.Init(lambda message: None)


def used():
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + children.ru_utime


def render(seed, threshold=None, samples=MOST, step=64, scale=1.0):
    """The finished film."""
    config = pyluxcore.Properties(scene)
    for prefix in ("film.imagepipeline", "film.outputs", "batch."):
        config.DeleteAll(config.GetAllNames(prefix))
    said = {
        "renderengine.type": "PATHCPU", "renderengine.seed": seed, "sampler.type": "RANDOM",
        "film.width": width, "film.height": height, "batch.haltspp": samples,
        "film.imagepipelines.0.0.type": "INTEL_OIDN",
        "film.imagepipelines.0.1.type": "TONEMAP_LINEAR", "film.imagepipelines.0.1.scale": scale,
        "film.imagepipelines.0.2.type": "GAMMA_CORRECTION", "film.imagepipelines.0.2.value": 2.2,
    }  # fmt: skip
    if threshold:
        said |= {"batch.haltthreshold": threshold, "batch.haltthreshold.step": step, "batch.haltthreshold.warmup": step,
                 "film.noiseestimation.step": step, "film.noiseestimation.warmup": step}  # fmt: skip
    for key, value in said.items():
        config.Set(pyluxcore.Property(key, [value]))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(config))
    session.Start()
    while not session.HasDone():
        time.sleep(0.05)
        session.UpdateStats()
    session.Stop()
    return session.GetFilm()


def one(name, **settings):
    if name in done:
        return
    before, begun = used(), time.time()
    film = render(scale=done["scale"], **settings)
    film.SaveOutput(str(folder / f"{name}.png"), pyluxcore.FilmOutputType.RGB_IMAGEPIPELINE, pyluxcore.Properties())
    keep(name, {"user": used() - before, "wall": time.time() - begun})


def keep(name, value):
    done[name] = value
    times.write_text(json.dumps(done, indent=1))
    print(name, value, flush=True)


if "scale" not in done:
    picture = numpy.empty((height, width, 3), numpy.float32)
    render(1, samples=32).GetOutputFloat(pyluxcore.FilmOutputType.RGB, picture)
    lights = picture @ [0.2126, 0.7152, 0.0722]
    keep("scale", float(0.18 / numpy.exp(numpy.log(numpy.maximum(lights, 1e-6)).mean())))
if "search" not in done:
    before = used()
    command = [noisefloor, "tune", scene, "--source", "luxcore", "--denoise", "oidn", "--size", size, "--seed", "3", "--json",
               "--tone-mapping", "srgb", "--exposure", str(done["scale"]), "--max-spp", str(MOST)]  # fmt: skip
    run = subprocess.run(command, capture_output=True, text=True)
    said = json.loads(run.stdout) if run.returncode == 0 else {}
    keep("search", {"user": used() - before, "found": said.get("setting"), "said": said or run.stderr})
for seed in (1, 2):
    if done["search"]["found"]:
        one(f"tuned-{done['search']['found']:g}-{seed}", seed=seed, threshold=done["search"]["found"], step=16)
    for threshold in THRESHOLDS[:-1]:
        one(f"threshold-{threshold:.2g}-{seed}", seed=seed, threshold=threshold)
one(f"samples-{reference}-77", seed=77, samples=reference)
for seed in (1, 2):
    one(f"threshold-{THRESHOLDS[-1]:g}-{seed}", seed=seed, threshold=THRESHOLDS[-1])
for samples in SAMPLES:
    one(f"samples-{samples}-1", seed=1, samples=samples)
