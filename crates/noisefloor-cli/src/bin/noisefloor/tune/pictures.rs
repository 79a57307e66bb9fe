//! Two pictures of a setting, and how far they are from what may be seen.

use super::job::{TILE, TuneCriterion, TuneJob};
use anyhow::{Context, bail};
use indicatif::ProgressBar;
use noisefloor::source::SourceIdentity;
use noisefloor::stills::{StillError, StillWarning};
use noisefloor::tune::{Knob, Looked, PicturePair, PixelCounts};
use noisefloor::{Film, Params, ProgressiveSource, Rgb, StoppingCriterion, Tile, TileGrid, ToneMapping};
use noisefloor_cli::options::tone::Tone;
use noisefloor_cli::say::note;
use noisefloor_cli::sources::{Opened, Resources, Source, SourceJob, SourceKind, fill};
use noisefloor_denoise::{DenoisedError, Denoiser, Guides, NoisyPicture, Oidn};
use noisefloor_sidecar::{FilterPlan, ThresholdCommand};
use noisefloor_vision::VisionModel;
use std::fs::File;
use std::mem::discriminant;
use std::time::Duration;

/// Most samples per pixel of a program that nobody has told how many.
const MOST_SPP: u64 = 16_384;

pub enum Pictures {
    /// Samples per pixel, everywhere alike; of each half of a film, which grows.
    Samples { source: Box<dyn Source>, film: Film },
    /// By the renderer's own noise threshold.
    Adaptive { source: Box<dyn Source>, most: Option<u64>, seeds: [u32; 2] },
    /// By that of a program.
    Program { command: ThresholdCommand, most: u64, seeds: [u32; 2] },
}

/// A pair as it was rendered.
#[derive(Clone)]
pub struct Pair {
    size: (usize, usize),
    pictures: [Vec<Rgb>; 2],
    /// Of each, where it is known.
    spp: Option<f64>,
    /// Of their pixels, where the renderer tells.
    counts: Option<[PixelCounts; 2]>,
}

impl Pair {
    /// A part of both.
    pub fn cropped(&self, part: Tile) -> Self {
        let pictures = self.pictures.each_ref().map(|picture| cut(part, self.size.0, picture));
        let counts = self.counts.as_ref().map(|counts| {
            counts
                .each_ref()
                .map(|counts| PixelCounts { samples: cut(part, self.size.0, &counts.samples), ..*counts })
        });
        Self { size: (part.width, part.height), pictures, spp: self.spp, counts }
    }
}

pub struct Crop {
    pub tile: Tile,
    /// With the exposure of the whole.
    pub tone: ToneMapping,
}

/// What was found of a pair, and the picture that people would look at.
pub struct Judged {
    /// The worst place in the whole picture; the map is of noise, 1 is the limit, or of JODs lost.
    pub looked: Looked,
    pub size: (usize, usize),
    /// Mean of both, as rendered.
    pub mean: Vec<Rgb>,
    /// That denoised, if it was to be.
    pub denoised: Option<Vec<Rgb>>,
    /// Samples per pixel of the mean.
    pub spp: Option<f64>,
}

/// One picture that is rendered again and again: the only one, or a frame of a sequence.
pub struct View {
    pub frame: Option<i32>,
    /// What it is rendered from.
    source: SourceJob,
    pub pictures: Pictures,
    /// Albedo and normals for the denoiser, of each half.
    pub guides: Option<Guides>,
    /// Of the first pictures.
    size: Option<(usize, usize)>,
}

impl View {
    pub fn open(job: &TuneJob, frame: Option<i32>, judges: &mut Judges<'_>) -> anyhow::Result<Self> {
        let source = frame.map_or_else(|| job.source.clone(), |frame| job.source.of_frame(frame));
        let mut pictures = Pictures::open(&source, job.resources, job.search.knob(), job.most_spp)?;
        let guides = match &mut judges.denoiser {
            Some(denoiser) => pictures.guides(source.first_hits_spp(), denoiser)?,
            None => None,
        };
        Ok(Self { frame, source, pictures, guides, size: None })
    }

    /// Checks that whole pictures keep the size that they had with the settings before.
    pub fn check_size(&mut self, pair: &Pair) -> anyhow::Result<()> {
        let ((width, height), before) = (pair.size, *self.size.get_or_insert(pair.size));
        if pair.size != before {
            bail!(
                "the renderer's pictures have {width}×{height} pixels now, and had {}×{} before: \
                 what is seen in one says nothing of the other; render all with one size",
                before.0,
                before.1
            );
        }
        Ok(())
    }

    /// What the pictures and what is found in them depend on.
    pub fn identity(&self, job: &TuneJob, judges: &Judges<'_>) -> anyhow::Result<SourceIdentity> {
        let mut identity = match &self.pictures {
            Pictures::Samples { source, .. } | Pictures::Adaptive { source, .. } => source.identity()?,
            Pictures::Program { .. } => {
                let mut identity = SourceIdentity::new(serde_json::to_string(&self.source.absolute()?)?);
                if let Some(scene) = self.source.scene.as_ref().filter(|scene| scene.is_file()) {
                    identity.add_from(scene.display().to_string(), File::open(&**scene)?)?;
                }
                identity
            }
        };
        if let Tone::Lut { file, .. } = &job.tone {
            identity.add_from(file.display().to_string(), File::open(&**file)?)?;
        }
        let criterion = match &job.criterion {
            TuneCriterion::Noise(oracle) => oracle.fingerprint(),
            TuneCriterion::Denoised { .. } => String::new(),
        };
        let tone = serde_json::to_string(&job.tone.absolute()?)?;
        let (knob, said, most) = (job.search.knob().name(), judges.said(), job.most_spp.unwrap_or(0));
        let audience = serde_json::to_string(&job.audience)?;
        let seeds = seeds(self.source.seed);
        Ok(identity
            .with_options(&format!("{knob} of {seeds:?}, {most} {said} {criterion} {audience} {tone}")))
    }

    /// What the user should know afterwards.
    pub fn notes(&self) -> Vec<String> {
        match &self.pictures {
            Pictures::Samples { source, .. } | Pictures::Adaptive { source, .. } => source.notes(),
            Pictures::Program { .. } => Vec::new(),
        }
    }
}

impl Pictures {
    fn open(job: &SourceJob, resources: Resources, knob: Knob, most: Option<u64>) -> anyhow::Result<Self> {
        let seeds = seeds(job.seed);
        if let (SourceKind::Command(template), Knob::Threshold { .. }) = (&job.kind, knob) {
            let scene = job.scene.as_deref().map(Into::into);
            let command = ThresholdCommand::new(template, scene, job.size, resources.timeout)?;
            return Ok(Self::Program { command, most: most.unwrap_or(MOST_SPP), seeds });
        }
        let opened = job.open(resources)?;
        opened.warn();
        let Opened { source, .. } = opened;
        if let Knob::Threshold { .. } = knob {
            return Ok(Self::Adaptive { source, most, seeds });
        }
        let info = source.info();
        let film = Film::new(TileGrid::new(info.width, info.height, TILE)?);
        Ok(Self::Samples { source, film })
    }

    /// Albedo and normals, if the source has them.
    fn guides(&mut self, rays: u64, denoiser: &mut Oidn) -> anyhow::Result<Option<Guides>> {
        let (Self::Samples { source, .. } | Self::Adaptive { source, .. }) = self else { return Ok(None) };
        Ok(Guides::render(source, denoiser, rays)?)
    }

    /// Two pictures, or a part of them, each with this setting.
    pub fn pair(&mut self, each: f64, part: Option<Tile>, bar: &ProgressBar) -> anyhow::Result<Pair> {
        match self {
            Self::Samples { source, film } => grow(source.as_mut(), film, each as u64, part, bar),
            Self::Adaptive { source, most, seeds } => {
                let info = source.info();
                let mut one = |seed| {
                    let picture = source.adaptive(each, *most, seed, part)?;
                    picture.with_context(|| format!("{} has no noise threshold", info.name))
                };
                let [a, b] = [one(seeds[0])?, one(seeds[1])?];
                let size = part.map_or((info.width, info.height), |part| (part.width, part.height));
                let counts = a.counts.zip(b.counts).map(|(a, b)| [a, b]);
                Ok(Pair { size, pictures: [a.pixels, b.pixels], spp: None, counts })
            }
            Self::Program { command, most, seeds } => {
                let picture = |seed| command.render(each, *most, seed, part);
                let (a, b) = (picture(seeds[0])?, picture(seeds[1])?);
                if (a.width, a.height) != (b.width, b.height) {
                    bail!(
                        "the program wrote {}×{} and then {}×{} pixels",
                        a.width,
                        a.height,
                        b.width,
                        b.height
                    );
                }
                Ok(Pair {
                    size: (a.width, a.height),
                    pictures: [a.pixels, b.pixels],
                    spp: None,
                    counts: None,
                })
            }
        }
    }
}

/// Two seeds in 31 bits that follow from one; scattered, since some programs derive correlated random numbers from
/// neighbouring seeds.
fn seeds(seed: u64) -> [u32; 2] {
    let scatter = |n: u64| {
        // The finaliser of SplitMix64 (Steele et al. 2014)
        let mut z = seed.wrapping_mul(2).wrapping_add(n).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 33) as u32
    };
    [scatter(0), scatter(1)]
}

/// Samples the picture, or the tiles of a part of it, until each half has so many samples per pixel.
fn grow(
    source: &mut dyn Source,
    film: &mut Film,
    each: u64,
    part: Option<Tile>,
    bar: &ProgressBar,
) -> anyhow::Result<Pair> {
    let grid = film.grid();
    let part = part.unwrap_or(Tile { index: 0, x: 0, y: 0, width: grid.width(), height: grid.height() });
    let touches = |tile: &Tile| {
        let along = |a: usize, an: usize, b: usize, bn: usize| a < b + bn && b < a + an;
        along(tile.x, tile.width, part.x, part.width) && along(tile.y, tile.height, part.y, part.height)
    };
    let tiles: Vec<(Tile, u64)> = grid.tiles().filter(touches).map(|tile| (tile, 2 * each)).collect();
    fill(source, film, &tiles, |done| {
        bar.set_message(format!("{:.0} of {} samples per pixel", done * 2.0 * each as f64, 2 * each));
    })?;
    let mut whole = [0, 1].map(|_| vec![[0.0; 3]; grid.width() * grid.height()]);
    for (tile, _) in tiles {
        for pixel in tile.rows(grid.width()).flatten() {
            let [(a, _), (b, _)] = film.pixel_halves(tile.index, pixel);
            (whole[0][pixel], whole[1][pixel]) = (a, b);
        }
    }
    let pictures = whole.map(|picture| cut(part, grid.width(), &picture));
    Ok(Pair { size: (part.width, part.height), pictures, spp: Some(each as f64), counts: None })
}

/// A part of a picture of this width.
fn cut<T: Copy>(part: Tile, width: usize, picture: &[T]) -> Vec<T> {
    part.rows(width).flatten().map(|pixel| picture[pixel]).collect()
}

pub struct Judges<'a> {
    criterion: &'a TuneCriterion,
    params: Params,
    denoiser: Option<Oidn>,
    /// What was said of the pictures, each kind once.
    warned: Vec<StillWarning>,
}

impl<'a> Judges<'a> {
    pub fn begin(criterion: &'a TuneCriterion, params: Params, timeout: Duration) -> anyhow::Result<Self> {
        let denoiser = match criterion {
            TuneCriterion::Noise(_) => None,
            TuneCriterion::Denoised { device, .. } => {
                let oidn =
                    Oidn::start(FilterPlan { device: device.clone(), timeout, ..FilterPlan::default() })?;
                oidn.warnings().iter().for_each(|warning| note!("warning: {warning}"));
                Some(oidn)
            }
        };
        Ok(Self { criterion, params, denoiser, warned: Vec::new() })
    }

    /// How parts of a picture are displayed: as the whole.
    pub fn tone(&self, whole: &Judged) -> ToneMapping {
        match &self.params.tone_mapping {
            ToneMapping::Reinhard { white, .. } => {
                ToneMapping::ReinhardAt { exposure: whole.looked.display.exposure(), white: *white }
            }
            other => other.clone(),
        }
    }

    /// What the verdict is about, in words.
    pub fn said(&self) -> String {
        let viewing = &self.params.viewing;
        let film = viewing.frames_per_second().map(|rate| format!(", as a frame of {rate} a second"));
        let film = film.unwrap_or_default();
        match (self.criterion, &self.denoiser) {
            (TuneCriterion::Denoised { lost, .. }, Some(denoiser)) => format!(
                "at most {lost} JOD lost after {}{film}, by the vision model: nobody has been asked",
                denoiser.name()
            ),
            (TuneCriterion::Noise(oracle), _) if !film.is_empty() => {
                format!("for {} of people, {viewing}; people's thresholds come from stills", oracle.people())
            }
            (TuneCriterion::Noise(oracle), _) => {
                format!("for {} of people, {viewing}", oracle.people())
            }
            (TuneCriterion::Denoised { lost, .. }, None) => format!("at most {lost} JOD lost"),
        }
    }

    pub fn judge(
        &mut self,
        pair: Pair,
        guides: Option<&Guides>,
        crop: Option<&Crop>,
    ) -> anyhow::Result<Judged> {
        let Pair { size, pictures, spp, counts } = pair;
        let mut params = self.params.clone();
        if let Some(crop) = crop {
            params.tone_mapping = crop.tone.clone();
        }
        let guides = guides.map(|guides| crop.map_or_else(|| guides.clone(), |crop| guides.part(crop.tile)));
        let pair = PicturePair::new(size, pictures, spp.unwrap_or(128.0));
        let pair = pair.map_err(|error| match error {
            StillError::Same => anyhow::anyhow!(
                "two pictures of different seeds are the same: the renderer does not look at the seed, \
                 or the scene has no noise"
            ),
            other => other.into(),
        })?;
        let counts = counts.as_ref().map(|counts| counts.each_ref());
        let (mut looked, denoised) = match (self.criterion, &mut self.denoiser) {
            (TuneCriterion::Denoised { lost, .. }, Some(denoiser)) => {
                let wants = denoiser.wants();
                let (hits, clean) = match &guides {
                    Some(guides) => {
                        let [a, b] = guides.halves();
                        ([Some(a.clone()), Some(b.clone()), Some(guides.together())], guides.is_clean())
                    }
                    None => ([None, None, None], false),
                };
                let guided = |pixels, of: usize| {
                    let picture = NoisyPicture::new(size, pixels);
                    hits[of].as_ref().map_or(picture, |hits| picture.guided(hits, clean, wants))
                };
                let [a, b] = pair.halves();
                let [a, b] = denoiser.denoise_both([&guided(a, 0), &guided(b, 1)])?;
                let (error, mut looked) = DenoisedError::look(&pair, [&a, &b], *lost, &params, counts)?;
                looked.map = error.map_of_jods_lost(&VisionModel::new(&params.viewing))?;
                (looked, Some(denoiser.denoise(&guided(pair.mean(), 2))?))
            }
            (TuneCriterion::Noise(oracle), _) => (pair.look(oracle, &params, counts)?, None),
            (TuneCriterion::Denoised { .. }, None) => bail!("the denoiser was not started"),
        };
        for &warning in &looked.warnings {
            let known = |known: &StillWarning| discriminant(known) == discriminant(&warning);
            if !self.warned.iter().any(known) {
                note!("warning: {warning}");
                self.warned.push(warning);
            }
        }
        // In the whole picture
        let (x, y) = crop.map_or((0, 0), |crop| (crop.tile.x, crop.tile.y));
        looked.excess.place = looked.excess.place.map(|place| (place.0 + x, place.1 + y));
        let mean = pair.mean().to_vec();
        Ok(Judged { looked, size, mean, denoised, spp: spp.map(|each| 2.0 * each) })
    }
}
