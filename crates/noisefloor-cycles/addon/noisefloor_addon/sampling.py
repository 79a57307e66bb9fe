"""Which samples Cycles takes. The host of noisefloor-cycles and the add-on share this file, so that both
take the same.

Each of the two halves of a tile's samples is one pattern of Cycles' Sobol table, scrambled by a seed that
follows from the number of the half: sample k of a half thereby follows from seed, pixel, half and k, however
requests are cut. The noise of two halves is hardly correlated (-0.04 in the Cornell box); that of successive
subsets of one pattern is, since each fills the gaps of those before.
"""

import hashlib

# Points of Cycles' table; a pattern of its own follows. Older versions of Blender render no part of a longer one
LONGEST, WITHOUT_PARTS = 8192, 16
# Samples of a call: each costs Cycles a start
BATCH = 16


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


def longest(cycles):
    """Samples of a half until the next pattern begins."""
    return LONGEST if hasattr(cycles, "use_sample_subset") else WITHOUT_PARTS


def choose(cycles, seed, sequence, point, length, stream=""):
    """Chooses samples of a sequence, from a point on; no more than are left of the pattern. Streams share no
    patterns."""
    pattern, offset = divmod(point, longest(cycles))
    digest = hashlib.blake2b(f"{seed}{stream} {sequence} {pattern}".encode(), digest_size=4).digest()
    cycles.seed = int.from_bytes(digest, "little") >> 1
    if hasattr(cycles, "use_sample_subset"):
        cycles.samples, cycles.use_sample_subset = LONGEST, True
        cycles.sample_offset, cycles.sample_subset_length = offset, length
    else:
        cycles.samples, cycles.sample_offset = length, offset


def aim(render, frame, region):
    """Confines renders to a region (x, y, width, height; y from the top) of a frame (width, height), both in
    pixels."""
    (across, down), (x, y, width, height) = frame, region
    bottom = down - y - height
    render.use_border = render.use_crop_to_border = True
    # Blender cuts edges down to whole pixels: a quarter keeps them clear of rounding
    render.border_min_x, render.border_max_x = (x + 0.25) / across, min(1.0, (x + width + 0.25) / across)
    render.border_min_y, render.border_max_y = (
        (bottom + 0.25) / down,
        min(1.0, (bottom + height + 0.25) / down),
    )
