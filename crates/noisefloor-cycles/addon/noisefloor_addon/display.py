"""The picture that Blender shows, as a table: view transform, look, exposure, gamma, curves, white balance and the
display device, of a studio's own OCIO configuration as well."""

import os
import tempfile

import bpy
import noisefloor
import numpy

# Entries along each axis, the radiance from which they are logarithmic, and the last: 3/8 of a stop apart, and one at 1,
# where plain sRGB has its edge
EDGE, TOE, TOP = 65, 2.0**-12, 2.0**12
# What a PNG of 16 bits is saved by
FILE = {
    "file_format": "PNG",
    "color_mode": "RGB",
    "color_depth": "16",
    "compression": 0,
    "color_management": "FOLLOW_SCENE",
}


def table(scene):
    """How this scene is shown. Blender itself shows a picture of known values, into a file; takes 0.1 s, in the thread
    with the windows."""
    settings = scene.render.image_settings
    # Which formats there are depends on the kind of media
    kinds = {"media_type": "IMAGE"} if hasattr(settings, "media_type") else {}
    wanted = {name: value for name, value in {**kinds, **FILE}.items() if hasattr(settings, name)}
    before = {name: getattr(settings, name) for name in wanted}
    axis = noisefloor.ToneTable.radiances(EDGE, TOE, TOP)
    colours = numpy.ones((EDGE, EDGE, EDGE, 4), numpy.float32)
    colours[..., 2], colours[..., 1], colours[..., 0] = numpy.meshgrid(axis, axis, axis, indexing="ij")
    image = bpy.data.images.new("noisefloor display", EDGE * EDGE, EDGE, float_buffer=True)
    try:
        for name, value in wanted.items():
            setattr(settings, name, value)
        # Rows from the bottom, one for each blue; a row has all greens, each with all reds
        image.pixels.foreach_set(colours.ravel())
        with tempfile.TemporaryDirectory(prefix="noisefloor-") as folder:
            path = os.path.join(folder, "display.png")
            image.save_render(path, scene=scene)
            shown, _ = noisefloor.read(path)
    finally:
        bpy.data.images.remove(image)
        # The kind of media last: a format that it does not have would be lost
        for name in sorted(before, key=lambda name: name != "media_type"):
            setattr(settings, name, before[name])
    shown = shown[::-1].reshape(EDGE, EDGE, EDGE, 3) / numpy.float32(numpy.iinfo(shown.dtype).max)
    return noisefloor.ToneTable(shown, TOE, TOP)
