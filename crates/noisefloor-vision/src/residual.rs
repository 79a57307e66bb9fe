//! How visible a residual is on its picture, in a part of that picture: what a stopping rule asks of every
//! tile.

use crate::check::{check_values, checked};
use crate::csf::OpponentChannel;
use crate::engine::{Adapted, Engine, build, collapse};
use crate::error::VisionError;
use crate::masking::{BLUR_RADIUS, EXPONENT, LARGEST, Masking, grown};
use crate::model::VisionModel;
use crate::part::Part;
use crate::photometry::{CHANNELS, keep_greys};
use crate::pooling::{STILL, across_row, energy_row};
use crate::pyramid::{Size, expand_row};
use crate::temporal::TRANSIENT;
use crate::workspace::{Sizes, VisionWorkspace};
use std::ops::Range;

/// Two pictures that are compared, as what lies in the middle between them and what one has more than the other; code
/// values of the display, row by row. Neither is the right one: differences are the same for −`residual`, to the bit.
#[derive(Clone, Copy, Debug)]
pub enum ResidualPixels<'a> {
    /// In colour: a plane for each of red, green and blue.
    Rgb {
        /// The middle.
        picture: [&'a [f32]; 3],
        /// With half of it added and taken away, the middle makes the two pictures.
        residual: [&'a [f32]; 3],
    },
    /// As greys: two thirds of the time of the achromatic channel of colours, and blind to noise that is
    /// only in colour.
    Grey {
        /// The middle.
        picture: &'a [f32],
        /// With half of it added and taken away, the middle makes the two pictures.
        residual: &'a [f32],
    },
    /// As greys, and what is seen in colour beside them: colour adds to what greys show, and hides none of it.
    /// Light and dark differ as greys do, or as the light of the colours does where that is more.
    GreyAndRgb {
        /// The middle and the residual as greys.
        grey: [&'a [f32]; 2],
        /// The middle and the residual in colour.
        rgb: [[&'a [f32]; 3]; 2],
    },
}

/// A part of a picture with what surrounds it.
#[derive(Clone, Debug)]
pub struct ResidualPatch<'a> {
    /// Its pixels, with a halo. Filters see the border of the patch mirrored; with a halo of 16 pixels,
    /// a tile of 128×128 differs from the whole picture by 0.2 % (root mean square).
    pub pixels: ResidualPixels<'a>,
    /// Pixels in a row, and rows; at least 4.
    pub size: (usize, usize),
    /// Columns of which differences are wanted.
    pub columns: Range<usize>,
    /// Rows of which differences are wanted.
    pub rows: Range<usize>,
}

/// How much of the model is computed for a residual: less is faster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisionDetail {
    /// Bands of which the chromatic channels are computed, too: those whose centre lies at this or below, in cycles per
    /// degree. None at 0.
    pub chromatic_below: f64,
    /// Bands of the pyramid are computed if their centre lies between these, in cycles per degree; at least
    /// one is.
    pub frequencies: (f64, f64),
}

impl VisionDetail {
    /// All channels and bands.
    pub const FULL: Self = Self { chromatic_below: f64::INFINITY, frequencies: (0.0, f64::INFINITY) };
    /// From one cycle per degree on, with chromatic channels up to ten: above that, they would take a third of the time more, for
    /// what the weights of [`VisibleDifference::contrast_energy`] make up for in noise of single pixels.
    pub const COLOUR: Self = Self { chromatic_below: 10.0, ..Self::FAST };
    /// Light and dark only, from one cycle per degree on.
    pub const FAST: Self = Self { chromatic_below: 0.0, frequencies: (1.0, 100.0) };
}

/// Visible differences in a part of a picture; 1 is about the threshold of seeing a difference. It borrows
/// the workspace.
#[derive(Debug)]
pub struct VisibleDifference<'a> {
    engine: &'a Engine,
    masking: &'a Masking,
    workspace: &'a mut VisionWorkspace,
    sizes: Sizes,
    bands: Range<usize>,
    /// The first band of which chromatic channels are there; the end of all if none are.
    chromatic: usize,
    part: Part,
}

/// Visible differences of one band and channel.
#[derive(Clone, Copy, Debug)]
pub struct DifferenceBand<'a> {
    /// Centre of the band, in cycles per degree.
    pub frequency: f64,
    /// Pixels of the picture from one value to the next.
    pub step: usize,
    plane: &'a [f32],
    stride: usize,
    part: Part,
}

impl<'a> DifferenceBand<'a> {
    /// The values, row by row. The first value of the first row lies on the first pixel asked for, or up to
    /// `step` − 1 before.
    pub fn rows(self) -> impl Iterator<Item = &'a [f32]> {
        let columns = self.part.columns();
        self.part.rows().map(move |y| &self.plane[y * self.stride..][columns.clone()])
    }

    /// Values in a row, and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.part.columns().len(), self.part.rows().len())
    }

    /// Mean of this order over the values: the first is the mean, the second the root mean square; high
    /// orders approach the largest.
    pub fn pooled(&self, order: f64) -> f64 {
        let (columns, rows) = self.size();
        let sum: f64 = self.rows().flatten().map(|&d| f64::from(d).powf(order)).sum();
        (sum / (columns * rows) as f64).powf(1.0 / order)
    }
}

impl VisionModel {
    /// How visible a residual is on its picture, where it is asked for. Allocates nothing once the workspace
    /// has grown to the patch.
    ///
    /// In a film ([`crate::Viewing::frames_per_second`]), the residual is one of those that its frames have, each a new
    /// one. Differences are those of [`VisionModel::compare`] of the two pictures before they are pooled, without its
    /// coarsest band, and without the constant 10⁻⁵ that makes its pooling over channels differentiable; so they follow
    /// [`rescaled`]. Of two pictures of which neither is the reference, eyes are adapted to the mean of both.
    ///
    /// # Errors
    /// If a side has fewer than four pixels, or the pictures are too large, of another size, or not finite,
    /// or if nothing is asked for.
    pub fn residual<'a>(
        &'a self,
        patch: &ResidualPatch<'_>,
        detail: VisionDetail,
        workspace: &'a mut VisionWorkspace,
    ) -> Result<VisibleDifference<'a>, VisionError> {
        let (width, height) = patch.size;
        let size = checked(width, height)?;
        if width < 4 || height < 4 {
            return Err(VisionError::Size { width, height });
        }
        let part =
            Part { x: (patch.columns.start, patch.columns.end), y: (patch.rows.start, patch.rows.end) };
        if part.columns().is_empty() || part.rows().is_empty() || part.x.1 > width || part.y.1 > height {
            return Err(VisionError::Region);
        }
        let engine = &self.engine;
        let bands = engine.bands.within(size, detail.frequencies);
        let of_chroma = |&band: &usize| engine.bands.frequencies[band] <= detail.chromatic_below;
        let chromatic = match patch.pixels {
            ResidualPixels::Grey { .. } => bands.end,
            _ => bands.clone().find(of_chroma).unwrap_or(bands.end),
        };
        let masking = match patch.pixels {
            ResidualPixels::GreyAndRgb { .. } => &engine.greys_unmasked,
            _ => &engine.masking,
        };
        let channels = if chromatic < bands.end { CHANNELS } else { 1 };
        let sizes = workspace.fit(size, bands.end + 1, channels, engine.film.is_some());
        load(engine, patch, size, channels, workspace)?;
        if channels == 1 {
            engine.filter_both::<1>(size, workspace);
        } else {
            engine.filter_both::<CHANNELS>(size, workspace);
        }
        let mut difference =
            VisibleDifference { engine, masking, workspace, sizes, bands: bands.clone(), chromatic, part };
        difference.compute(bands);
        Ok(difference)
    }
}

impl<'a> VisibleDifference<'a> {
    /// One number a place: bands and channels together, as in the map of ColorVideoVDP before it turns into
    /// JODs. Its step is that of the finest band that was computed.
    pub fn map(&mut self) -> DifferenceBand<'_> {
        self.map_at(1.0)
    }

    /// [`VisibleDifference::map`] for a residual of `contrast` times the strength, from the same bands: noise
    /// of n times as many samples has 1/√n. It takes a twentieth of the time of a tile.
    ///
    /// Exact if the picture masks as before. A weaker residual hides less of what masks it, so that mean
    /// differences are up to 5 % lower at half the contrast, 11 % with colour; a noisy picture that has lost
    /// noise masks less, so that they are higher.
    pub fn map_at(&mut self, contrast: f32) -> DifferenceBand<'_> {
        self.draw(self.bands.clone(), contrast.clamp(1e-6, 1e6).powf(EXPONENT), 1.0, [1.0; CHANNELS]);
        self.plane(self.bands.start, &self.workspace.map[self.bands.start])
    }

    /// The square of the visible contrast at each place: the map before differences are limited, to the power of
    /// 2/2.26. At a contrast of 1, noise is about at the threshold. It grows as the variance of the residual does, so
    /// that means of it over any place are worth samples, as variances are; that holds exactly if the picture masks
    /// as before, up to contrasts of some 700.
    ///
    /// The pyramid leaves every other pixel out, so that a dot in an odd row and column differs by less than one
    /// in even ones. All bands but the finest are therefore means of two pyramids, the other one that of the
    /// pictures turned by 180 degrees.
    pub fn contrast_energy(mut self) -> DifferenceBand<'a> {
        // So weak a residual is nowhere near the limit; what it is weaker by is taken back
        const WEAK: f32 = 1e-4;
        let draw = |of: &mut Self, bands| of.draw(bands, WEAK, 1.0 / WEAK, BESIDE_ACHROMATIC);
        let Range { start: first, end } = self.bands;
        // Coarser pixels than those of the picture do not lie on each other when it is turned
        if first > 0 || end < 2 {
            draw(&mut self, first..end);
        } else {
            draw(&mut self, 0..1);
            draw(&mut self, 1..end);
            self.turn(1..end);
            draw(&mut self, 1..end);
            self.turn_back();
        }
        let (part, width) = (self.part.at(first), self.sizes[first].width);
        for y in part.rows() {
            energy_row(&mut self.workspace.map[first][y * width..][part.columns()]);
        }
        let Self { engine, workspace, sizes, part, .. } = self;
        band_of(engine, first, &sizes, part, &workspace.map[first])
    }

    /// Keeps the map of these bands, all but the finest, and computes them of the turned pictures.
    fn turn(&mut self, bands: Range<usize>) {
        let VisionWorkspace { gauss, flicker, map, upright, .. } = &mut *self.workspace;
        std::mem::swap(&mut map[1], upright);
        let channels = if self.chromatic < self.bands.end { CHANNELS } else { 1 };
        let of_stills = gauss.iter_mut().flat_map(|of| &mut of[..channels]);
        for levels in of_stills.chain(self.engine.film.is_some().then_some(flicker)) {
            levels[0][..self.sizes[0].area()].reverse();
        }
        self.part = self.part.turned(self.sizes[0]);
        self.compute(bands);
    }

    /// Adds the mean of the map that was kept and of that of the turned pictures to the finest band.
    fn turn_back(&mut self) {
        let size = self.sizes[0];
        self.part = self.part.turned(size);
        let VisionWorkspace { map, upright, strip, .. } = &mut *self.workspace;
        let [finest, turned, ..] = &mut map[..] else { return };
        let row = &mut strip.places[..size.width];
        for y in self.part.rows() {
            let finest = &mut finest[y * size.width..][..size.width];
            expand_row(upright, size, y, &mut strip.narrow, row);
            finest.iter_mut().zip(&*row).for_each(|(out, coarse)| *out += 0.5 * coarse);
            expand_row(turned, size, size.height - 1 - y, &mut strip.narrow, row);
            finest.iter_mut().zip(row.iter().rev()).for_each(|(out, coarse)| *out += 0.5 * coarse);
        }
    }

    /// Builds the levels of the pictures, and computes these bands of them.
    fn compute(&mut self, bands: Range<usize>) {
        let film = self.engine.film.is_some();
        let chromatic = self.chromatic.clamp(bands.start, bands.end);
        if self.chromatic < self.bands.end {
            build::<CHANNELS>(&self.sizes, film, self.workspace);
        } else {
            build::<1>(&self.sizes, film, self.workspace);
        }
        self.differ::<1>(bands.start..chromatic);
        self.differ::<CHANNELS>(chromatic..bands.end);
    }

    /// Computes bands of `N` channels.
    fn differ<const N: usize>(&mut self, bands: Range<usize>) {
        for band in bands {
            let size = self.sizes[band];
            let wanted = self.part.at(band).wider(MARGIN, size);
            let rows = (wanted.wider(BLUR_RADIUS, size).rows(), wanted.rows());
            self.engine.band::<N>(band, size, rows, (Adapted::ToBoth, self.masking), self.workspace);
        }
    }

    /// Draws the map of these bands of a residual whose differences grow by `growth`, times `scale`, and those of
    /// each channel times a weight.
    fn draw(&mut self, bands: Range<usize>, growth: f32, scale: f32, weights: [f32; CHANNELS]) {
        let Self { engine, sizes, chromatic, part, .. } = self;
        let film = engine.film.is_some();
        let VisionWorkspace { differences, map, strip, .. } = &mut *self.workspace;
        let parts = |band: usize| part.at(band).wider(MARGIN, sizes[band]);
        for band in bands.clone() {
            // The pyramid halves contrasts between its finest and its coarsest band
            let scale = scale * if film { 1.0 } else { STILL as f32 } * if band == 0 { 1.0 } else { 0.5 };
            for y in parts(band).rows() {
                let Range { start, end } = parts(band).columns();
                let here = y * sizes[band].width + start..y * sizes[band].width + end;
                let row = |channel: usize| &differences[channel][band][here.clone()];
                let (transient, out) = (film.then(|| row(TRANSIENT)), &mut map[band][here.clone()]);
                if band < *chromatic {
                    across_row([row(0)], [weights[0]], transient, growth, scale, out);
                } else {
                    across_row([0, 1, 2].map(row), weights, transient, growth, scale, out);
                }
            }
        }
        collapse(map, bands, sizes, |band| parts(band).rows(), &mut strip.narrow, &mut strip.places);
    }

    /// The bands of a channel, finest first, without the transient channel of a film; those of chromatic channels that were computed.
    pub fn bands(&self, channel: OpponentChannel) -> impl Iterator<Item = DifferenceBand<'_>> {
        let planes = &self.workspace.differences[channel as usize];
        let from = if channel == OpponentChannel::Achromatic { self.bands.start } else { self.chromatic };
        (from..self.bands.end).map(|band| self.plane(band, &planes[band]))
    }

    fn plane<'b>(&self, band: usize, plane: &'b [f32]) -> DifferenceBand<'b> {
        band_of(self.engine, band, &self.sizes, self.part, plane)
    }
}

fn band_of<'a>(
    engine: &Engine,
    band: usize,
    sizes: &Sizes,
    part: Part,
    plane: &'a [f32],
) -> DifferenceBand<'a> {
    let frequency = engine.bands.frequencies[band];
    DifferenceBand { frequency, step: 1 << band, plane, stride: sizes[band].width, part: part.at(band) }
}

/// A visible difference of one band and channel after the residual has been multiplied by `contrast`: it
/// grows as contrast^2.26, up to a limit. Noise of n times as many samples has a contrast of 1/√n.
pub fn rescaled(difference: f32, contrast: f32) -> f32 {
    let difference = difference.clamp(0.0, 0.999_9 * LARGEST);
    grown(difference, contrast.clamp(1e-6, 1e6).powf(EXPONENT))
}

/// What differences of each channel count for in [`VisibleDifference::contrast_energy`]. It sums over bands, of which the metric
/// takes the mean of fourth order, and achromatic noise of single pixels is seen in two bands, chromatic in five: of
/// [`VisionDetail::COLOUR`], four. With these weights, chosen on flat pictures, noise of any colour has lost as many JODs
/// as grey noise of the same energy, most often within 0.05.
const BESIDE_ACHROMATIC: [f32; CHANNELS] = [1.0, 0.7, 0.7];

/// What the two pictures have of the residual beside the middle between them.
const SHARES: [f32; 2] = [0.5, -0.5];

/// Converts both pictures into opponent channels.
fn load(
    engine: &Engine,
    patch: &ResidualPatch<'_>,
    size: Size,
    channels: usize,
    workspace: &mut VisionWorkspace,
) -> Result<(), VisionError> {
    match patch.pixels {
        ResidualPixels::Rgb { picture, residual } => {
            for values in picture.into_iter().chain(residual) {
                check_values(values, size)?;
            }
            for (of, share) in SHARES.into_iter().enumerate() {
                if channels == 1 {
                    engine.load_planes::<1>(of, size, workspace, picture, (share, residual));
                } else {
                    engine.load_planes::<CHANNELS>(of, size, workspace, picture, (share, residual));
                }
            }
        }
        ResidualPixels::Grey { picture, residual } => {
            for values in [picture, residual] {
                check_values(values, size)?;
            }
            for (of, share) in SHARES.into_iter().enumerate() {
                engine.load_grey(of, size, workspace, picture, (share, residual));
            }
        }
        ResidualPixels::GreyAndRgb { grey: [picture, residual], rgb: [colours, of_colours] } => {
            for values in [picture, residual].into_iter().chain(colours).chain(of_colours) {
                check_values(values, size)?;
            }
            for (of, share) in SHARES.into_iter().enumerate() {
                engine.load_grey(of, size, workspace, picture, (share, residual));
            }
            if channels > 1 {
                let VisionWorkspace { gauss: [one, other], differences, map, .. } = &mut *workspace;
                std::mem::swap(&mut one[0][0], &mut differences[0][0]);
                std::mem::swap(&mut other[0][0], &mut map[0]);
                for (of, share) in SHARES.into_iter().enumerate() {
                    engine.load_planes::<CHANNELS>(of, size, workspace, colours, (share, of_colours));
                }
                let VisionWorkspace { gauss: [one, other], differences, map, .. } = &mut *workspace;
                let planes = [&mut one[0][0], &mut other[0][0]].map(|plane| &mut plane[..size.area()]);
                keep_greys(planes, [&differences[0][0], &map[0]]);
            }
        }
    }
    Ok(())
}

/// Interpolation of a band reads so far beyond what is wanted of the next finer one.
const MARGIN: usize = 2;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewing::Viewing;

    fn random(i: usize) -> f32 {
        ((i as u32).wrapping_mul(0x9E37_79B1) >> 8) as f32 / (1 << 24) as f32 - 0.5
    }

    /// A picture of 96×64 pixels and a residual of this strength.
    fn patch(strength: f32) -> [Vec<[f32; 3]>; 2] {
        let picture = (0..96 * 64).map(|i| [0.4 + 0.2 * random(i / 7), 0.4, 0.5]).collect();
        let residual = (0..96 * 64).map(|i| std::array::from_fn(|c| strength * random(3 * i + c)));
        [picture, residual.collect()]
    }

    fn planes(pixels: &[[f32; 3]]) -> [Vec<f32>; 3] {
        [0, 1, 2].map(|c| pixels.iter().map(|pixel| pixel[c]).collect())
    }

    fn differences(
        viewing: &str,
        [picture, residual]: &[Vec<[f32; 3]>; 2],
    ) -> (VisionWorkspace, Range<usize>) {
        let (model, mut room) =
            (VisionModel::new(&viewing.parse::<Viewing>().unwrap()), VisionWorkspace::default());
        let [picture, residual] = [picture, residual].map(|pixels| planes(pixels));
        let [picture, residual] = [&picture, &residual].map(|planes| planes.each_ref().map(Vec::as_slice));
        let pixels = ResidualPixels::Rgb { picture, residual };
        let patch = ResidualPatch { pixels, size: (96, 64), columns: 0..96, rows: 0..64 };
        let bands = model.residual(&patch, VisionDetail::FULL, &mut room).unwrap().bands;
        (room, bands)
    }

    /// Neither of the two pictures is the right one.
    #[test]
    fn the_sign_of_a_residual_changes_nothing() {
        for viewing in ["desk", "desk,fps=24"] {
            let [picture, residual] = patch(0.4);
            let other = residual.iter().map(|p| p.map(|v| -v)).collect();
            let [one, other] =
                [residual, other].map(|residual| differences(viewing, &[picture.clone(), residual]).0);
            assert!(one.differences == other.differences, "{viewing}");
        }
    }

    /// All channels of a film, the transient one included, are those that the metric pools of two pictures that are so
    /// much alike that it does not matter which of them is the reference.
    #[test]
    fn a_residual_of_a_film_differs_as_its_frame_does() {
        let model = VisionModel::new(&"desk,fps=24".parse::<Viewing>().unwrap());
        let all = patch(0.004);
        let [picture, residual] = &all;
        let [test, reference] = SHARES.map(|share| -> Vec<[f32; 3]> {
            let pairs = picture.iter().zip(residual);
            pairs.map(|(p, r)| std::array::from_fn(|c| p[c] + share * r[c])).collect()
        });
        let mut whole = VisionWorkspace::default();
        model.compare(&test, &reference, (96, 64), &mut whole).unwrap();
        let (tile, bands) = differences("desk,fps=24", &all);
        for (channel, (whole, tile)) in whole.differences.iter().zip(&tile.differences).enumerate() {
            for band in bands.clone() {
                let pairs = || whole[band].iter().zip(&tile[band]);
                let largest = pairs().map(|(a, _)| *a).fold(0.0, f32::max);
                // What masks differs by what the film takes off the residual, a hundredth of the contrast of the picture
                assert!(
                    largest > 0.0 && pairs().all(|(a, b)| (a - b).abs() < 0.03 * largest),
                    "{channel}, {band}"
                );
            }
        }
    }
}
