"""Pictures out of a render result of Blender's and into it, as arrays of shape (height, width, channels),
rows from the top."""

import re

import bpy
import numpy

# What Cycles keeps beside passes that it denoises
NOISY = ("Noisy Image", "Noisy Shadow Catcher")
# Not a mean over samples, as the others are: what the first batch found stays
LABELS = re.compile(r"(Depth|Object Index|Material Index|IndexOB|IndexMA|Crypto(Object|Material|Asset)\d\d)$")


def read(engine, layer, region):
    """The passes of a layer, by name, as a render of a region of this width and height left them: Cycles
    puts it into the lower left corner."""
    result = engine.get_result()
    across, (width, height) = result.resolution_x, region
    pictures = {}
    for rendered in result.layers[layer].passes:
        flat = _buffer(across * result.resolution_y, rendered.channels)
        rendered.rect.foreach_get(flat)
        rows = flat.reshape(result.resolution_y, across, rendered.channels)
        pictures[rendered.name] = rows[:height, :width][::-1]
    return pictures


def write(engine, layer, pictures):
    """Puts pictures of the whole frame into the passes of these names, and 0 into the others."""
    height, width = next(iter(pictures.values())).shape[:2]
    result = engine.begin_result(0, 0, width, height, layer=layer)
    for rendered in result.layers[0].passes:
        if rendered.name in pictures:
            picture = pictures[rendered.name].reshape(height, width, rendered.channels)[::-1]
            flat = _buffer(width * height, rendered.channels)
            flat.reshape(picture.shape)[:] = picture
            rendered.rect.foreach_set(flat)
    engine.end_result(result)


def _buffer(pixels, channels):
    """What foreach_get and foreach_set take: before Blender 4, an item for each pixel."""
    return numpy.empty(pixels * channels if bpy.app.version >= (4, 0) else (pixels, channels), numpy.float32)


class Sums:
    """Sums of samples of all passes of a frame."""

    def __init__(self, width, height):
        self.samples = numpy.zeros((height, width, 1), numpy.float32)
        self.sums = {}

    def add(self, region, samples, pictures):
        """Adds pictures of a region, of which each pixel is the mean of so many new samples, an array of shape (height,
        width, 1)."""
        x, y, width, height = region
        here = slice(y, y + height), slice(x, x + width)
        first = self.samples[here] == 0
        self.samples[here] += samples
        for name, picture in pictures.items():
            if name not in self.sums:
                self.sums[name] = numpy.zeros((*self.samples.shape[:2], picture.shape[2]), numpy.float32)
            if LABELS.match(name):
                numpy.copyto(self.sums[name][here], picture, where=first)
            else:
                self.sums[name][here] += picture * samples

    @classmethod
    def joined(cls, one, other):
        """All samples of both."""
        height, width, _ = one.samples.shape
        both = cls(width, height)
        for each in (one, other):
            both.add((0, 0, width, height), each.samples, each.means())
        return both

    def means(self):
        """The passes by name; 0 where there are no samples."""
        samples = numpy.maximum(self.samples, 1)
        return {
            name: total if LABELS.match(name) else total / samples for name, total in self.sums.items()
        }
