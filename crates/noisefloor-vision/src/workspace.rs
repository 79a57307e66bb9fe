//! Memory for pictures of a size, used again for the next one.

use crate::masking::BLUR_RADIUS;
use crate::photometry::CHANNELS;
use crate::pyramid::Size;

/// Memory that a comparison needs. It grows to the largest picture it was used for: about 90 bytes a pixel in
/// colour, 40 without. One for each thread.
#[derive(Clone, Debug, Default)]
pub struct VisionWorkspace {
    /// Levels of the Gaussian pyramid, finest first: by picture (test, reference), channel, level.
    pub(crate) gauss: [[Vec<Vec<f32>>; CHANNELS]; 2],
    /// Visible differences: by channel, band.
    pub(crate) differences: [Vec<Vec<f32>>; CHANNELS],
    /// The smaller contrast of a band, blurred along rows: by channel.
    pub(crate) smaller: [Vec<f32>; CHANNELS],
    /// The map: by band.
    pub(crate) map: Vec<Vec<f32>>,
    pub(crate) rows: Rows,
}

/// Rows of the finest level.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    pub(crate) codes: Vec<[f32; 3]>,
    pub(crate) narrow: Vec<f32>,
    pub(crate) coarse: [[Vec<f32>; CHANNELS]; 2],
    pub(crate) places: Vec<f32>,
    pub(crate) sensitivity: Vec<f32>,
    pub(crate) padded: Vec<f32>,
}

/// Makes room for `length` numbers; what was there may remain.
pub(crate) fn reserve(plane: &mut Vec<f32>, length: usize) {
    if plane.len() < length {
        plane.resize(length, 0.0);
    }
}

impl VisionWorkspace {
    /// Makes room for two pictures: `channels` of them, by levels.
    pub(crate) fn fit(&mut self, sizes: &[Size], channels: usize) {
        let levels = |planes: &mut Vec<Vec<f32>>| {
            planes.resize_with(sizes.len().max(planes.len()), Vec::new);
            planes.iter_mut().zip(sizes).for_each(|(plane, size)| reserve(plane, size.area()));
        };
        self.gauss.iter_mut().flat_map(|channel| &mut channel[..channels]).for_each(levels);
        self.differences[..channels].iter_mut().for_each(levels);
        levels(&mut self.map);
        self.smaller[..channels].iter_mut().for_each(|plane| reserve(plane, sizes[0].area()));
        let width = sizes[0].width;
        let Rows { codes, narrow, coarse, places, sensitivity, padded } = &mut self.rows;
        if codes.len() < width {
            codes.resize(width, [0.0; 3]);
        }
        coarse.iter_mut().flatten().chain([places, sensitivity]).for_each(|row| reserve(row, width));
        reserve(narrow, width + 4);
        reserve(padded, width + 2 * BLUR_RADIUS);
    }
}
