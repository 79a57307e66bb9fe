//! Loops over the pixels of a row, in groups that vector instructions take at once.
//!
//! The coarser levels of a tile have rows of 40, 20 and 10 pixels. A plain loop leaves most of such a row to the
//! scalar code that compilers put behind their vector loop; here, the last group overlaps the one before it, or is
//! filled up with zeros. A pixel hangs on nothing beside it, so its bits are those of a plain loop.

/// Pixels of a group: as many as the widest vectors hold.
pub(crate) const LANES: usize = 16;

/// Pixels of the rows that are worked on together, where a row has no more: few enough to stay in the nearest caches.
/// Each step of the work is a loop, which the processor needs some time to begin and to end.
pub(crate) const STRIP: usize = 1024;

type Group = [f32; LANES];

/// Makes each pixel of rows of one length from those above it in others, which are at least as long.
///
/// Inlined, so that it is compiled for the vector instructions of whoever calls it.
#[inline(always)]
pub(crate) fn map_rows<const N: usize, const M: usize>(
    rows: [&[f32]; N],
    out: [&mut [f32]; M],
    pixel: impl Fn([f32; N]) -> [f32; M],
) {
    let mut out = out;
    let n = out[0].len();
    // Loops here and below, where `map` would not be compiled for the processor's vector instructions
    let mut from = 0;
    while from + LANES <= n {
        group_at(&rows, &mut out, from, &pixel);
        from += LANES;
    }
    if from == n {
        return;
    }
    if n >= LANES {
        return group_at(&rows, &mut out, n - LANES, &pixel);
    }
    let (mut given, mut made) = ([[0.0; LANES]; N], [[0.0; LANES]; M]);
    for (given, row) in given.iter_mut().zip(&rows) {
        given[..n].copy_from_slice(&row[..n]);
    }
    for i in 0..LANES {
        let mut values = [0.0; N];
        for (value, given) in values.iter_mut().zip(&given) {
            *value = given[i];
        }
        for (made, value) in made.iter_mut().zip(pixel(values)) {
            made[i] = value;
        }
    }
    for (out, made) in out.iter_mut().zip(&made) {
        out.copy_from_slice(&made[..n]);
    }
}

/// The pixels of one whole group.
#[inline(always)]
fn group_at<const N: usize, const M: usize>(
    rows: &[&[f32]; N],
    out: &mut [&mut [f32]; M],
    from: usize,
    pixel: &impl Fn([f32; N]) -> [f32; M],
) {
    let mut given: [&Group; N] = [&[0.0; LANES]; N];
    for (given, row) in given.iter_mut().zip(rows) {
        *given = row[from..from + LANES].try_into().expect("a group");
    }
    let mut made = [[0.0; LANES]; M];
    for i in 0..LANES {
        let mut values = [0.0; N];
        for (value, given) in values.iter_mut().zip(&given) {
            *value = given[i];
        }
        for (made, value) in made.iter_mut().zip(pixel(values)) {
            made[i] = value;
        }
    }
    for (out, made) in out.iter_mut().zip(&made) {
        out[from..from + LANES].copy_from_slice(made);
    }
}

/// Replaces each pixel of a row by what is made of it.
#[inline(always)]
pub(crate) fn change_row(row: &mut [f32], pixel: impl Fn(f32) -> f32) {
    let (groups, rest) = row.as_chunks_mut::<LANES>();
    for group in groups {
        for value in group {
            *value = pixel(*value);
        }
    }
    if rest.is_empty() {
        return;
    }
    let mut filled = [0.0; LANES];
    filled[..rest.len()].copy_from_slice(rest);
    for value in &mut filled {
        *value = pixel(*value);
    }
    rest.copy_from_slice(&filled[..rest.len()]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_any_length_are_made_pixel_by_pixel() {
        for n in 0..70 {
            let a: Vec<f32> = (0..n).map(|i| 0.1 + i as f32).collect();
            let b: Vec<f32> = (0..n + 3).map(|i| 0.3 * i as f32).collect();
            let (mut sum, mut product) = (vec![0.0; n], vec![0.0; n]);
            map_rows([&a, &b], [&mut sum, &mut product], |[a, b]| [a + b, a * b]);
            let mut changed = a.clone();
            change_row(&mut changed, |a| a * a);
            for i in 0..n {
                assert_eq!(
                    (sum[i], product[i], changed[i]),
                    (a[i] + b[i], a[i] * b[i], a[i] * a[i]),
                    "{i} of {n}"
                );
            }
        }
    }
}
