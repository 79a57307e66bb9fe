"""Which samples Cycles takes. The host of noisefloor-cycles and the add-on share this file, so that both
take the same.

Samples come in blocks of 16, each block a pattern of its own: the first 16 points of Cycles' Sobol table,
scrambled by a seed that follows from the block. Sample k of a pixel thereby follows from seed, pixel and k,
however requests are cut, and batches of whole blocks are independent. Successive subsets of one long
pattern, which Cycles offers too, are not: each fills the gaps of those before, so that halves made of them
differ by more than the error of their mean.
"""

import hashlib

# Samples of a block. Longer patterns have less noise at edges of lamps, and nowhere else; they would have to
# be cut more often
BLOCK = 16


def independent(cycles):
    """Makes samples independent from pixel to pixel and from block to block. cycles: the Cycles settings of
    a scene."""
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


def choose(cycles, seed, block, offset=0, length=BLOCK, stream=""):
    """Chooses samples of a block. Streams share no patterns."""
    digest = hashlib.blake2b(f"{seed}{stream} {block}".encode(), digest_size=4).digest()
    cycles.seed = int.from_bytes(digest, "little") >> 1
    if hasattr(cycles, "use_sample_subset"):
        cycles.samples, cycles.use_sample_subset = BLOCK, True
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
