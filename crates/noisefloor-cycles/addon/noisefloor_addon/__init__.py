"""Find the noise threshold at which nobody sees noise, or render until nobody does: an add-on for Blender, 3.4 and 4.2
to 5.x."""

import glob
import os
import sys
import zipfile

bl_info = {
    "name": "noisefloor",
    "description": "Cycles samples each tile until people stop seeing noise",
    "author": "The noisefloor authors",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Render > Sampling",
    "category": "Render",
}

# Blender 4.2 and later installs the wheels of extensions. For versions before, the wheel is unpacked beside
# this file, once
try:
    import noisefloor
except ImportError:
    _here = os.path.dirname(os.path.abspath(__file__))
    _unpacked = os.path.join(_here, "unpacked")
    if not os.path.isdir(_unpacked):
        for _wheel in glob.glob(os.path.join(_here, "wheels", "*.whl")):
            zipfile.ZipFile(_wheel).extractall(_unpacked)
    sys.path.append(_unpacked)

import bpy

from . import hooks, panel, settings, tune

CLASSES = (
    settings.Settings,
    tune.RENDER_OT_noisefloor_threshold,
    tune.RENDER_OT_noisefloor_stop,
    panel.RENDER_PT_noisefloor,
)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.noisefloor = bpy.props.PointerProperty(type=settings.Settings)
    hooks.register()
    if hasattr(bpy.types, "CYCLES_RENDER_PT_sampling_render"):
        bpy.types.CYCLES_RENDER_PT_sampling_render.append(tune.draw)


def unregister():
    if hasattr(bpy.types, "CYCLES_RENDER_PT_sampling_render"):
        bpy.types.CYCLES_RENDER_PT_sampling_render.remove(tune.draw)
    hooks.unregister()
    del bpy.types.Scene.noisefloor
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
