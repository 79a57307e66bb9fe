//! `noisefloor reference`.

use clap::Args;
use noisefloor_cli::options::renderer::RendererArgs;
use std::ffi::OsString;
use std::path::PathBuf;

/// Render the quick noise-free reference of a scene: direct light, and its reflections in mirrors and glass.
///
/// This is the ray-traced picture that Takouachet et al. compare noisy tiles with. Each part takes samples
/// until its own noise is far below what people see. Light that diffuse surfaces scattered on its way is
/// missing, so this is not the converged picture.
///
/// If a corpus has one as reference.exr beside its pictures, `train` and `evaluate` can use it with
/// `--evidence reference`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor reference glass-spheres --size 512x512
  noisefloor reference hall/scene.xml --out corpus/hall/reference.exr
  noisefloor-lab evaluate --corpus corpus --evidence reference")]
pub struct ReferenceArgs {
    /// Scene, as for `render`.
    #[arg(value_name = "SCENE")]
    pub scene: OsString,
    #[command(flatten)]
    pub renderer: RendererArgs,
    /// The picture in linear light; a PNG of what it looks like is written beside it [default:
    /// out/SCENE-reference.exr].
    #[arg(long, value_name = "FILE.exr")]
    pub out: Option<PathBuf>,
    /// Overwrite the picture if there is one of that name.
    #[arg(long)]
    pub force: bool,
    /// No progress bar and no summary.
    #[arg(long, short)]
    pub quiet: bool,
}
