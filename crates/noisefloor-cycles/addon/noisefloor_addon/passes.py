"""Pictures out of a render result of Blender's and into it, as arrays of shape (height, width, channels),
rows from the top. In memory they lie as Blender has them, rows from the bottom, so that few are copied."""

import concurrent.futures
import os
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
        flat = numpy.empty(_shape(across * result.resolution_y, rendered.channels), numpy.float32)
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
            flat = numpy.ascontiguousarray(picture, numpy.float32)
            rendered.rect.foreach_set(flat.reshape(_shape(width * height, rendered.channels)))
    engine.end_result(result)


def _shape(pixels, channels):
    """Of what foreach_get and foreach_set take: before Blender 4, an item for each pixel."""
    return pixels * channels if bpy.app.version >= (4, 0) else (pixels, channels)


def upright(shape):
    """A new picture of zeros."""
    return numpy.zeros(shape, numpy.float32)[::-1]


# Rows of a picture that a thread works on at a time: few enough for a cache
ROWS = 16


def blend(one, other, share, out):
    """The mean of two pictures, of which `other` has this share, an array of shape (height, width, 1); `out` may be one of them.
    In several threads: numpy lets go of the interpreter."""
    def rows(y):
        here = slice(y, y + ROWS)
        out[here] = one[here] + (other[here] - one[here]) * share[here]

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as threads:
        list(threads.map(rows, range(0, len(out), ROWS)))


class Means:
    """Means over samples of all passes of a frame."""

    def __init__(self, width, height):
        self.samples, self.means = upright((height, width, 1)), {}

    def add(self, region, samples, pictures):
        """Adds pictures of a region, of which each pixel is the mean of so many new samples, an array of shape (height,
        width, 1). Those of the whole frame are kept, and added to, if they are the first."""
        x, y, width, height = region
        if not self.means and (height, width) == self.samples.shape[:2]:
            self.samples, self.means = samples.copy(order="K"), dict(pictures)
            return
        here = slice(y, y + height), slice(x, x + width)
        before = self.samples[here]
        both = before + samples
        share = samples / numpy.maximum(both, 1)
        for name, picture in pictures.items():
            mean = self.means.setdefault(name, upright((*self.samples.shape[:2], picture.shape[2])))[here]
            if LABELS.match(name):
                numpy.copyto(mean, picture, where=before == 0)
            else:
                blend(mean, picture, share, mean)
        self.samples[here] = both

    @classmethod
    def joined(cls, one, other):
        """All samples of both."""
        height, width, _ = one.samples.shape
        both = cls(width, height)
        both.samples = one.samples + other.samples
        share = other.samples / numpy.maximum(both.samples, 1)
        for name, mean in one.means.items():
            beside = other.means.get(name, mean)
            if LABELS.match(name):
                both.means[name] = numpy.where(one.samples > 0, mean, beside)
            else:
                both.means[name] = numpy.empty_like(mean[::-1])[::-1]
                blend(mean, beside, share, both.means[name])
        return both
