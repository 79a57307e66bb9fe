//! `noisefloor reference`.

use crate::reference::ReferenceJob;
use clap::Args;
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::options::renderer::RendererArgs;
use noisefloor_cli::refuse;
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
    scene: OsString,
    #[command(flatten)]
    renderer: RendererArgs,
    /// The picture in linear light; a PNG of what it looks like is written beside it [default:
    /// out/SCENE-reference.exr].
    #[arg(long, value_name = "FILE.exr")]
    out: Option<PathBuf>,
    /// Overwrite the picture if there is one of that name.
    #[arg(long)]
    force: bool,
    /// No progress bar and no summary.
    #[arg(long, short)]
    quiet: bool,
}

impl ReferenceArgs {
    pub fn check(self) -> anyhow::Result<ReferenceJob> {
        if let Some(out) = &self.out
            && out.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("exr"))
        {
            refuse!("{}: the reference is written as EXR, so its name must end in .exr", out.display());
        }
        let (source, resources) = self.renderer.check(Some(&self.scene))?;
        let earlier = Earlier::of(self.force, false);
        Ok(ReferenceJob { source, resources, out: self.out, earlier, quiet: self.quiet })
    }
}
