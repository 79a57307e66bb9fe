//! How wrong a denoised picture still is, from two halves of its samples.
//!
//! With independent halves A and B of a picture whose expected value is t, and any denoiser D, the error of a
//! denoised half has two parts, and each follows from what is there:
//!
//! - **Variance:** E (D(A) − D(B))² / 2. It shows where the denoiser makes different things of different
//!   noise: blotches, flickering edges.
//! - **Bias:** E (A − D(A))·(B − D(B)) = (t − E D)², since the two residuals are independent and both have
//!   the mean t − E D. What a denoiser removes from both halves alike is no noise but picture: texture, the
//!   light of rare paths.
//!
//! Their sum is E (D(A) − B)² − Var(B), without the squares of the noise that cancel in it. Of the mean of
//! the two denoised halves, which stands for the denoised picture, the variance is half of that.
//!
//! The product of the residuals is far too noisy in a single pixel: the noise of A and B goes into it. So it is
//! taken scale by scale, since noise is weak where it is coarse, and averaged over [`RADIUS`] pixels around.
//! What people would see is then built from fields that have the right shape: half the difference of the
//! denoised halves, plus, of each scale of the mean residual, the share that both halves have in common. Lines and dots, of
//! which such averages show little, are looked for by themselves (`thin.rs`).
//!
//! All of it is of luminance Y′ as displayed; where what either pair of halves differs by is strongly coloured, also of R′ and B′, each by
//! itself, and the vision model then sees colours.
//!
//! In a film whose frames have noise of their own, the variance is new in each frame, and the bias stands still: the
//! vision model gets them apart.
//!
//! The vision model does not see the mean of a tile; `brightness.rs` compares it.

use crate::bands::{LocalMeans, Plane};
use crate::brightness::{Light, jods_of_edge, shift};
use crate::denoiser::{DenoiseError, cut};
use crate::parts::whole;
use crate::thin::thin_bias;
use noisefloor::{
    Rgb, Tile, Viewing,
    display::{Display, luminance},
    evidence::TilePlanes,
    internal::held,
};
use noisefloor_vision::{VisionComparison, VisionError, VisionModel, VisionWorkspace};
use rayon::prelude::*;

/// Of 20 tiles that stop by an estimate, 19 have lost less than so many times as much as it says: chosen in the tiles of two
/// scenes, and tried in those of fourteen others. An estimate errs both ways, and a tile stops where it
/// errs to the low side.
pub const ESTIMATE_ERRS_BY: f64 = 1.5;
/// What two residuals have in common is averaged over this many pixels to each side: 4,225 pixels in all, so
/// that the finest scale tells a bias of an eighth of the noise from none.
const RADIUS: usize = 32;
/// Scales that are told apart, from details of two pixels to those of 64; what is coarser is one more.
const SCALES: u32 = 5;
/// Residuals are cut here, as a share of the display's range: a firefly is as wrong as can be seen, and the
/// product of one with any noise would drown what the halves have in common.
const MOST: f32 = 0.5;
/// Step of the slope of the display, as a share of the brightest channel, and the least, of white.
const STEP: (f32, f32) = (0.02, 1e-4);

/// Two independent halves of a picture, and what a denoiser makes of each: linear radiance, row-major.
#[derive(Clone, Copy, Debug)]
pub struct DenoisedHalves<'a> {
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// Halves A and B as rendered.
    pub noisy: [&'a [Rgb]; 2],
    /// D(A) and D(B), each made without a look at the other half.
    pub denoised: [&'a [Rgb]; 2],
}

/// The error in a rectangle of the picture.
pub(crate) type PartError = (Tile, DenoisedError);

/// The error of a denoised picture as displayed: a picture, and a residual as wrong as it is expected to be.
#[derive(Clone, Debug, PartialEq)]
pub struct DenoisedError {
    size: (usize, usize),
    /// Of luminance Y′; and of R′ and B′, where noise or what a denoiser makes of it is strongly coloured.
    fields: Vec<Field>,
    /// Of each pixel, for its brightness; empty where that is not in question.
    light: Vec<Light>,
    display: Display,
}

/// A picture as displayed, in one channel, and what may be wrong with it.
#[derive(Clone, Debug, PartialEq)]
struct Field {
    shown: Vec<f32>,
    residual: Vec<f32>,
    /// What of the residual is the same in every frame of a film; empty for none.
    standing: Vec<f32>,
}

/// What a display makes of radiance in one channel.
type Channel = fn(&Display, Rgb) -> f32;
/// Luminance Y′, R′ and B′.
const CHANNELS: [Channel; 3] = [
    |display, pixel| display.luma(pixel),
    |display, pixel| display.encode(pixel)[0],
    |display, pixel| display.encode(pixel)[2],
];

/// One pixel on the display, in one channel: that of the denoised mean, half the difference of the denoised halves, what a white
/// dot of one half adds to the mean, and the residuals of both halves.
type Displayed = [f32; 5];

impl DenoisedError {
    /// Estimates the error of the picture that is denoised from all samples of both halves.
    ///
    /// The estimate is for the mean of the two denoised halves. Denoising all samples at once removes the
    /// noise no worse, and keeps more of the picture.
    ///
    /// # Errors
    /// [`DenoiseError::Pixels`] if a picture has another number of pixels than the size says.
    pub fn new(halves: &DenoisedHalves<'_>, display: &Display) -> Result<Self, DenoiseError> {
        let DenoisedHalves { size, noisy, denoised } = *halves;
        let pictures = noisy.into_iter().chain(denoised);
        if let Some(odd) = pictures.into_iter().find(|p| size.0.checked_mul(size.1) != Some(p.len())) {
            return Err(DenoiseError::Pixels { size, got: odd.len() });
        }
        let coloured = [noisy, denoised].iter().any(|halves| is_coloured(size, *halves, display));
        let channels = if coloured { &CHANNELS[..] } else { &CHANNELS[..1] };
        let all: Vec<Vec<Displayed>> = channels
            .iter()
            .map(|&of| {
                let pixels = (0..noisy[0].len()).into_par_iter();
                pixels
                    .map(|i| displayed((display, of), noisy.map(|p| p[i]), denoised.map(|p| p[i])))
                    .collect()
            })
            .collect();
        let plane = |all: &[Displayed], n: usize| all.par_iter().map(|pixel| pixel[n]).collect();
        let mut residuals: Vec<Vec<f32>> = all.iter().map(|all| plane(all, 1)).collect();
        settle_sign(&mut residuals);
        let field = |(all, residual): (&Vec<Displayed>, _)| field(size, all, residual);
        let fields = all.iter().zip(residuals).map(field).collect();
        let light = |i: usize| Light::new(noisy.map(|p| p[i]), denoised.map(|p| p[i]));
        let light = (0..noisy[0].len()).into_par_iter().map(light).collect();
        Ok(Self { size, fields, light, display: display.clone() })
    }

    /// The error of a picture whose truth is known, in the same form: for comparison. In a film, all of it is taken
    /// to be new in every frame.
    ///
    /// # Errors
    /// [`DenoiseError::Pixels`] if a picture has another number of pixels than the size says.
    pub fn known(
        size: (usize, usize),
        picture: &[Rgb],
        truth: &[Rgb],
        display: &Display,
    ) -> Result<Self, DenoiseError> {
        if let Some(odd) = [picture, truth].into_iter().find(|p| size.0.checked_mul(size.1) != Some(p.len()))
        {
            return Err(DenoiseError::Pixels { size, got: odd.len() });
        }
        let coloured = is_coloured(size, [picture, truth], display);
        let field = |of: &Channel| {
            let shown: Vec<f32> = truth.iter().map(|&p| of(display, p)).collect();
            let residual = picture.iter().zip(&shown).map(|(&p, truth)| of(display, p) - truth).collect();
            Field { shown, residual, standing: Vec::new() }
        };
        let fields = CHANNELS[..if coloured { 3 } else { 1 }].iter().map(field).collect();
        let light = picture.iter().zip(truth).map(|(&p, &t)| Light::new([t; 2], [p; 2])).collect();
        Ok(Self { size, fields, light, display: display.clone() })
    }

    /// The same with a brightness that is not in question: all that [`DenoisedError::map_of_jods_lost`] needs.
    #[must_use]
    pub fn of_shape_alone(self) -> Self {
        Self { light: Vec::new(), ..self }
    }

    /// The same in a film of which nothing wrong stands still.
    pub(crate) fn new_in_every_frame(mut self) -> Self {
        self.fields.iter_mut().for_each(|field| field.standing.clear());
        self
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Luminance Y′ of the picture as displayed, row-major, in [0, 1], without white dots that one half of its samples
    /// alone has.
    pub fn shown(&self) -> &[f32] {
        &self.fields[0].shown
    }

    /// What may be wrong with it at each pixel, in the same unit. Its size is what is expected; its sign, and
    /// the places of its details, are one possibility of many.
    pub fn residual(&self) -> &[f32] {
        &self.fields[0].residual
    }

    /// What a tile is judged by: see [`noisefloor::Oracle::describe`].
    pub fn planes(&self, tile: Tile, viewing: Viewing) -> TilePlanes {
        let planes = TilePlanes::gather(self.size, tile, |x, y| {
            let pixel = y * self.size.0 + x;
            let shown = self.pixel(pixel, |field| &field.shown);
            let residual = self.pixel(pixel, |field| &field.residual);
            (std::array::from_fn(|c| shown[c] + 0.5 * residual[c]), residual)
        });
        TilePlanes { viewing, ..planes }
    }

    /// Just-objectionable differences that a tile has lost, seen as a picture of its own; at least those of
    /// an edge as high as its mean is off, where noise does not explain that.
    ///
    /// # Errors
    /// [`VisionError`] if the tile is larger than the vision model compares.
    pub fn jods_lost(
        &self,
        tile: Tile,
        eyes: &VisionModel,
        room: &mut VisionWorkspace,
    ) -> Result<f64, VisionError> {
        self.part(tile).jods_lost_at(1.0, eyes, room)
    }

    /// The same of the whole, if the residual had `contrast` times its strength.
    pub(crate) fn jods_lost_at(
        &self,
        contrast: f32,
        eyes: &VisionModel,
        room: &mut VisionWorkspace,
    ) -> Result<f64, VisionError> {
        let lost = 10.0 - self.compare(contrast, eyes, room)?.jod();
        let height = self.shift();
        if height == 0.0 {
            return Ok(lost);
        }
        let shown = self.shown();
        let level = shown.iter().sum::<f32>() / shown.len().max(1) as f32;
        Ok(lost.max(jods_of_edge((level, height), seen_size(self.size), eyes, room)?))
    }

    /// By how much the whole is brighter or darker than its samples, as displayed; 0 if noise explains that.
    pub(crate) fn shift(&self) -> f32 {
        shift(&self.light, &self.display)
    }

    pub(crate) fn display(&self) -> &Display {
        &self.display
    }

    /// The same of another strength.
    pub(crate) fn scaled(mut self, by: f32) -> Self {
        for Field { residual, standing, .. } in &mut self.fields {
            residual.iter_mut().chain(standing).for_each(|error| *error *= by);
        }
        self
    }

    /// A tile of it, alone.
    pub(crate) fn part(&self, tile: Tile) -> Self {
        let width = self.size.0;
        let part = |field: &Field| Field {
            shown: cut(&field.shown, width, tile),
            residual: cut(&field.residual, width, tile),
            standing: cut(&field.standing, width, tile),
        };
        Self {
            size: (tile.width, tile.height),
            fields: self.fields.iter().map(part).collect(),
            light: cut(&self.light, width, tile),
            display: self.display.clone(),
        }
    }

    /// A picture as displayed with this wrong with it, in Y′ or in Y′, R′ and B′, whose brightness is not in question.
    pub(crate) fn of(
        size: (usize, usize),
        shown_and_residual: Vec<[Vec<f32>; 2]>,
        display: &Display,
    ) -> Self {
        let (shown, mut residuals): (Vec<_>, Vec<_>) =
            shown_and_residual.into_iter().map(|[shown, residual]| (shown, residual)).unzip();
        settle_sign(&mut residuals);
        let field = |(shown, residual)| Field { shown, residual, standing: Vec::new() };
        let fields = shown.into_iter().zip(residuals).map(field).collect();
        Self { size, fields, light: Vec::new(), display: display.clone() }
    }

    /// What is shown in each channel: Y′, or Y′, R′ and B′.
    pub(crate) fn shown_in_channels(&self) -> impl Iterator<Item = &[f32]> {
        self.fields.iter().map(|field| field.shown.as_slice())
    }

    /// R′, G′ and B′ of a pixel, in one of the planes.
    fn pixel(&self, at: usize, of: impl Fn(&Field) -> &Vec<f32>) -> Rgb {
        match &self.fields[..] {
            [luma, red, blue] => {
                let [luma, r, b] = [luma, red, blue].map(|field| of(field)[at]);
                let green = (luma - luminance([r, 0.0, b])) / luminance([0.0, 1.0, 0.0]);
                [r, green, b]
            }
            fields => [of(&fields[0])[at]; 3],
        }
    }

    /// A map of just-objectionable differences lost, row-major.
    ///
    /// # Errors
    /// [`VisionError`] if the picture is larger than the vision model compares.
    pub fn map_of_jods_lost(&self, eyes: &VisionModel) -> Result<Vec<f32>, VisionError> {
        let mut room = VisionWorkspace::default();
        let mut found = self.compare(1.0, eyes, &mut room)?;
        let (width, height) = self.size;
        Ok(cut(found.map(), seen_size(self.size).0, Tile { index: 0, x: 0, y: 0, width, height }))
    }

    /// The picture with its error, at `contrast` times its strength, against the picture without.
    fn compare<'a>(
        &self,
        contrast: f32,
        eyes: &VisionModel,
        room: &'a mut VisionWorkspace,
    ) -> Result<VisionComparison<'a>, VisionError> {
        let size = seen_size(self.size);
        let pixels = 0..self.shown().len();
        let with = |error: fn(&Field) -> &Vec<f32>| -> Vec<Rgb> {
            let pixel = |i: usize| {
                let (shown, error) = (self.pixel(i, |field| &field.shown), self.pixel(i, error));
                std::array::from_fn(|c| shown[c] + contrast * error[c])
            };
            seen(self.size, pixels.clone().map(pixel).collect())
        };
        let shown = pixels.clone().map(|i| self.pixel(i, |field| &field.shown)).collect();
        let reference = seen(self.size, shown);
        let test = with(|field| &field.residual);
        if self.fields[0].standing.is_empty() || eyes.viewing().frames_per_second().is_none() {
            return eyes.compare(&test, &reference, size, room);
        }
        eyes.compare_frame(&test, &with(|field| &field.standing), &reference, size, room)
    }
}

/// Of a difference of two halves, either sign is as likely. One has to be taken for all channels, whichever half is which: that
/// with the stronger peaks in the first channel that has any.
fn settle_sign(channels: &mut [Vec<f32>]) {
    let first = |difference: &Vec<f32>| difference.iter().copied().find(|&value| value != 0.0);
    let Some((difference, first)) = channels.iter().find_map(|of| Some((of, first(of)?))) else { return };
    let skew: f64 = difference.iter().map(|&value| f64::from(value).powi(3)).sum();
    if skew < 0.0 || (skew == 0.0 && first < 0.0) {
        channels.iter_mut().flatten().for_each(|value| *value = -*value);
    }
}

/// Whether two pictures differ in strongly coloured ways, as [`TilePlanes`] tell.
fn is_coloured(size: (usize, usize), pair: [&[Rgb]; 2], display: &Display) -> bool {
    let planes = TilePlanes::gather(size, whole(size), |x, y| {
        let [a, b] = pair.map(|picture| display.encode(picture[y * size.0 + x]));
        (std::array::from_fn(|c| 0.5 * (a[c] + b[c])), std::array::from_fn(|c| 0.5 * (a[c] - b[c])))
    });
    planes.colour.is_some()
}

/// The error in one channel, whose half difference of the denoised halves has its sign.
fn field(size: (usize, usize), all: &[Displayed], mut residual: Vec<f32>) -> Field {
    let plane = |n: usize| Plane::new(size, all.par_iter().map(|pixel| pixel[n]).collect());
    // Nothing is added to what is white already: the picture is shown without it
    let without = |(pixel, &residual): (&Displayed, &f32)| {
        if residual > 0.0 { pixel[0] - pixel[2] } else { pixel[0] }
    };
    let shown = all.par_iter().zip(&residual).map(without).collect();
    let mut standing = vec![0.0; all.len()];
    let residuals = [plane(3), plane(4)];
    add_common([&mut residual, &mut standing], residuals.clone());
    // A line is in what both have in common as far as its surroundings have it
    let lacking = thin_bias(size, residuals.each_ref().map(|residual| residual.values.as_slice()), &standing);
    for ((sum, standing), lacking) in residual.iter_mut().zip(&mut standing).zip(lacking) {
        *sum += lacking;
        *standing += lacking;
    }
    Field { shown, residual, standing }
}

/// The vision model compares no picture with a side of one pixel: it gets two that are the same.
fn seen_size((width, height): (usize, usize)) -> (usize, usize) {
    (width.max(2), height.max(2))
}

/// A picture of this size as one of [`seen_size`].
fn seen((width, height): (usize, usize), pixels: Vec<Rgb>) -> Vec<Rgb> {
    let mut wide = if width == 1 { pixels.iter().flat_map(|&pixel| [pixel; 2]).collect() } else { pixels };
    if height == 1 {
        wide.extend_from_within(..);
    }
    wide
}

/// Shows one pixel. Residuals are multiplied by the slope of the display at the denoised mean: the display
/// would bend noise so that its mean moves, and the bend would pass for bias.
fn displayed((display, of): (&Display, Channel), noisy: [Rgb; 2], denoised: [Rgb; 2]) -> Displayed {
    let mean: Rgb = std::array::from_fn(|c| (0.5 * (denoised[0][c] + denoised[1][c])).max(0.0));
    let brightest = mean.into_iter().fold(0.0, f32::max);
    let step = (STEP.0 * brightest).max(STEP.1 / display.exposure());
    let slope: Rgb = std::array::from_fn(|c| {
        let (mut up, mut down) = (mean, mean);
        (up[c], down[c]) = (mean[c] + step, (mean[c] - step).max(0.0));
        (of(display, up) - of(display, down)) / (up[c] - down[c])
    });
    let residual = |half: usize| {
        let along = |c: usize| slope[c] * (noisy[half][c] - denoised[half][c]);
        (along(0) + along(1) + along(2)).clamp(-MOST, MOST)
    };
    let [shown, a, b] = [mean, denoised[0], denoised[1]].map(|pixel| of(display, pixel));
    // What one half alone has, and is as white in the mean as there, is seen as a whole
    let held = held([shown, a, b], [0.5; 2]);
    let (difference, dot) = (0.5 * (1.0 + held) * (a - b), held * (a - b).abs());
    [shown, difference, dot, residual(0), residual(1)]
}

/// Adds to both sums, scale by scale, the share of the mean of two residuals that they have in common.
fn add_common([sum, other]: [&mut [f32]; 2], mut residuals: [Plane; 2]) {
    for scale in 0..=SCALES {
        let [ra, rb] = &mut residuals;
        let part =
            |residual: &mut Plane| if scale < SCALES { residual.split(scale) } else { residual.clone() };
        let (a, b) = rayon::join(|| part(ra), || part(rb));
        let (size, a, b) = (a.size, &a.values, &b.values);
        let product_and_energy = |i: usize| [a[i] * b[i], 0.25 * (a[i] + b[i]) * (a[i] + b[i])];
        let means = LocalMeans::new(size, RADIUS, product_and_energy);
        let rows = sum.par_chunks_exact_mut(size.0).zip(other.par_chunks_exact_mut(size.0)).enumerate();
        rows.for_each(|(y, (sum, other))| {
            let pairs = a[y * size.0..].iter().zip(&b[y * size.0..]);
            let sums = sum.iter_mut().zip(other);
            for (((sum, other), (a, b)), &[common, energy]) in sums.zip(pairs).zip(means.row(y)) {
                // Chance makes the mean product negative, too: nothing in common then. The estimate is that much too
                // large on average where there is no bias; what it misses elsewhere makes up for it
                let share = if energy > 0.0 { (common / energy).clamp(0.0, 1.0).sqrt() } else { 0.0 };
                let common = share * 0.5 * (a + b);
                *sum += common;
                *other += common;
            }
        });
    }
}
