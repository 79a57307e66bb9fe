//! Parts of a level of the pyramid.

use crate::pyramid::Size;
use std::ops::Range;

/// Columns and rows of a level that are worked on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) x: (usize, usize),
    pub(crate) y: (usize, usize),
}

impl Part {
    pub(crate) fn columns(self) -> Range<usize> {
        self.x.0..self.x.1
    }

    pub(crate) fn rows(self) -> Range<usize> {
        self.y.0..self.y.1
    }

    /// That part of a level 2^`band` times as coarse.
    pub(crate) fn at(self, band: usize) -> Self {
        let ends = |(from, to): (usize, usize)| (from >> band, to.div_ceil(1 << band));
        Self { x: ends(self.x), y: ends(self.y) }
    }

    /// With as many pixels more on each side, as far as there are any.
    pub(crate) fn wider(self, by: usize, size: Size) -> Self {
        let ends = |(from, to): (usize, usize), most: usize| (from.saturating_sub(by), (to + by).min(most));
        Self { x: ends(self.x, size.width), y: ends(self.y, size.height) }
    }

    /// Where it lies once its picture, of `size`, is turned by 180 degrees.
    pub(crate) fn turned(self, size: Size) -> Self {
        let ends = |(from, to): (usize, usize), most: usize| (most - to, most - from);
        Self { x: ends(self.x, size.width), y: ends(self.y, size.height) }
    }
}
