"""A loop around Mitsuba 3 in the same process: crops of the Cornell box, tile by tile.

    pip install mitsuba
    python examples/8-python/mitsuba_loop.py [size]

Without Mitsuba it says so, and ends with exit code 77. `noisefloor render --source mitsuba` does more: it
renders all open tiles at once, restarts a renderer that fails, and resumes.
"""

import sys

import numpy as np

import noisefloor

try:
    import mitsuba as mi
except ImportError as error:
    print(f"SKIPPED: {error}; pip install mitsuba", file=sys.stderr)
    sys.exit(77)

mi.set_variant("scalar_rgb")  # needs no libLLVM
SIZE = int(sys.argv[1]) if len(sys.argv) > 1 else 128


def load(tile):
    """The scene, cropped to a tile. With a box as the filter, the noise of pixels is independent."""
    scene = mi.cornell_box()
    scene["sensor"]["film"] = {
        "type": "hdrfilm", "width": SIZE, "height": SIZE,
        "pixel_format": "rgb", "component_format": "float32",
        "crop_offset_x": tile.x, "crop_offset_y": tile.y,
        "crop_width": tile.width, "crop_height": tile.height,
        "rfilter": {"type": "box"},
    }
    scene["sensor"]["sampler"] = {"type": "independent"}
    return mi.load_dict(scene)


params = noisefloor.Params(tile=64, step=32, min_spp=32, max_spp=256)
session = noisefloor.Session(SIZE, SIZE, params=params)
scenes = {request.tile.index: load(request.tile) for request in session.requests()}
while not session.done:
    for request in session.requests():
        # Each batch has a seed of its own: no sample comes twice
        seed = request.tile.index * 100_003 + request.first
        picture = mi.render(scenes[request.tile.index], spp=request.spp, seed=seed)
        session.push(request.tile, request.spp, np.array(picture))
    for stop in session.judge():
        print(f"tile {stop.tile.index:2}: {stop.reason} at {stop.spp} samples per pixel")
    if (to_go := session.expected_samples) is not None and not session.done:
        print(f"about {to_go / SIZE**2:.0f} samples per pixel to go")
print(f"{session.spp().mean():.0f} samples per pixel on average")
