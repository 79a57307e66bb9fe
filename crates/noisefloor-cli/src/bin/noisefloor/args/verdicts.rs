//! `noisefloor render`: what stops a tile, and when it is judged.

use crate::job::{FIRST_DENOISED, FIRST_DENOISED_SAMPLES, Limits};
use clap::{Args, ValueEnum, ValueHint};
use noisefloor::{Audience, Params, Schedule};
use noisefloor_cli::options::{renderer::RendererArgs, values};
use noisefloor_cli::refuse;
use noisefloor_denoise::DenoisePasses;
use noisefloor_rivals::RivalSpec;

/// What stops a tile, and when it is judged.
#[derive(Debug, Args)]
pub struct VerdictArgs {
    /// What stops a tile: `oracle`, `spp:N` for N samples per pixel everywhere, or a criterion of
    /// `noisefloor-lab compare --help`.
    #[arg(
        long,
        default_value = "oracle",
        value_parser = criterion,
        value_hint = ValueHint::Other
    )]
    pub criterion: CriterionChoice,
    /// With --denoise: just-objectionable differences (JOD) that a tile may have lost when it stops; 19 of
    /// 20 have lost less, so it stops at an estimate of 1/1.2 of that, or of two thirds in pictures of fewer
    /// than 16 tiles. At 1, three of four people prefer the converged picture; the default is what zones had
    /// lost, on average, where people stopped seeing noise in them.
    #[arg(
        long,
        value_name = "JOD",
        requires = "denoise",
        default_value_t = DEFAULT_LOST,
        value_parser = values::jods
    )]
    pub lost: f64,
    /// With --denoise: the picture that is written is the mean of what the denoiser makes of it and of its mirror
    /// images, 4 in all; or, with 1, what it makes of the picture alone [default: 4, or 1 with the built-in renderer,
    /// which is fast]. The mean has less of what denoisers get wrong by chance; verdicts take that into account.
    #[arg(long, value_name = "1|4", requires = "denoise", value_parser = passes)]
    pub denoise_passes: Option<DenoisePasses>,
    /// For whom: `observers` (those of the training data), `art-students` (1.8 times the samples), a
    /// factor on samples, or a,b for T' = a T + b [default: see --eyes].
    #[arg(long, value_name = "WHO", value_parser = values::audience)]
    pub audience: Option<Audience>,
    /// No tile stops before this many samples per pixel [default: 16, or one batch with --batch; with
    /// --denoise 32 of the built-in renderer, in pictures of fewer than 131,072 pixels]. Below 100, only tiles stop whose noise is spread over many pixels, in
    /// pictures of two million samples. More find more of the light that is seldom found.
    #[arg(long, value_name = "SPP")]
    pub min_spp: Option<u64>,
    /// Every tile stops at this many samples per pixel [default: 10000; N with --criterion spp:N].
    #[arg(long, value_name = "SPP")]
    pub max_spp: Option<u64>,
    /// When tiles are judged: `spaced` by the samples that a tile is expected to need, or after `every`
    /// batch, as in the paper: tiles then stop about a fifth later in ordinary scenes.
    #[arg(
        long,
        value_enum,
        default_value_t = ScheduleChoice::Spaced
    )]
    pub schedule: ScheduleChoice,
    /// Samples per pixel between two verdicts on a tile, at the least [default: 8, more for renderers with
    /// patterns, or 100 with --schedule every; with --denoise 16, and half as many as a tile has, or more where
    /// few are open].
    #[arg(long, value_name = "SPP")]
    pub batch: Option<u64>,
    /// Stop a tile only after K verdicts of "converged" in a row, each a quarter more samples after the
    /// last.
    #[arg(long, default_value_t = 1, value_name = "K")]
    pub consecutive: u32,
    /// Tile edge in pixels, 16…512; below 64, verdicts on noise are less certain [default: 64; with --denoise 32 of the
    /// built-in renderer].
    #[arg(long, value_name = "PIXELS")]
    pub tile: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ScheduleChoice {
    Spaced,
    Every,
}

/// What a picture is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    Draft,
    Final,
}

/// Windows are what is judged, whatever the tiles, and in smaller tiles fewer samples go where no window asks for them:
/// tiles of 64 pixels take ×0.82 of what tiles of 128 take to the same worst window.
const TILE: usize = 64;
/// Denoised pictures are judged by squares of 64 pixels. Many tiles cost other renderers much.
const DENOISED_TILE: usize = 32;

/// A quarter of the samples: twice the noise.
const DRAFT: Audience = Audience { slope: 0.25, offset: 0.0 };
const DEFAULT_LOST: f64 = noisefloor_denoise::DEFAULT_JODS_LOST;

#[derive(Clone, Debug, PartialEq)]
pub enum CriterionChoice {
    Oracle,
    Fixed(u64),
    Rival(RivalSpec),
}

fn passes(text: &str) -> Result<DenoisePasses, String> {
    text.parse().ok().and_then(DenoisePasses::new).ok_or_else(|| "expected 1 or 4".into())
}

fn criterion(text: &str) -> Result<CriterionChoice, String> {
    match text.split_once(':') {
        None if text == "oracle" => Ok(CriterionChoice::Oracle),
        Some(("spp", n)) => match n.parse() {
            Ok(n) if n > 0 => Ok(CriterionChoice::Fixed(n)),
            _ => Err(format!("spp:{n} needs a positive whole number of samples, as in spp:1000")),
        },
        _ => match text.parse::<RivalSpec>() {
            Ok(spec) if spec.against_converged() => Err(format!(
                "{text} compares with the converged picture, which no render has; it is for `noisefloor-lab compare`"
            )),
            Ok(spec) => Ok(CriterionChoice::Rival(spec)),
            Err(error) => Err(format!("{error}; or `oracle`")),
        },
    }
}

impl VerdictArgs {
    /// When tiles of a renderer are judged, with or without a denoiser; for whom, if no audience was typed.
    pub fn limits(
        &self,
        denoise: bool,
        renderer: &RendererArgs,
        preset: Option<Preset>,
        otherwise: Audience,
    ) -> anyhow::Result<Limits> {
        let audience = self.audience.unwrap_or(otherwise);
        let step = |default: u64| self.batch.unwrap_or(default);
        let schedule = match (denoise, self.schedule) {
            (true, _) => Schedule::Growing { step: step(16) },
            (false, ScheduleChoice::Spaced) => Schedule::Spaced { step: step(renderer.step()) },
            (false, ScheduleChoice::Every) => Schedule::Every { step: step(100) },
        };
        let draft = preset == Some(Preset::Draft);
        // With steps that were asked for, or that a denoiser has, the first one is a verdict
        let first = match self.batch {
            None if denoise && renderer.has_fewer_pixels(FIRST_DENOISED_SAMPLES / step(16)) => FIRST_DENOISED,
            _ if denoise => 0,
            Some(_) => 0,
            None => Params::default().min_spp,
        };
        let max_spp = match &self.criterion {
            CriterionChoice::Oracle | CriterionChoice::Rival(_) => {
                self.max_spp.unwrap_or(Params::default().max_spp)
            }
            // Exactly this many, not the next multiple of the batch
            CriterionChoice::Fixed(samples) => self.max_spp.map_or(*samples, |most| most.min(*samples)),
        };
        let last = preset == Some(Preset::Final);
        let limits = Limits {
            tile: self.tile.unwrap_or(if denoise && renderer.is_built_in() { DENOISED_TILE } else { TILE }),
            schedule,
            min_spp: self.min_spp.unwrap_or(first.min(max_spp)),
            max_spp,
            consecutive: if last { self.consecutive.max(2) } else { self.consecutive },
            audience: if draft { audience.then(DRAFT) } else { audience },
        };
        match limits.params(Params::default()).check() {
            Ok(()) => Ok(limits),
            Err(error) => refuse!("{error}"),
        }
    }
}
