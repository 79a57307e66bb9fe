//! What a renderer offers: samples on request.

use crate::rgb::Rgb;
use crate::tile::Tile;
use auto_impl::auto_impl;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use thiserror::Error;

mod identity;
pub use identity::{IdentityChange, SourceIdentity};

/// What a source counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Unit {
    /// Samples per pixel.
    SamplesPerPixel,
    /// Mutations per pixel, on average over the tile (Metropolis light transport).
    MutationsPerPixel,
}

/// What the same seed repeats. Each kind keeps what the next one promises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Repeats {
    /// Every sample: it follows from (seed, pixel, index of the sample), however requests are cut and
    /// whatever other tiles are asked for with it. Only rounding of the means differs.
    Samples,
    /// Every call: the same requests in the same order give the same bits. Cut otherwise, they give other
    /// samples of the same distribution.
    Calls,
    /// Nothing: threads race, say. The distribution is the same.
    Nothing,
}

/// Whether the samples of a batch are each of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum PixelNoise {
    /// Yes: the noise of pixels is independent. Verdicts are made for this.
    #[default]
    Independent,
    /// No: a pixel filter, paths of light that are seen in many pixels, a Markov chain or a denoiser give
    /// neighbours noise in common.
    Shared,
}

/// How the numbers of samples that a source gives relate to those asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Counts {
    /// As many as asked for; at its end what is left, and nothing from then on.
    Asked,
    /// Now and then more, as where threads notice late that they have to stop; at its end what is left, and nothing from
    /// then on.
    More,
    /// What is stored, whatever is asked for: a playback.
    Stored,
}

impl Counts {
    /// Most samples per pixel that keep the promise where `asked` are asked for.
    pub fn most(self, asked: u64) -> u64 {
        match self {
            Self::Asked => asked,
            Self::More | Self::Stored => u64::MAX,
        }
    }
}

/// A source's description of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SourceInfo {
    /// Who renders, for reports and error messages: `"ptwne cornell-box"`.
    pub name: String,
    /// Image width in pixels.
    pub width: usize,
    /// Image height in pixels.
    pub height: usize,
    /// The unit of work.
    pub unit: Unit,
    /// Whether samples can be aimed at single tiles. If not, every call samples all tiles.
    pub aims: bool,
    /// What the same seed repeats.
    pub repeats: Repeats,
    /// Whether it gives as many samples as asked for.
    pub counts: Counts,
    /// Whether the noise of pixels is independent.
    pub pixels: PixelNoise,
    /// Whether the samples of a batch complete each other, as quasi-random points do. Their noise depends on where in its
    /// sequence a batch lies, and need not fall as independent samples' does.
    pub stratified: bool,
}

impl SourceInfo {
    /// A source of samples per pixel that can be aimed at tiles, gives as many as asked for, and repeats
    /// nothing.
    pub fn new(name: impl Into<String>, width: usize, height: usize) -> Self {
        Self {
            name: name.into(),
            width,
            height,
            unit: Unit::SamplesPerPixel,
            aims: true,
            repeats: Repeats::Nothing,
            counts: Counts::Asked,
            pixels: PixelNoise::Independent,
            stratified: false,
        }
    }

    /// The same with another [`SourceInfo::unit`]. Pixels share the mutations of a Markov chain.
    pub fn with_unit(self, unit: Unit) -> Self {
        let pixels = if unit == Unit::MutationsPerPixel { PixelNoise::Shared } else { self.pixels };
        Self { unit, pixels, ..self }
    }

    /// The same with another [`SourceInfo::pixels`].
    pub fn with_pixels(self, pixels: PixelNoise) -> Self {
        Self { pixels, ..self }
    }

    /// The same with another [`SourceInfo::stratified`].
    pub fn with_stratified(self, stratified: bool) -> Self {
        Self { stratified, ..self }
    }

    /// The same with another [`SourceInfo::aims`].
    pub fn with_aims(self, aims: bool) -> Self {
        Self { aims, ..self }
    }

    /// The same with another [`SourceInfo::repeats`].
    pub fn with_repeats(self, repeats: Repeats) -> Self {
        Self { repeats, ..self }
    }

    /// The same with another [`SourceInfo::counts`].
    pub fn with_counts(self, counts: Counts) -> Self {
        Self { counts, ..self }
    }
}

/// A request for samples of one tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Request {
    /// The tile to sample.
    pub tile: Tile,
    /// Samples per pixel that this tile already has: the index of the first new one. A source that derives
    /// its random numbers from (seed, pixel, sample index) is deterministic however the work is split into
    /// batches.
    pub first: u64,
    /// New samples per pixel wanted, at least 1.
    pub spp: u64,
    /// Where they lie among the sequences of a pixel, for sources of quasi-random points.
    pub sequence: Sequence,
}

/// The place of new samples in one of the independent sequences of a pixel; a session takes one sequence for
/// each half buffer.
///
/// A source of independent samples needs only [`Request::first`]. One of quasi-random points (Sobol, Halton,
/// stratified) takes points `first`, `first` + 1, … of sequence `number`, scrambled independently of every other
/// sequence. The samples of a sequence then complete each other, and the halves stay independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Sequence {
    /// Which sequence: that of half A is 0, that of half B is 1.
    pub number: u32,
    /// Samples per pixel that the sequence already has: the index of the first new point.
    pub first: u64,
}

impl Sequence {
    /// A place in one of the sequences.
    pub fn new(number: u32, first: u64) -> Self {
        Self { number, first }
    }
}

impl Request {
    /// A request whose samples are one sequence: that of a source which is asked for nothing else.
    pub fn new(tile: Tile, first: u64, spp: u64) -> Self {
        Self { tile, first, spp, sequence: Sequence { number: 0, first } }
    }

    /// The same at another place of the sequences.
    pub fn in_sequence(self, sequence: Sequence) -> Self {
        Self { sequence, ..self }
    }
}

/// New samples of one tile.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Batch {
    /// The tile that was sampled.
    pub tile: Tile,
    /// Exact number of new samples per pixel, in the range that [`SourceInfo::counts`] allows. Zero says that
    /// the source is exhausted in this tile.
    pub spp: u64,
    /// Mean of the new samples only, row-major over the tile, `tile.pixels()` values (none if `spp` is zero).
    /// Non-finite values are allowed: the film rejects and counts them.
    pub mean: Vec<Rgb>,
}

impl Batch {
    /// So many new samples per pixel of a tile, and their mean.
    pub fn new(tile: Tile, spp: u64, mean: Vec<Rgb>) -> Self {
        Self { tile, spp, mean }
    }

    /// Makes a batch for each request, black so far, in the memory of earlier ones: for
    /// [`ProgressiveSource::sample_into`].
    pub fn prepare(batches: &mut Vec<Self>, requests: &[Request]) {
        batches.truncate(requests.len());
        let more = &requests[batches.len()..];
        batches.extend(more.iter().map(|request| Self::new(request.tile, request.spp, Vec::new())));
        for (batch, &Request { tile, spp, .. }) in batches.iter_mut().zip(requests) {
            (batch.tile, batch.spp) = (tile, spp);
            batch.mean.clear();
            batch.mean.resize(if spp == 0 { 0 } else { tile.pixels() }, [0.0; 3]);
        }
    }
}

/// A quick noise-free picture of the scene, the reference of Takouachet et al. 2017, §4.3. Few renderers have one, so it is no
/// part of [`ProgressiveSource`]: a [`Driver`](crate::Driver::set_reference) is told how to render it, a session is
/// [given](crate::Session::set_reference) it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Reference {
    /// Width in pixels, the same as the source's.
    pub width: usize,
    /// Height in pixels, the same as the source's.
    pub height: usize,
    /// Linear radiance, row-major.
    pub pixels: Vec<Rgb>,
}

impl Reference {
    /// A picture of this width and height.
    pub fn new((width, height): (usize, usize), pixels: Vec<Rgb>) -> Self {
        Self { width, height, pixels }
    }
}

/// What camera rays meet first, also behind smooth glass and in mirrors, without any light: auxiliary pictures for denoisers.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FirstHits {
    /// Width in pixels, the same as the source's.
    pub width: usize,
    /// Height in pixels, the same as the source's.
    pub height: usize,
    /// Colour of the surface (diffuse albedo, or the tint of metal and glass), in [0, 1], row-major. What a ray
    /// shows that meets no surface is the source's choice.
    pub albedo: Vec<Rgb>,
    /// Shading normal on the side of the camera, averaged over the pixel: a vector no longer than 1, as many
    /// values. Zero where there is no surface. The coordinates are the source's choice.
    pub normal: Vec<Rgb>,
}

impl FirstHits {
    /// Pictures of this width and height.
    pub fn new((width, height): (usize, usize), albedo: Vec<Rgb>, normal: Vec<Rgb>) -> Self {
        Self { width, height, albedo, normal }
    }
}

/// Why a source gave no samples.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SourceError {
    /// The renderer failed; the cause says how.
    #[error("{name}: sampling failed{}", .tile.map(|t| format!(" in tile {t}")).unwrap_or_default())]
    Failed {
        /// The source's name.
        name: String,
        /// The tile it failed in, where one is to blame.
        tile: Option<usize>,
        /// What went wrong.
        #[source]
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The source broke its contract.
    #[error("{name} broke the contract of a source: {what}")]
    Contract {
        /// The source's name.
        name: String,
        /// What was promised and not kept.
        what: String,
    },
}

/// Adds samples to tiles on request. It never accumulates, judges, tone maps or stops: that is the oracle's
/// part.
///
/// # Why it is shaped so
/// All tiles that are still open come in one call, so that a source can spread them over its threads (or over
/// one wavefront of a GPU). Batches are means of *new* samples only, so that the film can keep two
/// independent halves of any source, and no renderer has to know what a half buffer is.
///
/// # Example
/// A renderer whose pixels follow from pixel and sample number, so that a session of it can be resumed:
///
/// ```
/// use noisefloor::{Batch, Driver, DriverError, FixedSpp, Params, ProgressiveSource, Repeats, Request, SourceError, SourceInfo};
///
/// struct Noise;
///
/// /// One sample of one pixel: 0.0 to 1.0, the same for the same numbers.
/// fn sample(x: usize, y: usize, index: u64) -> f32 {
///     let mixed = (index ^ ((x as u64) << 20) ^ ((y as u64) << 40)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
///     ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32 / (1u64 << 24) as f32
/// }
///
/// impl ProgressiveSource for Noise {
///     fn info(&self) -> SourceInfo {
///         SourceInfo::new("noise", 64, 64).with_repeats(Repeats::Samples)
///     }
///
///     fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
///         let batch = |request: &Request| {
///             let (tile, samples) = (request.tile, request.first..request.first + request.spp);
///             let pixels = (tile.y..tile.y + tile.height).flat_map(|y| (tile.x..tile.x + tile.width).map(move |x| (x, y)));
///             let mean = |(x, y)| samples.clone().map(|index| sample(x, y, index)).sum::<f32>() / request.spp as f32;
///             Batch::new(tile, request.spp, pixels.map(|pixel| [mean(pixel); 3]).collect())
///         };
///         Ok(requests.iter().map(batch).collect())
///     }
/// }
///
/// let mut driver = Driver::new(Noise, FixedSpp(64), Params::default().with_tile(32))?;
/// driver.run(|_, _| ())?;
/// assert_eq!(driver.session().film().total_samples(), 64 * 64 * 64);
/// # Ok::<(), DriverError>(())
/// ```
///
/// # For implementers
/// - Return one batch for each request, in the order of the requests. A source that cannot aim
///   ([`SourceInfo::aims`] is false) is always asked for all tiles.
/// - Samples must be independent of all samples handed out before, in this tile and in others.
/// - The same seed should give the same samples, whatever the number of threads and however requests are
///   split into batches. [`SourceInfo::repeats`] says how much of this holds: a run is as reproducible as its
///   source.
/// - Use no reconstruction filter wider than a pixel, or say [`PixelNoise::Shared`]: shared samples correlate
///   the noise of neighbours, and the model has learned from independent noise.
///
/// The crate `noisefloor-testkit` has `check_source`, the contract that every source of this project passes:
/// run it on yours.
#[auto_impl(&mut, Box)]
pub trait ProgressiveSource {
    /// Describes the source. Must not change over its life.
    fn info(&self) -> SourceInfo;

    /// What its samples depend on: options, and the contents of every file it reads. Kept in checkpoints, so
    /// that a render is not resumed with another scene. By default its name.
    ///
    /// # Errors
    /// [`SourceError`] if a file cannot be read.
    fn identity(&self) -> Result<SourceIdentity, SourceError> {
        Ok(SourceIdentity::new(self.info().name))
    }

    /// Adds samples to the tiles named.
    ///
    /// # Errors
    /// [`SourceError`] if the renderer failed; samples of this call are then lost, all earlier ones stay
    /// valid.
    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError>;

    /// As [`ProgressiveSource::sample`], into batches that the caller keeps from call to call. The default calls `sample`; a
    /// source that takes its memory from [`Batch::prepare`] allocates none for pixels.
    ///
    /// # Errors
    /// As of [`ProgressiveSource::sample`].
    fn sample_into(&mut self, requests: &[Request], batches: &mut Vec<Batch>) -> Result<(), SourceError> {
        *batches = self.sample(requests)?;
        Ok(())
    }

    /// Renders albedo and normals of first hits from up to `spp` camera rays a pixel, if this source has them: fewer may do
    /// where the rays of a pixel agree. Behind smooth glass and in smooth mirrors, denoisers are helped most by the first
    /// surface that scatters, times what is lost on the way.
    ///
    /// Pictures of different `index` are independent of each other and of all samples: each half buffer is
    /// denoised with a picture of its own. A source whose pictures have no noise may return the same for every
    /// index. What [`SourceInfo::repeats`] promises of samples holds for them, too.
    ///
    /// # Errors
    /// [`SourceError`] if the renderer failed.
    fn first_hits(&mut self, index: u64, spp: u64) -> Result<Option<FirstHits>, SourceError> {
        let _ = (index, spp);
        Ok(None)
    }
}
