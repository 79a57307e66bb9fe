//! The descriptor on the vision model: how many times too strong the noise is, by a model of contrast
//! sensitivity and masking that was fitted to other pictures and other people.
//!
//! The vision model says how visible the residual is on its picture, place by place. People look for the worst
//! place: what counts is the root mean square of the visible contrast in windows of three quarters of a degree, and of
//! these the worst one that lies around a pixel of the tile. Windows lie in the picture and reach over the borders of
//! tiles, so that a verdict hardly hangs on how the picture is divided. In windows, visible contrast is as strong as
//! the noise is: it falls as 1/√n, and the expected need follows without looking at the picture again.
//!
//! Two limits keep what hardly any zone that people judged has. Where few pixels have all the noise, as white dots do,
//! its root mean square is small; there, the mean of fourth order over its window counts, divided by a ratio of the two
//! that the noise of nearly all zones stays below. And that all else in a picture is clean makes no noise invisible: a
//! picture counts as at least 1.25 times as noisy as each of its tiles. The first leaves the scores as they are; the
//! second makes the error 1 % larger, and keeps grain out of the worst places.
//!
//! Two more numbers say what the tile is made of, its texture and its brightness: unfamiliar tiles are told by
//! them. Two are the picture's, its noise and its brightness: people judge a tile in its picture, and ask for more
//! samples in bright pictures than the vision model expects. The noise of a picture is a quantile over its
//! tiles, not a mean of high order, so that one bad spot does not make all tiles wait.

use super::kind::{Described, Descriptor, DescriptorError, DescriptorKind, TileDescriptor};
use super::texture::texture_energy;
use super::windows::{BLOCK, PictureContrast, WindowContrast, block_count, block_sums};
use crate::descriptor::NoiseMask;
use crate::evidence::{Plane, TilePlanes};
use crate::rgb::ROUNDING_LUMINANCE;
use noisefloor_vision::{
    ResidualPatch, ResidualPixels, VisibleDifference, VisionDetail, VisionModel, VisionWorkspace,
};
use rayon::prelude::*;
use std::cell::RefCell;
use std::collections::BTreeMap;

/// What the numbers are.
const NAMES: [&str; 5] = ["visible_noise", "texture", "light", "picture_noise", "picture_light"];
/// Those of the tile by itself; the others are the picture's.
const OWN: usize = 3;
/// Which of them are noise, the tile's and the picture's.
const NOISE: [usize; 2] = [0, OWN];
/// Which of the tile's own say what it is made of, and stay as they are when noise falls.
const TEXTURE: [usize; 2] = [1, 2];

/// All numbers are logarithms, and differ by 0.4 to 1 over the human data. Where scenes are few and alike, the
/// picture's numbers hardly differ, and a machine would make much of it.
const LEAST_DEVIATION: f64 = 0.3;

/// Visible contrast, in units of the vision model's threshold, that counts as noise of strength 1: near what people
/// just see in a window. A unit; what is learned takes care of the rest.
const UNIT: f64 = 3.75;
/// Edge of the zones that people judged, in windows: 200 pixels of LISIC's pictures, at 28 a window.
const ZONE: usize = 7;
/// Largest share of a picture that a place takes up whose noise is not the picture's: 19 of 20 places have not met its dot.
const LOCAL: f64 = 0.05;
/// Least amplitude of noise that is told from none, in that unit.
const NOISE_FLOOR: f64 = 0.03;
/// Least light that is told from black, as a share of white.
const LIGHT_FLOOR: f32 = 0.002;
/// Exponent from display luminance Y′ to a share of the light of white; close to sRGB's curve, and the same
/// for all displays.
const GAMMA: f32 = 2.2;

pub(super) const KIND: DescriptorKind = DescriptorKind {
    name: "visible",
    make: |parameters| Ok(Descriptor::new(Visible::from_parameters(parameters)?)),
};

/// See [`Descriptor::visible`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Visible {
    /// Edge of a window, in degrees of visual angle.
    window: f64,
    /// Share of the picture that is less noisy than what counts as its noise.
    picture_quantile: f64,
    /// How many times the root mean square of visible contrast in a window its mean of fourth order may be. Beyond that,
    /// few pixels have it all, and stand out.
    crest: f64,
    /// How many times as noisy as its picture a tile may be. Beyond that, the picture counts as noisier than it is: that
    /// all else is clean makes no noise invisible. Below 1, all tiles but those that are cleaner than their picture by
    /// more than that are judged by their own noise alone, and the worst of them are no longer excused by the rest.
    beside_picture: f64,
}

impl Default for Visible {
    fn default() -> Self {
        Self { window: 0.75, picture_quantile: 0.875, crest: 1.35, beside_picture: 0.8 }
    }
}

impl Visible {
    fn from_parameters(parameters: &BTreeMap<String, f64>) -> Result<Self, String> {
        let within = |name: &str, (low, high): (f64, f64)| {
            let given = *parameters.get(name).ok_or(format!("its {name} is missing"))?;
            let fits = (low..=high).contains(&given);
            if fits { Ok(given) } else { Err(format!("its {name} of {given} is not within {low}…{high}")) }
        };
        Ok(Self {
            window: within("window", (0.1, 10.0))?,
            picture_quantile: within("picture_quantile", (0.0, 1.0))?,
            crest: within("crest", (1.0, 1e6))?,
            beside_picture: within("beside_picture", (0.1, 1e6))?,
        })
    }

    /// The edge of a window in blocks: odd, so that a block has a window around it.
    fn window_blocks(self, pixels_per_degree: f64) -> usize {
        let blocks = self.window * pixels_per_degree / BLOCK as f64;
        2 * ((blocks - 1.0) / 2.0).round().max(0.0) as usize + 1
    }
}

impl TileDescriptor for Visible {
    fn name(&self) -> &'static str {
        KIND.name
    }

    fn version(&self) -> u16 {
        4
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        let Self { window, picture_quantile, crest, beside_picture } = *self;
        let numbers = [
            ("window", window),
            ("picture_quantile", picture_quantile),
            ("crest", crest),
            ("beside_picture", beside_picture),
        ];
        numbers.map(|(name, number)| (name.to_owned(), number)).into()
    }

    fn number_names(&self) -> Vec<String> {
        NAMES.map(str::to_owned).to_vec()
    }

    fn own_len(&self) -> usize {
        OWN
    }

    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        Ok(self.describe_tile(planes, 1.0)?.own)
    }

    /// The first number is that of windows within the tile, until it is seen in its picture.
    fn describe_tile(&self, planes: &TilePlanes, spp: f64) -> Result<Described, DescriptorError> {
        let known = without_rounding(planes);
        let place = planes.place;
        let blocks = with_differences(planes, |differences| block_sums(differences.contrast_energy(), place));
        let mut described = Described {
            own: vec![0.0, texture_energy(planes, NoiseMask::default()), light(planes)],
            spp,
            place,
            window: self.window_blocks(planes.viewing.pixels_per_degree()),
            blocks: Vec::new(),
        };
        // What is not finite is never converged, and says nothing about its neighbours
        let Some(mut blocks) = blocks else {
            described.own[0] = noise_number(f64::INFINITY);
            return Ok(described);
        };
        let energy = (known * known) as f32;
        blocks
            .iter_mut()
            .for_each(|[sum, squares]| (*sum, *squares) = (*sum * energy, *squares * energy * energy));
        described.blocks = blocks;
        let alone = std::slice::from_ref(&described);
        described.own[0] = noise_number(self.worst(&PictureContrast::new(alone), alone)[0]);
        Ok(described)
    }

    fn is_sound(&self, tile: &Described) -> bool {
        let blocks = tile.blocks.is_empty() || tile.blocks.len() == block_count(tile.place);
        let all_finite = tile.own.iter().chain(tile.blocks.as_flattened()).all(|v| v.is_finite());
        // A window of ten degrees on a display of 2000 pixels a degree has 5000 blocks
        tile.own.len() == OWN && blocks && all_finite && (1..10_000).contains(&tile.window)
    }

    fn in_picture(&self, tiles: &[Described]) -> Vec<Vec<f32>> {
        let number = |(tile, worst): (&Described, f64)| {
            // A tile that is apart, or not finite, is as it was described
            if tile.blocks.is_empty() { tile.own[0] } else { noise_number(worst) }
        };
        let picture = PictureContrast::new(tiles);
        let noises: Vec<f32> = tiles.iter().zip(self.worst(&picture, tiles)).map(number).collect();
        self.with_picture(&picture, tiles, &noises)
    }

    fn visible_noise(&self, tiles: &[Described]) -> Option<Vec<Plane>> {
        let picture = PictureContrast::new(tiles);
        let map = |tile: &Described| {
            let (size, place) = ((tile.place.height, tile.place.width), tile.place);
            if tile.blocks.is_empty() {
                return Plane::filled(size, f32::INFINITY);
            }
            let window = |y, x| picture.around((place.y + y) / BLOCK, (place.x + x) / BLOCK, tile.window);
            // All pixels of a block have one window around them
            let mut known = f32::NAN;
            Plane::from_fn(size, |(y, x)| {
                if x == 0 || (place.x + x).is_multiple_of(BLOCK) {
                    known = window(y, x).amplitude(tile.spp, self.crest) as f32;
                }
                known
            })
        };
        Some(tiles.iter().map(map).collect())
    }

    fn texture(&self) -> &[usize] {
        &TEXTURE
    }

    fn least_deviation(&self) -> f64 {
        LEAST_DEVIATION
    }

    fn knows_viewing(&self) -> bool {
        true
    }

    fn project(&self, raw: &mut [f32], factor: f32) -> bool {
        for i in NOISE {
            raw[i] = noise_number(amplitude(raw[i]) / f64::from(factor).sqrt());
        }
        true
    }
}

impl Visible {
    /// How strong the noise is in the worst window around a pixel of each tile of a picture, with the samples of the tile.
    fn worst(self, picture: &PictureContrast, tiles: &[Described]) -> Vec<f64> {
        let of_tile = |tile: &Described| {
            picture.worst(picture.blocks(tile.place), tile.window).amplitude(tile.spp, self.crest) / UNIT
        };
        tiles.par_iter().map(of_tile).collect()
    }

    /// Appends to each tile's own numbers, of which the first is that of `noises`, those of the picture that the tiles
    /// make up: a quantile of the amplitudes of their noise, and the mean of their light, both by area. Noise is what the tile at hand has with its own
    /// samples and the picture would have with as many.
    ///
    /// The quantile is over parts of the picture as large as the zones that people judged, each by its worst window:
    /// over tiles, it would hang on their size. Where tiles are apart from each other, they are such zones. Of few zones, one dot
    /// would be the noise of most: there, the worst place is left out, if the others make up 19 of 20.
    fn with_picture(self, contrast: &PictureContrast, tiles: &[Described], noises: &[f32]) -> Vec<Vec<f32>> {
        let area: f64 = tiles.iter().map(|t| t.place.pixels() as f64).sum();
        let light = tiles.iter().map(|t| t.place.pixels() as f64 * f64::from(t.own[2])).sum::<f64>() / area;
        let of_one_sample =
            |(t, &noise): (&Described, &f32)| (amplitude(noise) * t.spp.sqrt(), t.place.pixels() as f64);
        let window = tiles.iter().find(|t| !t.blocks.is_empty()).map(|t| t.window);
        let strength = |here: WindowContrast| here.amplitude(1.0, self.crest) / UNIT;
        let mut all: Vec<(f64, f64)> = match window {
            None => tiles.iter().zip(noises).map(of_one_sample).collect(),
            Some(window) => {
                // The quantile leaves out one zone of many by itself
                let few = (contrast.zone_count(ZONE * window) as f64) * (1.0 - self.picture_quantile) < 1.0;
                let place = few.then(|| contrast.worst_place(LOCAL, window, strength)).flatten();
                let zones = contrast.zones(ZONE * window, window, place.as_ref());
                zones.into_iter().map(|(worst, blocks)| (strength(worst), blocks as f64)).collect()
            }
        };
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let of_picture = quantile(&all, self.picture_quantile);
        let complete = |(tile, &noise): (&Described, &f32)| {
            let of_picture = (of_picture / tile.spp.sqrt()).max(amplitude(noise) / self.beside_picture);
            let picture = [noise_number(of_picture), light as f32];
            [noise].into_iter().chain(tile.own[1..].iter().copied()).chain(picture).collect()
        };
        tiles.iter().zip(noises).map(complete).collect()
    }
}

/// The quantile `q` of values with weights, by increasing value: linear between the middles of the weights, from the
/// first value to the last. With equal weights these are the usual quantiles (definition 7 of Hyndman and Fan 1996).
fn quantile(sorted: &[(f64, f64)], q: f64) -> f64 {
    let (Some(first), Some(last)) = (sorted.first(), sorted.last()) else { return 0.0 };
    let all: f64 = sorted.iter().map(|&(_, weight)| weight).sum();
    // Between the middle of the first weight and that of the last
    let goal = q * (all - 0.5 * (first.1 + last.1));
    let mut middle = 0.0;
    for pair in sorted.windows(2) {
        let step = 0.5 * (pair[0].1 + pair[1].1);
        if middle + step >= goal {
            return pair[0].0 + (pair[1].0 - pair[0].0) * ((goal - middle) / step);
        }
        middle += step;
    }
    last.0
}

/// What a thread keeps for its next tile: what is constant for a display, and room.
#[derive(Default)]
struct Eyes {
    model: Option<VisionModel>,
    workspace: VisionWorkspace,
}

thread_local! {
    static EYES: RefCell<Eyes> = RefCell::default();
}

/// What `use_them` makes of the visible differences in a tile; `None` if a pixel is not finite.
fn with_differences<T>(planes: &TilePlanes, use_them: impl FnOnce(VisibleDifference<'_>) -> T) -> Option<T> {
    EYES.with_borrow_mut(|Eyes { model, workspace }| {
        if model.as_ref().is_some_and(|model| *model.viewing() != planes.viewing) {
            *model = None;
        }
        let model = model.get_or_insert_with(|| VisionModel::new(&planes.viewing));
        let (rows, columns) = planes.image.size();
        let [picture, residual] = [&planes.image, &planes.residual].map(Plane::values);
        let t = planes.inner;
        let (pixels, detail) = match &planes.colour {
            None => (ResidualPixels::Grey { picture, residual }, VisionDetail::FAST),
            Some(colour) => {
                let rgb = [&colour.image, &colour.residual].map(|rgb| rgb.each_ref().map(Plane::values));
                (ResidualPixels::GreyAndRgb { grey: [picture, residual], rgb }, VisionDetail::COLOUR)
            }
        };
        let patch = ResidualPatch {
            pixels,
            size: (columns, rows),
            columns: t.x..t.x + t.width,
            rows: t.y..t.y + t.height,
        };
        model.residual(&patch, detail, workspace).ok().map(use_them)
    })
}

/// The share of the amplitude of the residual that is not known rounding noise.
fn without_rounding(planes: &TilePlanes) -> f64 {
    let rounding = f64::from(planes.rounding);
    if rounding == 0.0 {
        return 1.0;
    }
    let (known, squares) = match &planes.colour {
        None => {
            let [squares] = planes.residual.sums_inside(planes.inner, |v| [v * v]);
            (rounding * f64::from(ROUNDING_LUMINANCE), squares)
        }
        Some(colour) => {
            let [squares] = colour.energy().sums_inside(planes.inner, |square| [square]);
            (3.0 * rounding, squares)
        }
    };
    (1.0 - known * planes.inner.pixels() as f64 / squares.max(f64::MIN_POSITIVE)).max(0.0).sqrt()
}

/// The amplitude above the floor, of a noise number.
fn amplitude(number: f32) -> f64 {
    ((2.0 * f64::from(number)).exp() - NOISE_FLOOR * NOISE_FLOOR).max(0.0).sqrt()
}

fn noise_number(amplitude: f64) -> f32 {
    let amplitude = amplitude.min(1e6);
    (0.5 * (amplitude * amplitude + NOISE_FLOOR * NOISE_FLOOR).ln()) as f32
}

/// The mean logarithm of the tile's light, as a share of that of white.
fn light(planes: &TilePlanes) -> f32 {
    let [sum] = planes.image.sums_inside(planes.inner, |luma| [luma]);
    let mean = sum / planes.inner.pixels() as f64;
    ((mean as f32).clamp(0.0, 1.0).powf(GAMMA) + LIGHT_FLOOR).ln()
}

#[cfg(test)]
mod tests;
