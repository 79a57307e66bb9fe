//! Cutting surfaces in two, so that rays meet few of them: the surface area heuristic, by bins (Wald 2007, "On fast
//! Construction of SAH-based Bounding Volume Hierarchies").

use super::aabb::Aabb;
use crate::math::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// What a tree is built over.
pub(super) trait Bounded: Copy + Send + Sync {
    fn bounds(&self) -> Aabb;
}

/// Places along an axis where surfaces may be cut, and one.
const BINS: usize = 32;
/// From so many on, surfaces are looked at in parallel, in chunks of this.
const CHUNK: usize = 1 << 15;
/// After so many cuts, surfaces are halved. No mesh comes near, and it bounds the depth where each cut would take off
/// one of a million.
const CUTS: u32 = 128;

/// Some of the surfaces of a tree.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) range: Range<usize>,
    pub(super) bounds: Aabb,
    /// A box around twice their middles.
    centres: Aabb,
    /// By how many cuts they were made.
    cuts: u32,
}

/// The surfaces of one bin.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    count: usize,
}

const NONE: Bin = Bin { bounds: Aabb::EMPTY, count: 0 };

impl Bin {
    fn plus(self, other: Self) -> Self {
        Self { bounds: self.bounds.union(&other.bounds), count: self.count + other.count }
    }
}

/// Bins along each axis.
type Bins = [[Bin; BINS]; 3];

/// Says in which bins a middle is.
struct Scale {
    low: Vec3,
    scale: Vec3,
}

impl Scale {
    fn new(centres: &Aabb) -> Self {
        Self { low: centres.min, scale: Vec3::splat(BINS as f32) / (centres.max - centres.min) }
    }

    /// The bin along each axis. Along one on which all middles are the same, it is the first.
    fn bins(&self, centre2: Vec3) -> [usize; 3] {
        // NaN becomes 0
        ((centre2 - self.low) * self.scale).to_array().map(|x| (x as usize).min(BINS - 1))
    }
}

impl Part {
    pub(super) fn all(surfaces: &[impl Bounded]) -> Self {
        let mut part = Self { range: 0..surfaces.len(), bounds: Aabb::EMPTY, centres: Aabb::EMPTY, cuts: 0 };
        let boxes = |surfaces: &[_]| {
            surfaces.iter().fold([Aabb::EMPTY; 2], |[bounds, centres], surface: &_| {
                let own = Bounded::bounds(surface);
                [bounds.union(&own), centres.with(own.centre2())]
            })
        };
        let both = |a: [Aabb; 2], b: [Aabb; 2]| [a[0].union(&b[0]), a[1].union(&b[1])];
        [part.bounds, part.centres] = if surfaces.len() < CHUNK {
            boxes(surfaces)
        } else {
            surfaces.par_chunks(CHUNK).map(boxes).reduce(|| [Aabb::EMPTY; 2], both)
        };
        part
    }

    /// The same part with surfaces counted from another one on.
    pub(super) fn from(mut self, start: usize) -> Self {
        self.range = start..start + self.range.len();
        self
    }

    fn none(&self) -> Self {
        Self { range: 0..0, bounds: Aabb::EMPTY, centres: Aabb::EMPTY, cuts: self.cuts + 1 }
    }

    fn add(&mut self, bounds: &Aabb) {
        self.bounds = self.bounds.union(bounds);
        self.centres = self.centres.with(bounds.centre2());
    }

    /// Cuts the part, which has more than one surface, in two that have some. Leaves take up to `most`, and cost the
    /// same however many they have. The order of surfaces changes.
    pub(super) fn cut<T: Bounded>(&self, surfaces: &mut [T], most: usize) -> [Self; 2] {
        let own = &mut surfaces[self.range.clone()];
        let scale = Scale::new(&self.centres);
        let best = if self.cuts < CUTS { cheapest(&bins(own, &scale), most) } else { None };
        let [mut low, mut high] = [self.none(), self.none()];
        let middle = if let Some((axis, at)) = best {
            let (mut next, mut end) = (0, own.len());
            while next < end {
                let bounds = own[next].bounds();
                if scale.bins(bounds.centre2())[axis] < at {
                    low.add(&bounds);
                    next += 1;
                } else {
                    high.add(&bounds);
                    end -= 1;
                    own.swap(next, end);
                }
            }
            next
        } else {
            let (half, axis) = (own.len() / 2, (self.centres.max - self.centres.min).max_position());
            let middle = |surface: &T| surface.bounds().centre2()[axis];
            own.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
            own[..half].iter().for_each(|surface| low.add(&surface.bounds()));
            own[half..].iter().for_each(|surface| high.add(&surface.bounds()));
            half
        };
        low.range = self.range.start..self.range.start + middle;
        high.range = low.range.end..self.range.end;
        [low, high]
    }
}

fn bins<T: Bounded>(surfaces: &[T], scale: &Scale) -> Bins {
    let bins = |surfaces: &[T]| {
        let mut bins = [[NONE; BINS]; 3];
        for surface in surfaces {
            let bounds = surface.bounds();
            for (bins, bin) in bins.iter_mut().zip(scale.bins(bounds.centre2())) {
                bins[bin] = bins[bin].plus(Bin { bounds, count: 1 });
            }
        }
        bins
    };
    if surfaces.len() < CHUNK {
        return bins(surfaces);
    }
    // Sums of counts and boxes of boxes are exact: chunks and their order leave no trace
    let both = |mut a: Bins, b: Bins| {
        a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(a, b)| *a = a.plus(*b));
        a
    };
    surfaces.par_chunks(CHUNK).map(bins).reduce(|| [[NONE; BINS]; 3], both)
}

/// The axis and the bin before which a cut costs least; none if all surfaces are in one bin.
fn cheapest(bins: &Bins, most: usize) -> Option<(usize, usize)> {
    let cost = |bin: &Bin| bin.bounds.half_area() * bin.count.div_ceil(most) as f32;
    let mut best = (f32::INFINITY, None);
    for (axis, bins) in bins.iter().enumerate() {
        // What lies from a bin on
        let mut rest = [0.0; BINS];
        let mut high = NONE;
        for at in (1..BINS).rev() {
            high = high.plus(bins[at]);
            rest[at] = if high.count == 0 { f32::INFINITY } else { cost(&high) };
        }
        let mut low = NONE;
        for at in 1..BINS {
            low = low.plus(bins[at - 1]);
            if low.count > 0 && cost(&low) + rest[at] < best.0 {
                best = (cost(&low) + rest[at], Some((axis, at)));
            }
        }
    }
    best.1
}
