//! What a render is, as a value: arguments, frames, farm plans and shards are made of it.

use noisefloor::viewing::Viewing;
use noisefloor::{Audience, FixedSpp, Oracle, Params, People, Schedule, StoppingCriterion};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::options::oracle::load_model;
use noisefloor_cli::options::tone::Tone;
use noisefloor_cli::options::viewing::judged_by;
use noisefloor_cli::sources::{Resources, SourceJob};
use noisefloor_cli::spell::JobPath;
use noisefloor_denoise::DenoisePasses;
use noisefloor_rivals::RivalSpec;
use noisefloor_sidecar::Device;
use serde::{Deserialize, Serialize};
use std::net::SocketAddr;
use std::time::Duration;

/// The first verdict on denoised halves of the built-in renderer, in samples per pixel, where the first step has fewer samples of the
/// picture than the second number: hardly a tile is let go then, since nothing may have met its light.
pub const FIRST_DENOISED: u64 = 32;
pub const FIRST_DENOISED_SAMPLES: u64 = 1 << 21;

/// What is rendered, who stops it, and until when: all that picture and stops depend on. Values are
/// checked; what it names is read when it is set up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderJob {
    pub source: SourceJob,
    pub criterion: CriterionJob,
    pub tone: Tone,
    /// By default where the model was trained.
    pub viewing: Option<Viewing>,
    /// Of a film that the picture is a frame of, if the viewing conditions do not say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_per_second: Option<f64>,
    pub limits: Limits,
}

/// Who stops the tiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CriterionJob {
    Oracle {
        /// By default the bundled one.
        model: Option<JobPath>,
        people: People,
        /// How much the thresholds of these people scatter, where they were measured.
        #[serde(default)]
        scatter: Option<f64>,
    },
    Spp(u64),
    /// By the picture that Open Image Denoise makes, of which a tile may lose so many JODs.
    Denoised {
        lost: f64,
        /// Of the finished picture.
        passes: DenoisePasses,
        /// What denoises.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        device: Option<Device>,
    },
    Rival(RivalSpec),
}

/// When tiles are judged, and what ends them; see [`Params`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    pub tile: usize,
    pub schedule: Schedule,
    pub min_spp: u64,
    pub max_spp: u64,
    pub consecutive: u32,
    pub audience: Audience,
}

/// A job with everything read that it names, the scene excepted.
pub struct Ready {
    pub params: Params,
    pub oracle: Option<Oracle>,
}

impl RenderJob {
    /// The job of a frame of a sequence.
    #[must_use]
    pub fn of_frame(&self, frame: i32) -> Self {
        Self { source: self.source.of_frame(frame), ..self.clone() }
    }

    /// The same from whatever folder it is rendered.
    pub fn absolute(&self) -> anyhow::Result<Self> {
        let mut all = Self { source: self.source.absolute()?, tone: self.tone.absolute()?, ..self.clone() };
        if let CriterionJob::Oracle { model: Some(model), .. } = &mut all.criterion {
            *model = model.absolute()?;
        }
        Ok(all)
    }

    pub fn read(&self) -> anyhow::Result<Ready> {
        let oracle = match &self.criterion {
            CriterionJob::Oracle { model, people, scatter } => {
                let oracle = Oracle::new(load_model(model.as_deref())?, *people);
                Some(match scatter {
                    Some(scatter) => oracle.with_scatter(*scatter),
                    None => oracle,
                })
            }
            _ => None,
        };
        let still =
            self.viewing.or(oracle.as_ref().map(|oracle| oracle.model().viewing())).unwrap_or_default();
        let viewing = match self.frames_per_second {
            Some(rate) => still.with_frames_per_second(Some(rate))?,
            None => still,
        };
        if let Some(oracle) = &oracle {
            judged_by(Some(viewing), oracle)?;
        }
        let displayed = Params::default().with_viewing(viewing).with_tone_mapping(self.tone.load()?);
        let params = self.limits.params(displayed);
        params.check()?;
        Ok(Ready { params, oracle })
    }
}

impl Limits {
    /// The parameters of a session that is displayed as `params` says.
    pub fn params(&self, mut params: Params) -> Params {
        let Self { tile, schedule, min_spp, max_spp, consecutive, audience } = *self;
        (params.tile, params.schedule) = (tile, schedule);
        (params.min_spp, params.max_spp) = (min_spp, max_spp);
        (params.consecutive, params.audience) = (consecutive, audience);
        params
    }
}

impl CriterionJob {
    /// The criterion; none if it needs a denoiser.
    pub fn of(&self, oracle: Option<&Oracle>) -> Option<Box<dyn StoppingCriterion + Send>> {
        match (self, oracle) {
            (Self::Spp(spp), _) => Some(Box::new(FixedSpp(*spp))),
            (Self::Rival(spec), _) => Some(spec.criterion()),
            (_, oracle) => Some(Box::new(oracle?.clone())),
        }
    }
}

/// How often the user wants a render to be saved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Autosave {
    /// Only at the end.
    Never,
    /// After each pause of this length, whatever it costs.
    Every(Duration),
    /// After half a minute, or as soon as saving takes 2 % of the time.
    Paced,
}

/// One run of a render: the job, and what picture and stops do not depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RenderRun {
    pub job: RenderJob,
    pub resources: Resources,
    pub out: Option<JobPath>,
    /// For everything, from the start of the command to the last file.
    pub time: Option<Duration>,
    pub against: Option<JobPath>,
    pub autosave: Autosave,
    pub earlier: Earlier,
    pub quiet: bool,
    /// Address of a viewer.
    pub tev: Option<String>,
    pub watch: Option<WatchPage>,
    /// How many places are rendered again afterwards.
    pub audit: Option<usize>,
    /// Whether the exit code tells of an audit.
    pub check: bool,
}

/// Where to serve a page with the picture so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WatchPage {
    pub address: SocketAddr,
    /// Names that browsers may use beside addresses.
    pub hosts: Vec<String>,
}
