//! Gaussian pyramid of Burt and Adelson (1983), with the kernel (a = 0.4) and the borders of ColorVideoVDP
//! 0.5.7.

use multiversion::multiversion;

/// The kernel: outermost, next, centre.
const KERNEL: [f32; 3] = [0.05, 0.25, 0.4];

/// Columns and rows of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl Size {
    /// That of the next coarser level.
    pub(crate) fn half(self) -> Self {
        Self { width: self.width.div_ceil(2), height: self.height.div_ceil(2) }
    }

    pub(crate) fn area(self) -> usize {
        self.width * self.height
    }
}

/// The next coarser level of a plane of at least 2×2 pixels. `row` is room for a row and four pixels.
pub(crate) fn reduce(fine: &[f32], size: Size, row: &mut [f32], coarse: &mut [f32]) {
    let Size { width, height } = size;
    let half = size.half();
    // Rows beyond the border mirror those inside it
    let mirrored = |y: isize| {
        let y = if y < 0 { (-1 - y) as usize } else { y as usize };
        if y < height { y } else { 2 * height - 1 - y }
    };
    let row = &mut row[..width + 4];
    for (y, out) in coarse[..half.area()].chunks_exact_mut(half.width).enumerate() {
        let rows =
            std::array::from_fn(|i| &fine[mirrored(2 * y as isize + i as isize - 2) * width..][..width]);
        blend_rows(rows, &mut row[2..2 + width]);
        // Columns do, too; but at the right border ColorVideoVDP asks whether the number of rows is odd, not
        // that of columns
        let last = width + 1;
        (row[1], row[0]) = (row[2], row[3]);
        (row[last + 1], row[last + 2]) = (0.0, 0.0);
        match (width % 2 == 1, height % 2 == 1) {
            (true, true) => (row[last + 1], row[last + 2]) = (row[last], row[last - 1]),
            (false, false) => row[last + 1] = row[last],
            _ => {}
        }
        halve_row(row, out);
        let [outer, next, _] = KERNEL;
        match (width % 2 == 1, height % 2 == 1) {
            (true, false) => out[half.width - 1] += outer * row[last],
            (false, true) => out[half.width - 1] += next * row[last] + outer * row[last - 1],
            _ => {}
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn blend_rows([a, b, c, d, e]: [&[f32]; 5], out: &mut [f32]) {
    let n = out.len();
    let (a, b, c, d, e) = (&a[..n], &b[..n], &c[..n], &d[..n], &e[..n]);
    let [outer, next, centre] = KERNEL;
    for x in 0..n {
        out[x] = outer * (a[x] + e[x]) + next * (b[x] + d[x]) + centre * c[x];
    }
}

/// Every other pixel of a row with two pixels of border at each end.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn halve_row(row: &[f32], out: &mut [f32]) {
    let [outer, next, centre] = KERNEL;
    let around = row.chunks_exact(2).zip(row[2..].chunks_exact(2)).zip(row[4..].chunks(2));
    for (out, ((before, here), after)) in out.iter_mut().zip(around) {
        *out = outer * (before[0] + after[0]) + next * (before[1] + here[1]) + centre * here[0];
    }
}

/// Row `y` of a plane of `size`, interpolated from the next coarser level. Pixels beyond the border repeat
/// it. `row` is room for as many pixels as the coarser level has columns, and two.
pub(crate) fn expand_row(coarse: &[f32], size: Size, y: usize, row: &mut [f32], out: &mut [f32]) {
    let half = size.half();
    let row_of = |y: usize| &coarse[y.min(half.height - 1) * half.width..][..half.width];
    let row = &mut row[..half.width + 2];
    let (middle, inner) = (y / 2, 1..=half.width);
    if y.is_multiple_of(2) {
        weigh_rows([row_of(middle.saturating_sub(1)), row_of(middle), row_of(middle + 1)], &mut row[inner]);
    } else {
        average_rows([row_of(middle), row_of(middle + 1)], &mut row[inner]);
    }
    row[0] = row[1];
    row[half.width + 1] = row[half.width];
    double_row(row, &mut out[..size.width]);
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn weigh_rows([a, b, c]: [&[f32]; 3], out: &mut [f32]) {
    let n = out.len();
    let (a, b, c) = (&a[..n], &b[..n], &c[..n]);
    for x in 0..n {
        out[x] = 2.0 * KERNEL[0] * (a[x] + c[x]) + 2.0 * KERNEL[2] * b[x];
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn average_rows([a, b]: [&[f32]; 2], out: &mut [f32]) {
    let n = out.len();
    let (a, b) = (&a[..n], &b[..n]);
    for x in 0..n {
        out[x] = 2.0 * KERNEL[1] * (a[x] + b[x]);
    }
}

/// Two pixels for every one of a row with one pixel of border at each end.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn double_row(row: &[f32], out: &mut [f32]) {
    let pairs = out.len() / 2;
    let (before, here, after) = (&row[..pairs], &row[1..1 + pairs], &row[2..2 + pairs]);
    for (x, out) in out.chunks_exact_mut(2).enumerate() {
        out[0] = 2.0 * KERNEL[0] * (before[x] + after[x]) + 2.0 * KERNEL[2] * here[x];
        out[1] = 2.0 * KERNEL[1] * (here[x] + after[x]);
    }
    if out.len() % 2 == 1 {
        out[2 * pairs] = 2.0 * KERNEL[0] * (row[pairs] + row[pairs + 2]) + 2.0 * KERNEL[2] * row[pairs + 1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn reduced(plane: &[f32], size: Size) -> Vec<f32> {
        let mut coarse = vec![0.0; size.half().area()];
        reduce(plane, size, &mut vec![0.0; size.width + 4], &mut coarse);
        coarse
    }

    fn expanded(coarse: &[f32], size: Size) -> Vec<f32> {
        let mut fine = vec![0.0; size.area()];
        for (y, row) in fine.chunks_exact_mut(size.width).enumerate() {
            expand_row(coarse, size, y, &mut vec![0.0; size.width + 4], row);
        }
        fine
    }

    #[test]
    fn an_impulse_gives_the_kernel() {
        let size = Size { width: 9, height: 9 };
        let mut plane = vec![0.0; 81];
        plane[4 * 9 + 4] = 1.0;
        let coarse = reduced(&plane, size);
        for (place, weight) in
            [(2 * 5 + 2, 0.4 * 0.4), (2 * 5 + 1, 0.4 * 0.05), (5 + 1, 0.05 * 0.05), (0, 0.0)]
        {
            assert!((coarse[place] - weight).abs() < 1e-7, "{place}");
        }
        let mut coarse = vec![0.0; 25];
        coarse[2 * 5 + 2] = 1.0;
        let fine = expanded(&coarse, size);
        for (place, weight) in [(4 * 9 + 4, 0.64), (4 * 9 + 5, 0.4), (5 * 9 + 5, 0.25), (4 * 9 + 6, 0.08)] {
            assert!((fine[place] - weight).abs() < 1e-6, "{place}");
        }
    }

    proptest! {
        // Sides are both odd or both even: with mixed ones, the right border is as ColorVideoVDP has it
        #[test]
        fn uniform_planes_stay_uniform(
            (width, height) in (1usize..40, 1usize..40), odd in 0usize..2, value in -5.0f32..5.0,
        ) {
            let size = Size { width: 2 * width + odd, height: 2 * height + odd };
            let coarse = reduced(&vec![value; size.area()], size);
            prop_assert!(coarse.iter().all(|v| (v - value).abs() < 1e-5));
            prop_assert!(expanded(&coarse, size).iter().all(|v| (v - value).abs() < 1e-5));
        }
    }
}
