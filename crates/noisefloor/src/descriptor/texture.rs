//! How much texture a tile has, beside its noise: which tiles a model has been tried on is told by it.

use super::mask::mask_row;
use crate::descriptor::NoiseMask;
use crate::evidence::{HALO, Plane, TilePlanes};
use crate::rgb::ROUNDING_LUMINANCE;
use std::cell::RefCell;

/// Scales: full, half, quarter and eighth resolution.
const SCALES: usize = 4;
/// Edge of a block at full resolution, in pixels; the halo is one block.
const BLOCK: usize = HALO;
/// Times the noise that is taken off the mask energy of the picture: what remains is texture for certain.
const CERTAIN: f32 = 2.0;
/// Floor in squared 8-bit steps, under the logarithm.
const FLOOR: f32 = 4.0;
/// Energies are in squared steps of 8-bit display values.
const STEP: f32 = 1.0 / 255.0;

/// Mask energies of the noise and of the picture on the grid of 8×8-pixel blocks, row-major, in squared 8-bit steps;
/// and buffers for what they are made from. Each thread keeps its own, so that a verdict allocates nothing.
#[derive(Default)]
struct Blocks {
    noise: [Vec<f32>; SCALES],
    picture: [Vec<f32>; SCALES],
    buffers: Buffers,
}

thread_local! {
    static BLOCKS: RefCell<Blocks> = RefCell::default();
}

/// Half the logarithm of the texture energy of a tile: of what the masks of its picture have more than noise, summed
/// over scales, as a mean over its blocks.
pub(super) fn texture_energy(planes: &TilePlanes, mask: NoiseMask) -> f32 {
    BLOCKS.with_borrow_mut(|Blocks { noise, picture, buffers }| {
        let (width, residual) = level(&planes.residual);
        let (_, image) = level(&planes.image);
        energies(width, residual, mask, planes.rounding * ROUNDING_LUMINANCE, noise, buffers);
        energies(width, image, mask, 0.0, picture, buffers);
        let count = noise[0].len();
        let texture: f32 = (0..count)
            .map(|at| {
                let of_scale = |s: usize| (picture[s][at] - CERTAIN * noise[s][at]).max(0.0);
                (0..SCALES).map(of_scale).sum::<f32>()
            })
            .sum();
        0.5 * (texture / count as f32 + FLOOR).ln()
    })
}

/// Buffers for the rows and levels on the way to energies on blocks.
#[derive(Default)]
struct Buffers {
    levels: [Vec<f32>; SCALES - 1],
    column: Vec<f32>,
    row: Vec<f32>,
    sums: Vec<f32>,
    rough: Vec<f32>,
}

/// The width of a plane, and its pixels, row-major.
fn level(plane: &Plane) -> (usize, &[f32]) {
    (plane.size().1, plane.values())
}

/// Mask energies of a plane with halo at full, half, quarter and eighth resolution, each on the grid of
/// 8×8-pixel blocks, in squared 8-bit steps; `rounding` is the known variance of white rounding noise in the
/// plane, which is taken off.
fn energies(
    width: usize,
    plane: &[f32],
    mask: NoiseMask,
    rounding: f32,
    out: &mut [Vec<f32>; SCALES],
    buffers: &mut Buffers,
) {
    let Buffers { levels, column, row, sums, rough } = buffers;
    let [half, quarter, eighth] = levels;
    halve(width, plane, half);
    halve(width / 2, half, quarter);
    halve(width / 4, quarter, eighth);
    column.resize(width, 0.0);
    row.resize(width, 0.0);
    let weights = mask.weights();
    for (scale, (level, out)) in [plane, half, quarter, eighth].into_iter().zip(out).enumerate() {
        let (width, edge) = (width >> scale, BLOCK >> scale);
        let row = &mut row[..width];
        block_means([width, level.len() / width], edge, sums, rough, |y, sums| {
            // The halo is not summed: there are rows above and below
            let around = [y - 1, y, y + 1].map(|y| &level[y * width..(y + 1) * width]);
            mask_row(weights, around, column, row);
            sums.iter_mut().zip(&*row).for_each(|(sum, &value)| *sum += value * value);
        });
        let known = mask.white_noise_gain() * rounding / (1 << (2 * scale)) as f32;
        rough.iter_mut().for_each(|e| *e = (*e - known).max(0.0) / (STEP * STEP));
        smooth(width / edge - 2, rough, out);
    }
}

/// Means of 2×2 pixels.
fn halve(width: usize, plane: &[f32], out: &mut Vec<f32>) {
    out.clear();
    for rows in plane.chunks_exact(2 * width) {
        let (above, below) = rows.split_at(width);
        let pairs = above.as_chunks().0.iter().zip(below.as_chunks().0);
        out.extend(pairs.map(|([a, b], [c, d])| 0.25 * (a + b + c + d)));
    }
}

/// Means over blocks of `edge`×`edge` pixels of a plane of [width, height], without the halo, which is one
/// block wide; `add(y, sums)` adds row `y` to sums along columns.
fn block_means(
    [width, height]: [usize; 2],
    edge: usize,
    sums: &mut Vec<f32>,
    out: &mut Vec<f32>,
    mut add: impl FnMut(usize, &mut [f32]),
) {
    out.clear();
    for block in 1..height / edge - 1 {
        sums.clear();
        sums.resize(width, 0.0);
        (block * edge..(block + 1) * edge).for_each(|y| add(y, sums));
        let blocks = sums.chunks_exact(edge).skip(1).take(width / edge - 2);
        out.extend(blocks.map(|block| block.iter().sum::<f32>() / (edge * edge) as f32));
    }
}

/// Binomial smoothing 1-2-1 over the grid of blocks, both ways; the edge repeats.
fn smooth(columns: usize, blocks: &[f32], out: &mut Vec<f32>) {
    let rows = blocks.len() / columns;
    let along = |before: f32, here: f32, after: f32| 0.25 * (before + 2.0 * here + after);
    out.clear();
    for y in 0..rows {
        let [above, here, below] = [y.saturating_sub(1), y, (y + 1).min(rows - 1)].map(|y| y * columns);
        let down = |x: usize| along(blocks[above + x], blocks[here + x], blocks[below + x]);
        out.extend(
            (0..columns).map(|x| along(down(x.saturating_sub(1)), down(x), down((x + 1).min(columns - 1)))),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tile::TileGrid;
    use noisefloor_testkit::Noise;

    fn tile(picture: impl Fn(usize, usize) -> f32, noise: f32) -> f32 {
        let grid = TileGrid::new(64, 64, 64).unwrap();
        let mut random = Noise::new(11);
        let values: Vec<f32> = (0..64 * 64).map(|_| noise * random.normal() as f32).collect();
        let planes = TilePlanes::gather((64, 64), grid.tile(0), |x, y| {
            let noise = values[y * 64 + x];
            ([picture(x, y) + noise; 3], [noise; 3])
        });
        texture_energy(&planes, NoiseMask::default())
    }

    /// Columns of 0.4 and 0.6 in turn: a mask of σ = 1 over three pixels, with the weights g, 1 − 2g, g, leaves
    /// 2g·0.2 of each, up and down; means of 2×2 pixels are grey.
    #[test]
    fn texture_is_what_the_mask_leaves_of_stripes_and_noise_is_none() {
        let stripes = |x: usize, _| if x.is_multiple_of(2) { 0.4 } else { 0.6 };
        let side = (-0.5f32).exp();
        let g = side / (1.0 + 2.0 * side);
        let left = (2.0 * g * 0.2 / STEP).powi(2);
        // The picture mirrored at its edge repeats the stripes
        let expected = 0.5 * (left + FLOOR).ln();
        assert!((tile(stripes, 0.0) - expected).abs() < 1e-3, "{} {expected}", tile(stripes, 0.0));
        // Noise hides a little of it, and makes none
        assert!(tile(stripes, 0.01) <= expected + 0.05);
        assert!((tile(|_, _| 0.5, 0.0) - 0.5 * FLOOR.ln()).abs() < 1e-6);
        assert!(tile(|_, _| 0.5, 0.05) < 0.5 * FLOOR.ln() + 1.0);
    }
}
