"""Which samples Cycles takes: by a number of them, or by its own noise threshold. The host of noisefloor-cycles and the
add-on share this file.

By a number, each of the two halves of a tile's samples is one pattern of Cycles' Sobol table, scrambled by a seed that
follows from the number of the half: sample k of a half thereby follows from seed, pixel, half and k, however
requests are cut. The noise of two halves is hardly correlated (-0.04 in the Cornell box); that of successive
subsets of one pattern is, since each fills the gaps of those before.
"""

import hashlib
import math

# Points of Cycles' table; a pattern of its own follows. Older versions of Blender render no part of a longer one
LONGEST, WITHOUT_PARTS = 8192, 16
# What says which region is rendered
BORDER = ["use_border", "use_crop_to_border", "border_min_x", "border_max_x", "border_min_y", "border_max_y"]


def independent(cycles):
    """Makes samples independent from pixel to pixel and from pattern to pattern. cycles: the Cycles settings
    of a scene."""
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_guiding = False
    cycles.time_limit = 0.0
    cycles.use_layer_samples = "IGNORE"
    # The other patterns and scramblings make neighbouring pixels alike, or unlike, on purpose
    try:
        cycles.sampling_pattern = "TABULATED_SOBOL"
    except TypeError:  # before Blender 3.5, Sobol points are computed
        cycles.sampling_pattern = "SOBOL"
    cycles.auto_scrambling_distance, cycles.scrambling_distance = False, 1.0
    cycles.use_animated_seed = False
    # Tiles of Cycles' own would go through a file on disk
    cycles.use_auto_tile = False


def seed_of(text):
    """A seed that follows from a text: Cycles' have 31 bits."""
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=4).digest(), "little") >> 1


def longest(cycles):
    """Samples of a half until the next pattern begins."""
    return LONGEST if hasattr(cycles, "use_sample_subset") else WITHOUT_PARTS


def choose(cycles, seed, sequence, point, length, stream=""):
    """Chooses samples of a sequence, from a point on; no more than are left of the pattern. Streams share no
    patterns."""
    pattern, offset = divmod(point, longest(cycles))
    cycles.seed = seed_of(f"{seed}{stream} {sequence} {pattern}")
    if hasattr(cycles, "use_sample_subset"):
        cycles.samples, cycles.use_sample_subset = LONGEST, True
        cycles.sample_offset, cycles.sample_subset_length = offset, length
    else:
        cycles.samples, cycles.sample_offset = length, offset


def adapt(cycles, seed, threshold, samples):
    """Chooses samples by Cycles' own noise threshold, and no more than so many a pixel; all else as the scene says."""
    cycles.use_adaptive_sampling, cycles.adaptive_threshold, cycles.samples = True, threshold, samples
    cycles.seed, cycles.use_animated_seed, cycles.use_denoising = seed, False, False
    cycles.use_layer_samples, cycles.sample_offset = "IGNORE", 0
    if hasattr(cycles, "use_sample_subset"):
        cycles.use_sample_subset = False
    # Tiles of Cycles' own would go through a file on disk
    cycles.use_auto_tile = False


def least(fewest, threshold, samples):
    """The fewest samples that Cycles takes of a pixel with these settings: pixels stop after whole steps of 16, the last sample
    of which has a number above `fewest`, of which 0 are as many as Cycles takes on its own. The first sample has number 0."""
    fewest = fewest or math.ceil(16 / threshold**0.3)
    return min(((fewest + 1) // 16 + 1) * 16, samples)


def half(first):
    """The fewest samples of each of two pictures that have as many together as one with `first` has, or up to 16 more; and what
    to set for it."""
    each = -(-first // 32) * 16
    return each, each - 2


def counts(shares, fewest, threshold, samples):
    """Samples of each pixel of a picture that was rendered with these settings, from the pass that has them as shares of the
    most: an array of the same shape, float32.

    Of how many, Cycles does not say."""
    import numpy

    first = least(fewest, threshold, samples)
    some = numpy.unique(shares[shares > 0])
    # The largest share but 1 is a whole number of steps of the most
    largest = some[some < 1].max(initial=0)
    steps = range(16, samples + 1, 16) if largest > 0 else []
    candidates = [round(step / float(largest)) for step in steps] or range(first, samples + 1)
    for most in candidates:
        if not first <= most <= samples:
            continue
        found = some.astype(numpy.float64) * most
        whole = found.round()
        in_steps = (whole % 16 == 0) | (whole == most)
        if in_steps.all() and (whole >= first).all() and numpy.abs(found - whole).max(initial=0) < 1e-3:
            return (shares * numpy.float32(most)).round()
    # A picture that was stopped
    return numpy.maximum(shares * numpy.float32(first), 1)


def aim(render, frame, region):
    """Confines renders to a region (x, y, width, height; y from the top) of a frame (width, height), both in
    pixels."""
    (across, down), (x, y, width, height) = frame, region
    bottom = down - y - height
    render.use_border = render.use_crop_to_border = True
    # Blender cuts edges down to whole pixels: a quarter keeps them clear of rounding
    render.border_min_x, render.border_max_x = (x + 0.25) / across, min(1.0, (x + width + 0.25) / across)
    render.border_min_y, render.border_max_y = (bottom + 0.25) / down, min(1.0, (bottom + height + 0.25) / down)
