//! A film in a file: what it knows of its tiles, and then its pixels, which memory need not hold twice.

use super::{Film, Half};
use crate::rgb::Rgb;
use crate::tile::TileGrid;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};

/// Pixels that room is made for at once.
const STEP: usize = 1 << 20;

/// All but the pixels.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct FilmHead {
    grid: TileGrid,
    /// For each half that is kept, whether rejected samples are counted by pixel.
    halves: Vec<bool>,
    counts: Vec<[u64; 2]>,
    rejected: u64,
}

#[cfg(test)]
impl FilmHead {
    pub(crate) fn announcing(grid: TileGrid) -> Self {
        Self { grid, halves: vec![true; 2], counts: Vec::new(), rejected: 0 }
    }
}

impl Film {
    pub(crate) fn head(&self) -> FilmHead {
        let halves = self.halves.iter().map(|half| !half.rejected.is_empty()).collect();
        FilmHead { grid: self.grid, halves, counts: self.counts.clone(), rejected: self.rejected }
    }

    /// Writes the pixels: for each half the means (three f32), the carries (three i16) and, if there are any, the
    /// rejected samples (u32), little-endian.
    pub(crate) fn write_pixels(&self, to: &mut dyn Write) -> io::Result<()> {
        for half in &self.halves {
            write(half.mean.as_flattened(), f32::to_le_bytes, to)?;
            write(half.carry.as_flattened(), i16::to_le_bytes, to)?;
            write(&half.rejected, u32::to_le_bytes, to)?;
        }
        Ok(())
    }

    /// Reads what [`Film::write_pixels`] wrote. Memory grows with what arrives. None if there cannot be such a film.
    pub(crate) fn read_pixels(head: FilmHead, from: &mut dyn Read) -> io::Result<Option<Self>> {
        let FilmHead { grid, halves, counts, rejected } = head;
        if TileGrid::new(grid.width(), grid.height(), grid.edge()).ok() != Some(grid) || halves.len() > 2 {
            return Ok(None);
        }
        let pixels = grid.width() * grid.height();
        let mut half = |counted: &bool| {
            let mean: Vec<Rgb> = read(pixels, |bytes: [u8; 12]| of_three(bytes, f32::from_le_bytes), from)?;
            let carry = read(pixels, |bytes: [u8; 6]| of_three(bytes, i16::from_le_bytes), from)?;
            let rejected = read(if *counted { pixels } else { 0 }, u32::from_le_bytes, from)?;
            Ok(Half { mean, carry, rejected })
        };
        let halves = halves.iter().map(&mut half).collect::<io::Result<_>>()?;
        Ok(Some(Self { grid, halves, counts, rejected, negative: 0 }))
    }
}

fn write<T: Copy, const BYTES: usize>(
    numbers: &[T],
    bytes: impl Fn(T) -> [u8; BYTES],
    to: &mut dyn Write,
) -> io::Result<()> {
    let mut buffer = Vec::new();
    for numbers in numbers.chunks(1 << 14) {
        buffer.clear();
        buffer.extend(numbers.iter().flat_map(|&number| bytes(number)));
        to.write_all(&buffer)?;
    }
    Ok(())
}

fn read<T, const BYTES: usize>(
    count: usize,
    of: impl Fn([u8; BYTES]) -> T,
    from: &mut dyn Read,
) -> io::Result<Vec<T>> {
    let (mut all, mut buffer) = (Vec::new(), vec![[0; BYTES]; 1 << 12]);
    while all.len() < count {
        let next = buffer.len().min(count - all.len());
        if all.len() == all.capacity() {
            all.reserve_exact(STEP.min(count - all.len()));
        }
        from.read_exact(buffer[..next].as_flattened_mut())?;
        all.extend(buffer[..next].iter().map(|&bytes| of(bytes)));
    }
    Ok(all)
}

/// Three numbers, one after another.
fn of_three<T, const BYTES: usize, const ONE: usize>(
    bytes: [u8; BYTES],
    of: impl Fn([u8; ONE]) -> T,
) -> [T; 3] {
    std::array::from_fn(|i| of(std::array::from_fn(|byte| bytes[i * ONE + byte])))
}
