//! `noisefloor metrics`.

use clap::Args;
use noisefloor_cli::options::layer::LayerArgs;
use noisefloor_cli::options::tone::ToneArgs;
use noisefloor_cli::options::viewing::ViewingArgs;
use std::path::PathBuf;

/// Say how visibly a picture differs from its reference, by published metrics.
///
/// ColorVideoVDP (Mantiuk et al. 2024) predicts what people see on a given display, in just-objectionable
/// differences (JOD): 10 is no visible difference; at 9, three of four people prefer the reference. Beside
/// it stand PSNR of display values and relMSE of linear radiance, and, in builds with the feature
/// `metrics`, FLIP and butteraugli.
///
/// Both pictures are EXR or PFM, or both PNG. PNGs are compared as they are; the others are tone mapped
/// first, with the exposure of REFERENCE. ColorVideoVDP goes by --viewing, and FLIP by its pixels per
/// degree; butteraugli assumes 80 cd/m² whatever it says.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor metrics out/a/image.exr reference.exr
  noisefloor metrics a.png b.png --viewing standard_4k --map difference.png
  noisefloor metrics a.png b.png --viewing desk,distance=1.2 --json
  noisefloor metrics a.exr b.exr --tone-mapping srgb --exposure 2

Values (--json has the same keys):
  cvvdp_jod          ColorVideoVDP 0.5.7: 10 is no visible difference
  flip               mean FLIP error, 0 to 1 (feature metrics)
  butteraugli        largest butteraugli; below 1 pictures look the same (feature metrics)
  butteraugli_norm3  its 3-norm over the picture (feature metrics)
  psnr               in dB; null if the pictures are equal
  rel_mse            mean of (x - r)^2 / (r^2 + 0.01)")]
pub struct MetricsArgs {
    /// Picture to compare: EXR, PFM or PNG.
    #[arg(value_name = "IMAGE")]
    pub image: PathBuf,
    /// What it should look like, of the same size and kind.
    #[arg(value_name = "REFERENCE")]
    pub reference: PathBuf,
    #[command(flatten)]
    pub layer: LayerArgs,
    #[command(flatten)]
    pub viewing: ViewingArgs,
    #[command(flatten)]
    pub tone: ToneArgs,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
    /// Write where ColorVideoVDP sees differences, in JODs lost, over the picture.
    #[arg(long, value_name = "FILE.png")]
    pub map: Option<PathBuf>,
    /// Write the map of FLIP. (Needs a build with the feature `metrics`, and so does the next one.)
    #[arg(long, value_name = "FILE.png")]
    pub flip_map: Option<PathBuf>,
    /// Write the map of butteraugli.
    #[arg(long, value_name = "FILE.png")]
    pub butteraugli_map: Option<PathBuf>,
}
