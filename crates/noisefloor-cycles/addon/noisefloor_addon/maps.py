"""Heat maps."""

import math

import numpy

# Dark blue to yellow over equal steps of lightness, so that the order is seen without colours
RAMP = numpy.array(
    [(13, 8, 60), (84, 20, 110), (160, 45, 95), (220, 95, 55), (248, 165, 45), (250, 240, 150)], float
)
# The same in steps that nobody tells apart, as many as a byte has numbers; and grey, where there is nothing
COLOURS = numpy.stack(
    [numpy.interp(numpy.arange(256) / 51, numpy.arange(len(RAMP)), RAMP[:, channel]).round() for channel in range(3)], -1
)
COLOURS = numpy.concatenate([COLOURS, [[128, 128, 128]]]).astype(numpy.uint8)


def heat(values, low, high):
    """Colours (height, width, 3), uint8, of values on a logarithmic scale from low to high; grey where there
    are none."""
    known = numpy.isfinite(values) & (values > 0)
    logs = numpy.log2(numpy.where(known, values, low) / low, dtype=numpy.float32)
    place = numpy.clip(logs / max(math.log2(high / low), 1e-9), 0, 1) * 255
    return COLOURS[numpy.where(known, place.round(), 256).astype(numpy.uint16)]


def samples_map(spp):
    """Heat map of samples per pixel, from the fewest to the most."""
    some = spp[spp > 0]
    return heat(spp, *((float(some.min()), float(max(some.max(), some.min() * 2))) if some.size else (1, 2)))


def left_map(left, denoised, settings):
    """By its name, map of what is left: from ¼ to 4 times what is just seen, or of what may be lost, so that maps can be
    compared."""
    if denoised:
        return {"jod lost": heat(left / settings.lost, 0.25, 4.0)}
    return {"visible noise": heat(left, 0.25, 4.0)}
