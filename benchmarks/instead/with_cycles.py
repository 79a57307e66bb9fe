#!/usr/bin/env python3
"""Renders a scene as Cycles does by default, for criteria.md: with_cycles.py SCENE.py SIZE OUT.exr

Adaptive sampling with a noise threshold of 0.01 and at most 4,096 samples, and Open Image Denoise with albedo and normals. OUT.exr has
several layers: the denoised picture, the noisy one and the samples of each pixel. Filter, clamping and light threshold are those of
noisefloor's adapter (box, none, 0), because another filter or a clamp would count as noise. Prints the seconds of the render.
Run it in the environment of `noisefloor doctor --install cycles`.
"""

import runpy
import sys
import time

import bpy

path, size, out = sys.argv[1:]
runpy.run_path(path)
scene = bpy.context.scene
render, cycles = scene.render, scene.cycles
cycles.device = "CPU"
render.resolution_x = render.resolution_y = int(size)
render.resolution_percentage = 100
cycles.use_adaptive_sampling, cycles.adaptive_threshold, cycles.samples = True, 0.01, 4096
cycles.adaptive_min_samples, cycles.time_limit = 0, 0.0
cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0.0
cycles.seed = 5
layer = scene.view_layers[0]
layer.cycles.denoising_store_passes = layer.cycles.pass_debug_sample_count = True
settings = render.image_settings
if hasattr(settings, "media_type"):
    settings.media_type = "MULTI_LAYER_IMAGE"
settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
render.filepath = out
start = time.time()
bpy.ops.render.render(write_still=True)
print(f"SECONDS {time.time() - start:.1f}")
