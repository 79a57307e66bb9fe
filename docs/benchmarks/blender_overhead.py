#!/usr/bin/env python3
"""User seconds of the add-on against Cycles alone at equal samples, for blender.md: blender_overhead.py
ADDON.zip WIDTH HEIGHT SAMPLES RUNS

Renders Blender's default scene, in turns, without denoising and adaptive sampling. Run it in an environment
that has bpy and the wheel of noisefloor.
"""

import resource
import statistics
import sys
import tempfile
import zipfile

import bpy

addon, width, height, samples, runs = sys.argv[1], *map(int, sys.argv[2:])


def seconds(on):
    scene.noisefloor.use = on
    before = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    bpy.ops.render.render()
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime - before


bpy.ops.wm.read_factory_settings()
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.device, scene.cycles.samples = "CPU", samples
scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
with tempfile.TemporaryDirectory() as folder:
    zipfile.ZipFile(addon).extractall(folder)
    sys.path.insert(0, folder)
    import noisefloor_addon

    noisefloor_addon.register()
    scene.noisefloor.max_samples, scene.noisefloor.write_maps = samples, False
    seconds(False)
    pairs = [(seconds(False), seconds(True)) for _ in range(runs)]
    noisefloor_addon.unregister()
alone, ours = (statistics.median(column) for column in zip(*pairs))
print(f"PAIRS {pairs}")
print(f"MEDIANS alone {alone:.1f}, with the add-on {ours:.1f}, ratio {ours / alone:.3f}")
