//! `noisefloor-lab compare`.

use crate::compare::{CompareJob, Named};
use anyhow::{Context, anyhow, bail};
use clap::Args;
use noisefloor::tile::DEFAULT_TILE;
use noisefloor::{Oracle, Params, Schedule, StoppingCriterion};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::options::denoiser::DenoiserChoice;
use noisefloor_cli::options::oracle::OracleArgs;
use noisefloor_cli::options::renderer::RendererArgs;
use noisefloor_cli::options::tone::ToneArgs;
use noisefloor_cli::options::values;
use noisefloor_cli::options::viewing::ViewingArgs;
use noisefloor_cli::refuse;
use noisefloor_denoise::{DenoisedQuality, Denoiser, Oidn};
use noisefloor_rivals::RIVALS;
use noisefloor_sidecar::FilterPlan;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Let stopping criteria watch one render, and compare what each one costs and what it leaves.
///
/// Each scene is rendered once, uniformly. Every criterion sees the same samples and takes those of a tile
/// until it stops it. The report sets beside uniform sampling what each criterion took, what that cost, and
/// how far its picture is from the converged one (relMSE, PSNR, FLIP, butteraugli).
///
/// Criteria: `oracle`; `spp:N`; `relative-error`, `dammertz`, `cycles`, `luxcore`, `vdp-stages`,
/// `vdp-first`, each with a constant of its own (`cycles:0.02`) or with a default: Blender's 0.01 for
/// `cycles`, and for the others the one that agrees with people on average. `cvvdp:JODS` stops a tile that
/// has lost at most so many JODs against the converged picture: a yardstick that no render has.
/// `denoised:JODS` stops a tile as `render --denoise --lost JODS` does.
///
/// `oracle:schedule=spaced:batch=10:min-spp=50` is the oracle with options of `render` in its words:
/// schedule, batch, min-spp and consecutive, as many of them as you like. `fine` is what
/// `render` does, schedule=spaced:batch=8:min-spp=16; without options it judges as often as the rivals
/// do. With spaced verdicts it renders by itself, from the same source and seed.
///
/// Writes into the output folder: index.html with everything (one file that opens without a server),
/// runs.csv, and for each scene curve.csv, tiles.csv, plots, crops with error
/// maps, the picture of every criterion, and the reference, which the next comparison of the same scene
/// uses again (--force).
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor-lab compare cornell-box glass-spheres --size 256x256 --tile 64
  noisefloor-lab compare hall/scene.xml --reference hall.exr --criteria oracle,cycles:0.01,dammertz
  noisefloor-lab compare cornell-box --criteria oracle,cycles,dammertz --sweep 6    the rivals at six more constants each
  noisefloor-lab compare hall/scene.xml --source mitsuba --max-spp 1000
  noisefloor-lab compare cornell-box --denoise oidn --criteria spp:64,spp:256,cycles,oracle,denoised:0.3")]
pub struct CompareArgs {
    /// Scenes, as for `render`.
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<OsString>,
    #[command(flatten)]
    renderer: RendererArgs,
    /// Output folder.
    #[arg(long, value_name = "DIR", default_value = "out/compare")]
    out: PathBuf,
    /// The criteria.
    #[arg(
        long,
        value_name = "NAME[:CONSTANT],…",
        value_delimiter = ',',
        default_value = "oracle,relative-error,dammertz,cycles,luxcore,vdp-stages,vdp-first"
    )]
    criteria: Vec<String>,
    /// Also run each criterion that is given without a constant at N other constants, from strict to lax.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=50))]
    sweep: u32,
    /// Also look at every picture as this denoiser leaves it, without albedo and normals: `oidn`. How good
    /// its worst tile then is, and the seconds, come into runs.csv, curve.csv and the page. Needed by the
    /// criterion `denoised:JODS`.
    #[arg(long, value_enum)]
    denoise: Option<DenoiserChoice>,
    #[command(flatten)]
    oracle: OracleArgs,
    #[command(flatten)]
    tone: ToneArgs,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS")]
    tile: usize,
    /// Samples per pixel between two verdicts on a tile.
    #[arg(long, default_value_t = 100, value_name = "SPP")]
    batch: u64,
    /// End the run at this many samples per pixel, even if criteria ask for more.
    #[arg(long, value_name = "SPP", default_value_t = 2000)]
    max_spp: u64,
    /// The converged picture, in linear light [default: rendered with --reference-spp].
    #[arg(long, value_name = "FILE.exr")]
    reference: Option<PathBuf>,
    /// Samples per pixel of a reference that is rendered.
    #[arg(long, value_name = "SPP", default_value_t = 8000)]
    reference_spp: u64,
    /// Viewing distance, for FLIP: pixels per degree of the field of view.
    #[arg(long, value_name = "N", default_value_t = 67.0)]
    pixels_per_degree: f64,
    #[command(flatten)]
    viewing: ViewingArgs,
    /// Overwrite the comparison that is in the output folder. A reference in it that is of this scene and
    /// these options is used again; any other is rendered anew.
    #[arg(long)]
    force: bool,
    /// No progress bar and no table.
    #[arg(long, short)]
    quiet: bool,
}

impl CompareArgs {
    /// A comparison that can begin.
    pub fn check(self) -> anyhow::Result<CompareJob> {
        if self.reference.is_some() && self.scenes.len() > 1 {
            refuse!("--reference is of one scene, but {} are given", self.scenes.len());
        }
        // What is wrong with a criterion is found before the reference is rendered.
        let oracle = self.oracle.check()?;
        let params = self.params(&oracle)?;
        let specs = self.specs();
        let (source, resources) = self.renderer.check(None)?;
        let denoiser = self.denoise.map(|_| shared_denoiser(resources.timeout)).transpose()?;
        let denoised = denoiser.clone();
        for spec in &specs {
            criterion(spec, &oracle, &params, denoised.as_ref())?;
        }
        Ok(CompareJob {
            scenes: self.scenes,
            source,
            resources,
            out: self.out,
            criteria: Box::new({
                let value = params.clone();
                move || specs.iter().map(|spec| criterion(spec, &oracle, &value, denoised.as_ref())).collect()
            }),
            denoiser: denoiser.map(|denoiser| Box::new(denoiser) as Box<dyn Denoiser>),
            params,
            batch: self.batch,
            reference: self.reference,
            reference_spp: self.reference_spp,
            pixels_per_degree: self.pixels_per_degree,
            earlier: Earlier::of(self.force, false),
            quiet: self.quiet,
        })
    }

    /// Session parameters, checked.
    fn params(&self, oracle: &Oracle) -> anyhow::Result<Params> {
        let params = Params::default()
            .with_tile(self.tile)
            .with_tone_mapping(self.tone.check()?.load()?)
            .with_viewing(self.viewing.of(oracle))
            .with_schedule(Schedule::Every { step: self.batch })
            .with_min_spp(Params::default().min_spp.min(self.batch))
            .with_max_spp(self.max_spp);
        params.check().with_context(|| {
            format!("--tile {}, --batch {}, --max-spp {}", self.tile, self.batch, self.max_spp)
        })?;
        Ok(params)
    }

    /// Every criterion that was asked for, and the same ones at other constants if a sweep was.
    fn specs(&self) -> Vec<String> {
        let mut all = Vec::new();
        for spec in &self.criteria {
            all.push(spec.clone());
            let Some(rival) = RIVALS.iter().find(|rival| rival.name == spec) else { continue };
            let (strict, lax) = rival.range;
            for i in 0..self.sweep {
                let place = (f64::from(i) + 0.5) / f64::from(self.sweep);
                let constant = strict * (lax / strict).powf(place);
                // Rounded, so that what is said is what was used
                all.push(format!("{}:{constant:.2e}", rival.name));
            }
        }
        all
    }
}

/// Open Image Denoise, for criteria and for whoever looks at their pictures.
type Shared = Arc<Mutex<Box<dyn Denoiser + Send>>>;

fn shared_denoiser(timeout: Duration) -> anyhow::Result<Shared> {
    let plan = FilterPlan { timeout, ..FilterPlan::default() };
    Ok(Arc::new(Mutex::new(Box::new(Oidn::start(plan)?))))
}

/// The criterion of a specification.
fn criterion(
    spec: &str,
    oracle: &Oracle,
    params: &Params,
    denoiser: Option<&Shared>,
) -> anyhow::Result<Named> {
    let mut params = params.clone();
    let (family, words) = spec.split_once(':').unwrap_or((spec, ""));
    let criterion: Box<dyn StoppingCriterion + Send> = match family {
        "oracle" => {
            params = oracle_params(words, params).with_context(|| spec.to_owned())?;
            Box::new(oracle.clone())
        }
        "denoised" => {
            let lost = values::jods(words).map_err(|error| anyhow!("{spec}: {error}"))?;
            let Some(denoiser) = denoiser else { bail!("{spec} needs --denoise oidn") };
            if let Schedule::Every { step } = params.schedule {
                params.schedule = Schedule::Growing { step };
            }
            Box::new(DenoisedQuality::new(Arc::clone(denoiser), lost))
        }
        _ => noisefloor_rivals::parse(spec)?,
    };
    Ok(Named { spec: spec.to_owned(), criterion, params })
}

/// The words of `oracle:batch=100:min-spp=50`.
fn oracle_params(words: &str, mut params: Params) -> anyhow::Result<Params> {
    let Schedule::Every { step: mut batch } = params.schedule else { bail!("criteria have one schedule") };
    let mut spaced = false;
    for word in words.split(':').filter(|word| !word.is_empty()) {
        let (name, value) = word.split_once('=').unwrap_or((word, ""));
        match (name, value, value.parse::<u32>()) {
            ("fine", "", _) => {
                (spaced, batch, params.min_spp) = (true, Schedule::STEP, Params::default().min_spp)
            }
            ("schedule", "spaced", _) => spaced = true,
            ("schedule", "every", _) => spaced = false,
            ("batch", _, Ok(step)) => batch = step.into(),
            ("min-spp", _, Ok(samples)) => params.min_spp = samples.into(),
            ("consecutive", _, Ok(verdicts)) => params.consecutive = verdicts,
            _ => refuse!(
                "{word:?} is none of fine, schedule=spaced, batch=100, min-spp=50 and consecutive=2, \
                 or of other numbers"
            ),
        }
    }
    let step = batch;
    params.schedule = if spaced { Schedule::Spaced { step } } else { Schedule::Every { step } };
    params.check()?;
    Ok(params)
}
