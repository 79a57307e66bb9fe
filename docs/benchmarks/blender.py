#!/usr/bin/env python3
"""Renders a scene in Blender with and without the add-on, for blender.md: blender.py ADDON.zip SCENE.py SIZE
WHO OUT.exr

WHO is `cycles`: Cycles' defaults (noise threshold 0.01, at most 4,096 samples, Open Image Denoise);
`noisefloor`: the add-on with tiles of 64; `noisefloor-denoised`: the same with Denoise on; or `reference`:
2,048 samples with another seed. Filter, clamping and light threshold are Blender's defaults in all of them.
Prints user seconds of the render, its wall seconds and its summary or samples. Run it in an environment that
has bpy and the wheel of noisefloor; then `at_the_stop.py OUT.exr:0 REFERENCE.exr:2048`.
"""

import resource
import runpy
import sys
import tempfile
import time
import zipfile

import bpy

addon, path, size, who, out = sys.argv[1:]
runpy.run_path(path)
scene = bpy.context.scene
render, cycles = scene.render, scene.cycles
cycles.device = "CPU"
render.resolution_x = render.resolution_y = int(size)
render.resolution_percentage = 100
cycles.samples, cycles.seed = (2048, 77) if who == "reference" else (4096, 5)
cycles.use_adaptive_sampling, cycles.adaptive_threshold = who != "reference", 0.01
cycles.use_denoising = who in ("cycles", "noisefloor-denoised")
layer = scene.view_layers[0]
layer.cycles.pass_debug_sample_count = who == "cycles"
settings = render.image_settings
if hasattr(settings, "media_type"):
    settings.media_type = "MULTI_LAYER_IMAGE"
settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
render.filepath = out
with tempfile.TemporaryDirectory() as folder:
    zipfile.ZipFile(addon).extractall(folder)
    sys.path.insert(0, folder)
    import noisefloor_addon

    noisefloor_addon.register()
    scene.noisefloor.use, scene.noisefloor.tile = who.startswith("noisefloor"), 64
    scene.noisefloor.write_maps = False
    before, begun = resource.getrusage(resource.RUSAGE_SELF).ru_utime, time.time()
    bpy.ops.render.render(write_still=True)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_utime - before
    print(f"USER {used:.1f} WALL {time.time() - begun:.1f}")
    noisefloor_addon.unregister()
