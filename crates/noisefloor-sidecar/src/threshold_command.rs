//! Any program that samples until a noise threshold of its own.

use crate::error::{CommandError, RunFault};
use crate::picture_run::PictureRun;
use crate::template::{RunValues, Template};
use noisefloor::Tile;
use noisefloor_image::LinearImage;
use std::path::PathBuf;
use std::time::Duration;

/// A program that renders a whole picture until a noise threshold, into an EXR or PFM file.
///
/// The command is a template, split into words as a POSIX shell does; no shell is run. `{threshold}`, `{seed}` (a
/// number in 0…2³¹−1) and `{out}` (a path without extension, in an empty folder) are required; `{spp}`, the most
/// samples per pixel, `{scene}`, `{width}` and `{height}` are optional. So are `{x0}`, `{y0}`, `{x1}` and `{y1}`, the part
/// that is wanted, the last two exclusive; the picture may be the part or the whole.
#[derive(Debug)]
pub struct ThresholdCommand {
    template: Template,
    scene: Option<PathBuf>,
    size: Option<(usize, usize)>,
    timeout: Duration,
}

impl ThresholdCommand {
    /// Checks the template; a run may take `timeout`.
    ///
    /// # Errors
    /// [`CommandError::Template`] if it is not a command or lacks a placeholder, [`CommandError::Size`] if it needs
    /// a size that is not given.
    pub fn new(
        template: &str,
        scene: Option<PathBuf>,
        size: Option<(usize, usize)>,
        timeout: Duration,
    ) -> Result<Self, CommandError> {
        let part = ["x0", "y0", "x1", "y1"];
        let known = [&["scene", "threshold", "spp", "seed", "width", "height", "out"][..], &part].concat();
        let required: &[&str] = &["threshold", "seed", "out", "x0", "y0", "x1", "y1"];
        let parts = Template::parse(template, &known, &[])?.has("x0");
        let parsed = Template::parse(template, &known, if parts { required } else { &required[..3] })?;
        if size.is_none() && (parts || parsed.has("width") || parsed.has("height")) {
            return Err(CommandError::Size("the command needs it".to_owned()));
        }
        Ok(Self { template: parsed, scene, size, timeout })
    }

    /// Renders until the threshold, with at most so many samples per pixel; a part of the picture, if the template has
    /// `{x0}`.
    ///
    /// # Errors
    /// [`CommandError`] if the program fails, or writes no picture, one that is not finite, or one of neither size.
    pub fn render(
        &self,
        threshold: f64,
        most: u64,
        seed: u32,
        part: Option<Tile>,
    ) -> Result<LinearImage, CommandError> {
        let run = PictureRun::new()?;
        let (out, (width, height)) = (run.out(), self.size.unwrap_or_default());
        let wanted = part.unwrap_or(Tile { index: 0, x: 0, y: 0, width, height });
        let words = self.template.fill_run(&RunValues {
            scene: self.scene.as_deref(),
            seed: seed.into(),
            spp: most,
            threshold,
            tile: wanted,
            size: (width, height),
            out: &out,
        });
        let (made, command) = run.finish(&words, self.timeout)?;
        if !made.pixels.iter().flatten().all(|c| c.is_finite()) {
            return Err(RunFault::NotFinite.of(command));
        }
        let Some(part) = part else { return Ok(made) };
        if (made.width, made.height) == (width, height) {
            let pixels = part.rows(width).flatten().map(|pixel| made.pixels[pixel]).collect();
            return Ok(LinearImage { width: part.width, height: part.height, pixels });
        }
        if (made.width, made.height) != (part.width, part.height) {
            let (got, wanted) = ((made.width, made.height), (part.width, part.height));
            return Err(CommandError::Size(format!(
                "the program wrote {got:?} pixels instead of {wanted:?}"
            )));
        }
        Ok(made)
    }
}
