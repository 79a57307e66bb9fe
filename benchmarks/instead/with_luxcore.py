#!/usr/bin/env python3
"""Renders a scene until LuxCore's own halt condition stops it, for criteria.md: with_luxcore.py SCENE.cfg SIZE OUT.exr

The condition is that of BlendLuxCore's interface with its default numbers: at most 5 of 256 grey levels between two tests, 64 samples
before the first test and 64 between two, on every pixel. Sampler and filter are those of noisefloor's adapter (random, none), because
another filter would count as noise. Prints the samples per pixel and the seconds of the render. Run it in the environment of
`noisefloor doctor --install luxcore`, in the folder of the scene.
"""

import sys
import time

import numpy  # before pyluxcore, which crashes if it loads numpy itself
import pyluxcore

path, size, out = sys.argv[1], int(sys.argv[2]), sys.argv[3]
pyluxcore.Init(lambda message: None)
properties = pyluxcore.Properties(path)
said = {
    "renderengine.type": "PATHCPU",
    "sampler.type": "RANDOM",
    "sampler.random.adaptive.strength": 0.0,
    "film.filter.type": "NONE",
    "film.width": size,
    "film.height": size,
    "path.clamping.variance.maxvalue": 0.0,
    "batch.haltthreshold": 5 / 256,
    "batch.haltthreshold.warmup": 64,
    "batch.haltthreshold.step": 64,
    "batch.haltthreshold.filter.enable": True,
    "batch.haltthreshold.stoprendering.enable": True,
    "film.outputs.0.type": "RGB",
    "film.outputs.0.filename": out,
}
for key, value in said.items():
    properties.Set(pyluxcore.Property(key, [value]))
session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties))
start = time.time()
session.Start()
while not session.HasDone():
    time.sleep(0.2)
    session.UpdateStats()
seconds = time.time() - start
samples = session.GetStats().Get("stats.renderengine.pass").GetInt()
session.Stop()
session.GetFilm().SaveOutput(out, pyluxcore.FilmOutputType.RGB, pyluxcore.Properties())
print(f"SAMPLES {samples} SECONDS {seconds:.1f}")
