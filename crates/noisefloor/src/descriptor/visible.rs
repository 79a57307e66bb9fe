//! The descriptor on the vision model: how many times too strong the noise is, by a model of contrast
//! sensitivity and masking that was fitted to other pictures and other people.
//!
//! The vision model says how visible the residual is on its picture, place by place. The mean of high order
//! over the tile is one number, since observers look for the worst place. What counts is the contrast that
//! the residual would need for this number to reach a fixed difference: 0.5 says that the noise is twice too
//! strong. Its logarithm falls with samples exactly as that of the noise does, so that the expected need
//! follows without looking at the picture again.
//!
//! Two more numbers say what the tile is made of, its texture and its brightness: unfamiliar tiles are told by
//! them. Two are the picture's, its noise and its brightness: people judge a tile in its picture, and ask for more
//! samples in bright pictures than the vision model expects. The noise of a picture is a quantile over its
//! tiles, not a mean of high order, so that one bad spot does not make all tiles wait. `docs/accuracy.md` has the scores, with all of this chosen without the scenes that are scored.

use super::compact::texture_energy;
use super::kind::{Described, Descriptor, DescriptorError, DescriptorKind, TileDescriptor};
use crate::descriptor::NoiseMask;
use crate::{display::ROUNDING_LUMINANCE, evidence::TilePlanes};
use multiversion::multiversion;
use ndarray::{Array2, ArrayView2, s};
use noisefloor_vision::{
    DifferenceBand, ResidualPatch, ResidualPixels, VisibleDifference, VisionDetail, VisionModel,
    VisionWorkspace,
};
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

/// Least amplitude of noise that is told from none, in units of the amplitude that is just too strong.
const NOISE_FLOOR: f64 = 0.03;
/// Least light that is told from black, as a share of white.
const LIGHT_FLOOR: f32 = 0.002;
/// Exponent from display luminance Y′ to a share of the light of white; close to sRGB's curve, and the same
/// for all displays.
const GAMMA: f32 = 2.2;
/// How often the contrast is corrected; the last correction is not checked. What is left is 8 % at a tenth of the
/// noise that is too strong, and below 2 % near it.
const CORRECTIONS: usize = 3;
/// How a pooled difference grows with contrast before that is known: between weak noise (2.26) and strong.
const USUAL_GROWTH: f64 = 1.3;

pub(super) const KIND: DescriptorKind = DescriptorKind {
    name: "visible",
    make: |parameters| Ok(Descriptor::new(Visible::from_parameters(parameters)?)),
};

/// See [`Descriptor::visible`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Visible {
    /// Order of the mean over a tile.
    order: Order,
    /// Pooled difference at which noise is just too strong, in units of the vision model.
    difference: f64,
    /// Share of the picture that is less noisy than what counts as its noise.
    picture_quantile: f64,
}

/// The order of a mean: 2 to the power of this.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Order(u32);

impl Order {
    fn number(self) -> f64 {
        f64::from(1u32 << self.0)
    }

    fn power(self, x: f64) -> f64 {
        (0..self.0).fold(x, |x, _| x * x)
    }

    fn root(self, x: f64) -> f64 {
        (0..self.0).fold(x, |x, _| x.sqrt())
    }
}

impl Default for Visible {
    fn default() -> Self {
        Self { order: Order(2), difference: 20.0, picture_quantile: 0.875 }
    }
}

impl Visible {
    fn from_parameters(parameters: &BTreeMap<String, f64>) -> Result<Self, String> {
        let given = |name: &str| parameters.get(name).copied().ok_or(format!("its {name} is missing"));
        let order = |name: &str| {
            let number = given(name)?;
            let order = (0..5).map(Order).find(|order| order.number() == number);
            order.ok_or(format!("its {name} is {number}, and not 1, 2, 4, 8 or 16"))
        };
        let difference = given("difference")?;
        if !(1.0..=300.0).contains(&difference) {
            return Err(format!("its difference of {difference} is not within 1…300"));
        }
        let picture_quantile = given("picture_quantile")?;
        if !(0.0..=1.0).contains(&picture_quantile) {
            return Err(format!("its picture_quantile of {picture_quantile} is not within 0…1"));
        }
        Ok(Self { order: order("order")?, difference, picture_quantile })
    }
}

impl TileDescriptor for Visible {
    fn name(&self) -> &'static str {
        KIND.name
    }

    fn version(&self) -> u16 {
        2
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        let numbers = [
            ("order", self.order.number()),
            ("difference", self.difference),
            ("picture_quantile", self.picture_quantile),
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
        // What is not finite is never converged
        let noise =
            with_differences(planes, |differences| self.noise(differences).0).unwrap_or(f64::INFINITY);
        let noise = noise * without_rounding(planes);
        Ok(vec![noise_number(noise), texture_energy(planes, NoiseMask::default()), light(planes)])
    }

    fn in_picture(&self, tiles: &[Described]) -> Vec<Vec<f32>> {
        Visible::in_picture(*self, tiles)
    }

    fn visible_noise(&self, planes: &TilePlanes) -> Option<Array2<f32>> {
        let (height, width) = (planes.inner.height, planes.inner.width);
        let map = with_differences(planes, |differences| self.map(differences, (height, width)));
        Some(map.unwrap_or_else(|| Array2::from_elem((height, width), f32::INFINITY)))
    }

    fn pooled_visible_noise(&self, raw: &[f32]) -> Option<f32> {
        Some(amplitude(raw[0]) as f32)
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
    /// How many times stronger the noise is than noise whose pooled difference is [`Visible::difference`], 0
    /// without noise; and how differences grow with contrast there. Found on logarithms, by secants:
    /// differences grow nearly as a power of contrast.
    fn noise(self, differences: &mut VisibleDifference<'_>) -> (f64, f64) {
        let mut excess = |contrast: f64| {
            let pooled = self.pooled(differences.map_at(contrast.exp() as f32));
            (pooled > 0.0).then(|| (pooled / self.difference).ln())
        };
        let (mut at, mut growth) = (0.0, USUAL_GROWTH);
        let Some(mut above) = excess(0.0) else { return (0.0, growth) };
        for correction in 0..CORRECTIONS {
            // Beyond ±6, four hundred times too strong or weak, a projection says nothing
            let next = (at - above / growth).clamp(-6.0, 6.0);
            if (next - at).abs() < 1e-3 || correction + 1 == CORRECTIONS {
                return ((-next).exp(), growth);
            }
            let Some(there) = excess(next) else { return ((-next).exp(), growth) };
            growth = ((there - above) / (next - at)).clamp(0.3, 2.3);
            (at, above) = (next, there);
        }
        ((-at).exp(), growth)
    }

    /// How many times too strong the noise is at each pixel, rows × columns. Its mean of the order `order` ·
    /// growth is that of the tile. Where noise is much weaker than in the tile's worst place, differences grow
    /// faster with contrast than they do there, and the map says too little.
    fn map(self, differences: &mut VisibleDifference<'_>, size: (usize, usize)) -> Array2<f32> {
        let (noise, growth) = self.noise(differences);
        // What cannot be told from none is not drawn
        if noise < NOISE_FLOOR {
            return Array2::zeros(size);
        }
        let band = differences.map_at(noise.recip() as f32);
        let rows: Vec<&[f32]> = band.rows().collect();
        let times = |x: f32| (noise * (f64::from(x) / self.difference).powf(growth.recip())) as f32;
        Array2::from_shape_fn(size, |(y, x)| {
            let row = rows[(y / band.step).min(rows.len() - 1)];
            times(row[(x / band.step).min(row.len() - 1)])
        })
    }

    /// The mean of high order of a map.
    fn pooled(self, map: DifferenceBand<'_>) -> f64 {
        let (columns, rows) = map.size();
        let sum: f64 = map.rows().map(|row| powers(self.order, row)).sum();
        self.order.root(sum / (columns * rows) as f64)
    }

    /// Appends to each tile's own numbers those of the picture that the tiles make up: a quantile of the amplitudes
    /// of their noise, and the mean of their light, both by area. Noise is what the tile at hand has with its own
    /// samples and the picture would have with as many.
    fn in_picture(self, tiles: &[Described]) -> Vec<Vec<f32>> {
        let area: f64 = tiles.iter().map(|t| t.area).sum();
        let light = tiles.iter().map(|t| t.area * f64::from(t.own[2])).sum::<f64>() / area;
        let of_one_sample = |t: &Described| (amplitude(t.own[0]) * t.spp.sqrt(), t.area);
        let mut noises: Vec<(f64, f64)> = tiles.iter().map(of_one_sample).collect();
        noises.sort_by(|a, b| a.0.total_cmp(&b.0));
        let noise = quantile(&noises, self.picture_quantile);
        let complete = |tile: &Described| {
            let picture = [noise_number(noise / tile.spp.sqrt()), light as f32];
            tile.own.iter().copied().chain(picture).collect()
        };
        tiles.iter().map(complete).collect()
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

/// The sum of the powers of a row, in eight sums that processors take side by side.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn powers(order: Order, row: &[f32]) -> f64 {
    let (chunks, rest) = row.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for chunk in chunks {
        let mut powers = chunk.map(f64::from);
        (0..order.0).for_each(|_| powers.iter_mut().for_each(|x| *x *= *x));
        sums.iter_mut().zip(powers).for_each(|(sum, x)| *sum += x);
    }
    sums.iter().sum::<f64>() + rest.iter().map(|&x| order.power(f64::from(x))).sum::<f64>()
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
fn with_differences<T>(
    planes: &TilePlanes,
    use_them: impl FnOnce(&mut VisibleDifference<'_>) -> T,
) -> Option<T> {
    EYES.with_borrow_mut(|Eyes { model, workspace }| {
        if model.as_ref().is_some_and(|model| *model.viewing() != planes.viewing) {
            *model = None;
        }
        let model = model.get_or_insert_with(|| VisionModel::new(&planes.viewing));
        let (rows, columns) = planes.image.dim();
        let [picture, residual] = [&planes.image, &planes.residual]
            .map(|plane| plane.as_slice().expect("planes are in standard layout"));
        let t = planes.inner;
        let patch = ResidualPatch {
            pixels: ResidualPixels::Grey { picture, residual },
            size: (columns, rows),
            columns: t.x..t.x + t.width,
            rows: t.y..t.y + t.height,
        };
        model.residual(&patch, VisionDetail::FAST, workspace).ok().as_mut().map(use_them)
    })
}

/// The pixels of the tile itself.
fn inner<'a>(plane: &'a Array2<f32>, planes: &TilePlanes) -> ArrayView2<'a, f32> {
    let t = planes.inner;
    plane.slice(s![t.y..t.y + t.height, t.x..t.x + t.width])
}

/// The share of the amplitude of the residual that is not known rounding noise.
fn without_rounding(planes: &TilePlanes) -> f64 {
    let known = f64::from(planes.rounding * ROUNDING_LUMINANCE);
    if known == 0.0 {
        return 1.0;
    }
    let squares = inner(&planes.residual, planes).fold(0.0, |sum, &v| sum + f64::from(v) * f64::from(v));
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
    let mean = inner(&planes.image, planes).fold(0.0, |sum, &luma| sum + f64::from(luma))
        / planes.inner.pixels() as f64;
    ((mean as f32).clamp(0.0, 1.0).powf(GAMMA) + LIGHT_FLOOR).ln()
}

#[cfg(test)]
mod tests;
