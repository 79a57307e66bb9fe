//! Bias that sits in few pixels: lines, as a denoiser leaves them that works in tiles, and dots.
//!
//! What two residuals have in common is averaged over squares of thousands of pixels, in which a line of 97 is lost. But a
//! line has one sign along itself, and its neighbours have not: the differences of the residuals across it, added up along
//! it, grow with the number of pixels, and those of noise with its root. They are held against what they are themselves,
//! Σd/√Σd², which exceeds z with p < exp(−z²/2) if d is as likely as −d (Hoeffding 1963), and d is the difference of two
//! pixels of one kind. All four have to exceed it with one sign: of both halves, and to both sides.

use crate::bands::mirrored;
use rayon::prelude::*;

/// Pixels of a line to each side of the one that is looked at: 97 in all.
const RADIUS: usize = 48;
/// How far beside a line its neighbours lie, so that a line of a few pixels is one.
const BESIDE: usize = 3;
/// Standard errors of each of the four sums: by chance with p < 4·10⁻⁵ for each place, as the halves are independent; far
/// less often for normal noise.
const CLEAR: f64 = 3.2;
/// A dot has no other pixels to be told by: residuals of both halves above so many times the noise around it.
const CLEAR_DOT: f32 = 8.0;
/// Pixels around a dot that tell of its noise, to each side.
const AROUND: isize = 2;

/// The bias of lines and dots, from the residuals of both halves, as far as `known` lacks it at each pixel, row-major.
pub(crate) fn thin_bias((width, height): (usize, usize), residuals: [&[f32]; 2], known: &[f32]) -> Vec<f32> {
    let turned = residuals.map(|plane| transposed((width, height), plane));
    let down = Lines {
        residuals: turned.each_ref().map(Vec::as_slice),
        known: Strided { plane: known, step: width, across: 1 },
        length: height,
        breadth: width,
    };
    let along = Lines {
        residuals,
        known: Strided { plane: known, step: 1, across: width },
        length: width,
        breadth: height,
    };
    let mut bias = vec![0.0f32; width * height];
    for lines in [down, along] {
        let found: Vec<Vec<(usize, f32)>> =
            (0..lines.breadth).into_par_iter().map(|at| lines.missing(at)).collect();
        for (at, line) in found.into_iter().enumerate() {
            for (place, found) in line {
                let bias: &mut f32 = &mut bias[lines.known.index(at, place)];
                // Where lines cross, one of them
                if found.abs() > bias.abs() {
                    *bias = found;
                }
            }
        }
    }
    let rows = bias.par_chunks_exact_mut(width).enumerate();
    rows.for_each(|(y, row)| {
        for (x, bias) in row.iter_mut().enumerate() {
            let dot = dot((width, height), residuals, (x, y));
            *bias += lacking(dot, known[y * width + x] + *bias);
        }
    });
    bias
}

/// What of a bias is not known yet.
fn lacking(bias: f32, known: f32) -> f32 {
    let missing = bias - known;
    if missing * bias > 0.0 { missing } else { 0.0 }
}

/// Columns as rows.
fn transposed((width, height): (usize, usize), plane: &[f32]) -> Vec<f32> {
    // As many rows as a line of the cache has numbers
    const AT_ONCE: usize = 16;
    let mut turned = vec![0.0; plane.len()];
    turned.par_chunks_mut(AT_ONCE * height).enumerate().for_each(|(n, columns)| {
        let from = n * AT_ONCE;
        for y in 0..height {
            let row = &plane[y * width + from..][..columns.len() / height];
            row.iter().enumerate().for_each(|(x, value)| columns[x * height + y] = *value);
        }
    });
    turned
}

/// A plane, with the steps from one pixel of a line to the next, and to that beside it.
#[derive(Clone, Copy)]
struct Strided<'a> {
    plane: &'a [f32],
    step: usize,
    across: usize,
}

impl Strided<'_> {
    fn index(&self, at: usize, place: usize) -> usize {
        at * self.across + place * self.step
    }
}

/// All rows of a picture, or all columns.
#[derive(Clone, Copy)]
struct Lines<'a> {
    /// Line after line.
    residuals: [&'a [f32]; 2],
    known: Strided<'a>,
    /// Pixels of each, and how many there are.
    length: usize,
    breadth: usize,
}

/// Sums up to each place of a line, and of squares.
struct Running(Vec<[f64; 2]>);

impl Running {
    fn of(values: impl Iterator<Item = f32>) -> Self {
        let mut sums = vec![[0.0; 2]];
        let mut last = [0.0f64; 2];
        for value in values.map(f64::from) {
            last = [last[0] + value, last[1] + value * value];
            sums.push(last);
        }
        Self(sums)
    }

    fn between(&self, from: usize, to: usize) -> [f64; 2] {
        [0, 1].map(|n| self.0[to][n] - self.0[from][n])
    }
}

impl Lines<'_> {
    fn line<'b>(&self, plane: &'b [f32], at: usize) -> &'b [f32] {
        &plane[at * self.length..][..self.length]
    }

    /// What is missing along one of them, whose residuals are not those of its neighbours to both sides: place by place.
    fn missing(&self, at: usize) -> Vec<(usize, f32)> {
        let beside = [-1, 1].map(|side| mirrored(at as isize + side * BESIDE as isize, self.breadth));
        let around = |place: usize| (place.saturating_sub(RADIUS), (place + RADIUS + 1).min(self.length));
        // Hardly a line is clear to one side, and few of these in all four ways
        let mut clear: Vec<usize> = (0..self.length).collect();
        let mut differences = Vec::with_capacity(4);
        for which in 0..4 {
            let (plane, beside) = (self.residuals[which % 2], beside[which / 2]);
            let pairs = self.line(plane, at).iter().zip(self.line(plane, beside));
            let sums = Running::of(pairs.map(|(own, other)| own - other));
            clear.retain(|&place| {
                let (from, to) = around(place);
                let [sum, squares] = sums.between(from, to);
                sum.abs() > CLEAR * squares.sqrt()
            });
            if clear.is_empty() {
                return Vec::new();
            }
            differences.push(sums);
        }
        let [a, b] = self.residuals.map(|plane| Running::of(self.line(plane, at).iter().copied()));
        let known = (0..self.length).map(|place| self.known.plane[self.known.index(at, place)]);
        let known = Running::of(known);
        let missing = |place: usize| {
            let (from, to) = around(place);
            let (mut beyond, mut signs) = (0.0, 0.0);
            for sums in &differences {
                let [sum, _] = sums.between(from, to);
                (beyond, signs) = (beyond + sum / 4.0, signs + sum.signum());
            }
            let own = (a.between(from, to)[0] + b.between(from, to)[0]) / 2.0;
            if f64::abs(signs) < 4.0 || own * beyond <= 0.0 {
                return None;
            }
            // Rare light that a line has not met is missing in all of it, and no bias
            let bias = own.abs().min(beyond.abs()).copysign(own) / (to - from) as f64;
            let known = (known.between(from, to)[0] / (to - from) as f64) as f32;
            Some((place, lacking(bias as f32, known)))
        };
        clear.into_iter().filter_map(missing).collect()
    }
}

/// The bias of one pixel, if both halves have it far beyond the noise around.
fn dot((width, height): (usize, usize), [a, b]: [&[f32]; 2], (x, y): (usize, usize)) -> f32 {
    let here = y * width + x;
    let (a_here, b_here) = (a[here], b[here]);
    let least = a_here.abs().min(b_here.abs());
    // Most are not even clear of what they differ by, which is quickly said
    if a_here * b_here <= 0.0 || least <= CLEAR_DOT * ((a_here - b_here).abs() / 2.0) {
        return 0.0;
    }
    let (mut energy, mut count) = (0.0, 0.0f32);
    for (dy, dx) in (-AROUND..=AROUND).flat_map(|dy| (-AROUND..=AROUND).map(move |dx| (dy, dx))) {
        if (dx, dy) != (0, 0) {
            let at = mirrored(y as isize + dy, height) * width + mirrored(x as isize + dx, width);
            // Each half by itself: what both have in common there makes a dot less clear
            energy += (a[at] * a[at] + b[at] * b[at]) / 2.0;
            count += 1.0;
        }
    }
    if least > CLEAR_DOT * (energy / count).sqrt() { (a_here + b_here) / 2.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;

    const SIZE: (usize, usize) = (128, 96);

    fn noise(seed: u64, of: impl Fn(&mut Noise) -> f64) -> Vec<f32> {
        let mut noise = Noise::new(seed);
        (0..SIZE.0 * SIZE.1).map(|_| of(&mut noise) as f32).collect()
    }

    /// Whatever the noise: normal, skewed as that of paths, or rare.
    #[test]
    fn noise_has_no_lines_and_no_dots() {
        let kinds: [fn(&mut Noise) -> f64; 3] = [
            |noise| noise.normal(),
            |noise| -noise.uniform().max(1e-12).ln() - 1.0,
            |noise| if noise.uniform() < 0.01 { 99.0 } else { -1.0 },
        ];
        for (number, kind) in kinds.into_iter().enumerate() {
            for seed in 0..20 {
                let [a, b] = [0, 1].map(|half| noise(1000 * number as u64 + 2 * seed + half, kind));
                let found = thin_bias(SIZE, [&a, &b], &vec![0.0; a.len()]);
                // Of 245,760 pixels of each kind; a rare sample in one pixel of both halves is a dot
                let clear = found.iter().filter(|bias| **bias != 0.0).count();
                assert!(clear <= if number == 2 { 6 } else { 0 }, "kind {number}, seed {seed}: {clear}");
            }
        }
    }

    #[test]
    fn lines_and_dots_are_found_where_they_are_and_as_high() {
        for (height, down) in [(1.0, true), (1.0, false), (-1.5, true)] {
            let line = |i: usize| if down { i % SIZE.0 == 37 } else { i / SIZE.0 == 37 };
            let [a, b] = [1, 2].map(|seed| {
                let mut residual = noise(seed, |noise| noise.normal());
                residual.iter_mut().enumerate().filter(|(i, _)| line(*i)).for_each(|(_, r)| *r += height);
                residual
            });
            let found = thin_bias(SIZE, [&a, &b], &vec![0.0; a.len()]);
            let on = found.iter().enumerate().filter(|(i, _)| line(*i)).map(|(_, bias)| *bias);
            let (sum, count) = on.fold((0.0, 0), |(sum, count), bias| (sum + bias, count + 1));
            assert!(
                (sum / count as f32 / height - 1.0).abs() < 0.3,
                "{height}, {down}: {}",
                sum / count as f32
            );
            let off = found.iter().enumerate().filter(|(i, bias)| !line(*i) && **bias != 0.0).count();
            assert!(off < 20, "{off}");
        }
        let mut dots = [5, 6].map(|seed| noise(seed, |noise| 0.1 * noise.normal()));
        dots.iter_mut().for_each(|half| half[40 * SIZE.0 + 9] += 2.0);
        let found = thin_bias(SIZE, dots.each_ref().map(Vec::as_slice), &vec![0.0; SIZE.0 * SIZE.1]);
        assert!((found[40 * SIZE.0 + 9] - 2.0).abs() < 0.3, "{}", found[40 * SIZE.0 + 9]);
        assert_eq!(found.iter().filter(|bias| **bias != 0.0).count(), 1);
    }

    /// Rows are looked at where they lie, and columns turned: a picture on its side has the same lines, on their side.
    #[test]
    fn a_picture_on_its_side_has_the_same_lines() {
        let turn = |plane: &[f32]| -> Vec<f32> {
            (0..plane.len()).map(|i| plane[i % SIZE.1 * SIZE.0 + i / SIZE.1]).collect()
        };
        let halves = [1, 2].map(|seed| {
            let mut residual = noise(seed, |noise| noise.normal());
            // One line each way, of one sign, and half of it known
            residual.iter_mut().enumerate().for_each(|(i, value)| {
                *value += if i % SIZE.0 == 37 { 1.0 } else { 0.0 };
                *value -= if i / SIZE.0 == 60 { 1.5 } else { 0.0 };
            });
            residual
        });
        let known: Vec<f32> =
            (0..halves[0].len()).map(|i| if i % SIZE.0 == 37 { 0.5 } else { 0.0 }).collect();
        let found = thin_bias(SIZE, halves.each_ref().map(Vec::as_slice), &known);
        assert!(found.iter().filter(|bias| **bias != 0.0).count() > 150);
        let turned = halves.each_ref().map(|half| turn(half));
        let other = thin_bias((SIZE.1, SIZE.0), turned.each_ref().map(Vec::as_slice), &turn(&known));
        // Where both cross, and are as high, that one counts that comes first
        let unlike = turn(&found).iter().zip(&other).filter(|(one, other)| one != other).count();
        assert_eq!(unlike, 0);
    }

    #[test]
    fn pictures_of_any_size_can_be_looked_at() {
        for size in [(1, 1), (1, 9), (9, 1), (2, 3)] {
            let flat = vec![0.5; size.0 * size.1];
            assert_eq!(thin_bias(size, [&flat, &flat], &flat).len(), flat.len());
        }
    }
}
