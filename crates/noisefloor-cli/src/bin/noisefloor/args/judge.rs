//! `noisefloor judge`.

use crate::judge::{DenoisedJudge, Judge, JudgeJob, NoiseJudge};
use clap::Args;
use noisefloor::{
    Viewing,
    evidence::{Evidence, Samples},
    tile::DEFAULT_TILE,
};
use noisefloor_cli::options::eyes::{EyesArgs, Seen};
use noisefloor_cli::options::layer::LayerArgs;
use noisefloor_cli::options::oracle::OracleArgs;
use noisefloor_cli::options::tone::ToneArgs;
use noisefloor_cli::options::values;
use noisefloor_cli::options::viewing::ViewingArgs;
use noisefloor_cli::refuse;
use noisefloor_cli::spell::JobPath;
use noisefloor_denoise::DEFAULT_JODS_LOST;
use noisefloor_farm::Frames;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Say for each tile of a picture whether people would see noise in it.
///
/// Noise shows where two renderings of one scene differ, so a second picture is needed: the same view with
/// other samples. Several are pooled. The verdict is on IMAGE only: its noise follows from the difference
/// and the sample counts. PNGs are judged as they are; EXRs are tone mapped first.
///
/// Two snapshots of one progressive rendering share samples. If the files say so (those of `render` do) or
/// the pictures show it, the verdict takes it into account, and a note says so. If neither tells, the
/// command asks for --nested or --independent, which also override what it finds.
///
/// With --denoised, the verdict is on what a denoiser makes of both pictures together: how many
/// just-objectionable differences (JOD) it has lost against the converged picture, bias included. Nobody has
/// been asked about denoised tiles: the limit is the vision model's.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor judge a.exr b.exr --spp 256 --spp 256                 two independent renderings
  noisefloor judge out/a/image.exr --against out/b/image.exr       of `render`: the files say the rest
  noisefloor judge 00100.png --spp 100 --against 00900.png --spp 900 --nested --heat-map verdict.png
  noisefloor judge a.exr --spp 64 --against b.exr --spp 64 --noise-map noise.png
  noisefloor judge a.exr --spp 64 --against b.exr --spp 64 --denoised a-denoised.exr b-denoised.exr
  noisefloor judge a.exr --spp 64 --against b.exr --spp 64 --json > verdicts.json
  noisefloor judge a.####.exr b.####.exr --spp 64 --spp 64 --frames 1-240 --check     a line a frame; exit code 3 if noise is seen")]
pub struct JudgeArgs {
    /// Picture to judge, PNG or EXR.
    #[arg(value_name = "IMAGE")]
    image: PathBuf,
    /// Samples per pixel: first of IMAGE, then of each --against, in their order [default: what the EXR
    /// files say, as those of `render --criterion spp:N` and of pbrt do].
    #[arg(long, alias = "samples", value_name = "N")]
    spp: Vec<f64>,
    /// The same as --against.
    #[arg(value_name = "AGAINST")]
    others: Vec<PathBuf>,
    /// Another rendering of the same view. Repeat for more.
    #[arg(long, value_name = "IMAGE")]
    against: Vec<PathBuf>,
    #[command(flatten)]
    layer: LayerArgs,
    /// The pictures are snapshots of one progressive rendering: the later one contains the samples of the
    /// earlier one.
    #[arg(long)]
    nested: bool,
    /// The pictures share no samples, whatever they look like.
    #[arg(long, conflicts_with = "nested")]
    independent: bool,
    /// Judge denoised pictures: what a denoiser has made of IMAGE, and of the one --against, each without a
    /// look at the other.
    #[arg(long, num_args = 2, value_names = ["IMAGE", "AGAINST"], conflicts_with_all = ["model", "threshold", "heat_map", "exr", "nested"])]
    denoised: Vec<PathBuf>,
    /// With --denoised: just-objectionable differences (JOD) that a tile may have lost; 19 of 20 that pass
    /// have lost less, so the estimate may be two thirds of that.
    #[arg(long, value_name = "JOD", requires = "denoised", default_value_t = DEFAULT_JODS_LOST, value_parser = values::jods)]
    lost: f64,
    #[command(flatten)]
    oracle: OracleArgs,
    #[command(flatten)]
    tone: ToneArgs,
    #[command(flatten)]
    viewing: ViewingArgs,
    #[command(flatten)]
    eyes: EyesArgs,
    /// Tile edge in pixels, 16…512.
    #[arg(long, default_value_t = DEFAULT_TILE, value_name = "PIXELS")]
    tile: usize,
    /// Threads [default: one a core].
    #[arg(long, value_name = "N", value_parser = values::threads)]
    threads: Option<NonZeroUsize>,
    /// Judge the frames of a sequence, 1-240 or 1,5,9-12, and say of each how many tiles have converged, and which is worst.
    /// The names of pictures and maps hold {frame}, #### or %04d in place of the number.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    frames: Option<Frames>,
    /// End with exit code 3 if a tile has not converged.
    #[arg(long)]
    check: bool,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Write the probabilities as a heat map over the picture.
    #[arg(long, value_name = "FILE.png")]
    heat_map: Option<PathBuf>,
    /// Write a map of the visible noise over the picture, in blocks of 8x8 pixels; with --denoised, of the
    /// JODs lost.
    #[arg(long, value_name = "FILE.png")]
    noise_map: Option<PathBuf>,
    /// Write the picture as linear EXR, with probability and visible noise (1 is just seen) as channels.
    #[arg(long, value_name = "FILE.exr")]
    exr: Option<PathBuf>,
}

impl JudgeArgs {
    pub fn check(mut self) -> anyhow::Result<JudgeJob> {
        // In the order in which --spp counts them
        self.against.splice(..0, std::mem::take(&mut self.others));
        if self.against.is_empty() {
            refuse!(
                "{}: one picture does not tell noise from texture, and what renderers write of samples or variance beside it \
                 does not say how visible it is; render the view again with another seed, and name that picture, too",
                self.image.display()
            );
        }
        if self.frames.is_some() {
            let maps = [&self.heat_map, &self.noise_map, &self.exr].into_iter().flatten();
            let mut names =
                std::iter::once(&self.image).chain(&self.against).chain(&self.denoised).chain(maps);
            if let Some(name) = names.find(|name| JobPath::from(*name).before_frame().is_none()) {
                refuse!(
                    "--frames: '{}' does not say where the number of the frame stands: write #### there",
                    name.display()
                );
            }
        }
        let pictures = 1 + self.against.len();
        let (by, viewing) = match <[PathBuf; 2]>::try_from(std::mem::take(&mut self.denoised)) {
            Ok(made) => {
                self.eyes.unused("--denoised")?;
                if pictures != 2 {
                    refuse!("--denoised compares two halves: give one picture with --against");
                }
                (Judge::Denoised(DenoisedJudge { made, lost: self.lost }), self.viewing.or_default())
            }
            Err(_) => self.noise()?,
        };
        if !self.spp.is_empty() && self.spp.len() != pictures {
            refuse!(
                "--spp is needed once for each picture: {} given for {pictures} pictures",
                self.spp.len()
            );
        }
        let samples = match (self.nested, self.independent) {
            (true, _) => Some(Samples::Nested),
            (_, true) => Some(Samples::Independent),
            _ => None,
        };
        let mut counts = self.spp.into_iter().map(Some).chain(std::iter::repeat(None));
        Ok(JudgeJob {
            image: (self.image, counts.next().flatten()),
            against: self.against.into_iter().zip(counts).collect(),
            by,
            layer: self.layer.layer,
            samples,
            tone: self.tone.check()?.load()?,
            viewing,
            tile: self.tile,
            threads: self.threads,
            json: self.json,
            noise_map: self.noise_map,
            frames: self.frames,
            check: self.check,
        })
    }

    /// Who judges the noise of pictures, and where they are seen.
    fn noise(&mut self) -> anyhow::Result<(Judge, Viewing)> {
        let Seen { oracle, viewing, audience } = self.eyes.look(&self.oracle, &self.viewing, None)?;
        if oracle.model().evidence() != Evidence::Halves {
            refuse!(
                "this model does not compare tiles with other samples, as `judge` does: use one that was trained on half buffers"
            );
        }
        if self.noise_map.is_some() && !oracle.maps_visible_noise() {
            refuse!(
                "--noise-map: a model with the {} descriptor has no map of visible noise; the bundled model has one",
                oracle.model().descriptor().name()
            );
        }
        let (heat_map, exr) = (self.heat_map.take(), self.exr.take());
        Ok((Judge::Noise(Box::new(NoiseJudge { oracle, audience, heat_map, exr })), viewing))
    }
}
