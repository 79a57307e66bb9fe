//! Memory for pictures of a size, used again for the next one.

use crate::lanes::STRIP;
use crate::masking::{BLUR_RADIUS, MaskScratch};
use crate::photometry::CHANNELS;
use crate::pyramid::Size;
use crate::temporal::{ALL_CHANNELS, TRANSIENT};
use std::ops::Deref;

/// Memory that a comparison needs. It grows to the largest picture it was used for: about 90 bytes a pixel in
/// colour, 40 without; 25 more for frames of films. One for each thread.
#[derive(Clone, Debug, Default)]
pub struct VisionWorkspace {
    /// Levels of the Gaussian pyramid, finest first: by picture (test, reference), channel, level.
    pub(crate) gauss: [[Vec<Vec<f32>>; CHANNELS]; 2],
    /// In a film, levels of the transient channel of the test picture; that of the reference is zero.
    pub(crate) flicker: Vec<Vec<f32>>,
    /// In a film, what is the same in every frame: by channel.
    pub(crate) standing: [Vec<f32>; CHANNELS],
    /// Visible differences: by channel, band.
    pub(crate) differences: [Vec<Vec<f32>>; ALL_CHANNELS],
    /// The smaller contrast of a band, blurred along rows: by channel.
    pub(crate) smaller: [Vec<f32>; CHANNELS],
    /// The map: by band.
    pub(crate) map: Vec<Vec<f32>>,
    /// The map without its finest band, while that of the turned picture is drawn.
    pub(crate) upright: Vec<f32>,
    pub(crate) strip: Strip,
}

/// Sizes of the levels of a pyramid, finest first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    all: [Size; MOST_LEVELS],
    levels: usize,
}

/// More than the largest pictures have.
const MOST_LEVELS: usize = 32;

impl Sizes {
    pub(crate) fn new(size: Size, levels: usize) -> Self {
        let mut all = [size; MOST_LEVELS];
        for level in 1..levels {
            all[level] = all[level - 1].half();
        }
        Self { all, levels }
    }
}

impl Deref for Sizes {
    type Target = [Size];

    fn deref(&self) -> &[Size] {
        &self.all[..self.levels]
    }
}

/// Rows that are worked on together.
#[derive(Clone, Debug, Default)]
pub(crate) struct Strip {
    pub(crate) coarse: [[Vec<f32>; CHANNELS]; 2],
    pub(crate) flicker: Vec<f32>,
    pub(crate) mean: Vec<f32>,
    pub(crate) places: Vec<f32>,
    pub(crate) sensitivity: Vec<f32>,
    pub(crate) sharp: Vec<f32>,
    pub(crate) mask: Box<MaskScratch>,
    /// Single rows.
    pub(crate) codes: Vec<[f32; 3]>,
    pub(crate) narrow: Vec<f32>,
    pub(crate) padded: Vec<f32>,
}

/// Makes room for `length` numbers; what was there may remain.
pub(crate) fn reserve(plane: &mut Vec<f32>, length: usize) {
    if plane.len() < length {
        plane.resize(length, 0.0);
    }
}

impl VisionWorkspace {
    /// Makes room for two pictures of `size` in this many channels of a still, and levels; returns their sizes.
    pub(crate) fn fit(&mut self, size: Size, levels: usize, channels: usize, film: bool) -> Sizes {
        let sizes = Sizes::new(size, levels);
        let levels = |planes: &mut Vec<Vec<f32>>| {
            planes.resize_with(sizes.len().max(planes.len()), Vec::new);
            planes.iter_mut().zip(&*sizes).for_each(|(plane, size): (_, &Size)| reserve(plane, size.area()));
        };
        self.gauss.iter_mut().flat_map(|channel| &mut channel[..channels]).for_each(levels);
        self.differences[..channels].iter_mut().for_each(levels);
        levels(&mut self.map);
        reserve(&mut self.upright, size.half().area());
        if film {
            [&mut self.flicker, &mut self.differences[TRANSIENT]].into_iter().for_each(levels);
            self.standing[..channels].iter_mut().for_each(|plane| reserve(plane, size.area()));
        }
        self.smaller[..channels].iter_mut().for_each(|plane| reserve(plane, size.area()));
        let width = size.width;
        let Strip { codes, narrow, coarse, flicker, mean, places, sensitivity, sharp, padded, .. } =
            &mut self.strip;
        if codes.len() < width {
            codes.resize(width, [0.0; 3]);
        }
        coarse
            .iter_mut()
            .flatten()
            .chain([flicker, mean, places, sensitivity, sharp])
            .for_each(|rows| reserve(rows, width.max(STRIP)));
        reserve(narrow, width + 4);
        reserve(padded, width + 2 * BLUR_RADIUS);
        sizes
    }
}
