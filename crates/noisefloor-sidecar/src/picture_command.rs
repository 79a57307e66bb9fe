//! A program that turns one picture into another.

use crate::error::{CommandError, RunFault};
use crate::picture_run::PictureRun;
use crate::template::Template;
use noisefloor_image::{LinearImage, RenderLayers, write_exr};
use std::time::Duration;

/// A program that reads a linear EXR and writes another picture of the same size, for example a denoiser.
///
/// The command is split into words as a POSIX shell does, with quotes and backslashes; no shell is run. Both
/// placeholders are required: `{in}`, the path of an EXR, and `{out}`, a path without extension in an empty
/// folder, as in `{out}.exr`. The one file that it writes there is read as EXR or PFM.
#[derive(Debug)]
pub struct PictureCommand {
    template: Template,
    timeout: Duration,
}

impl PictureCommand {
    /// Checks the template; a run may take `timeout`.
    ///
    /// # Errors
    /// [`CommandError::Template`] if it is not a command or lacks a placeholder.
    pub fn new(template: &str, timeout: Duration) -> Result<Self, CommandError> {
        Ok(Self { template: Template::parse(template, &["in", "out"], &["in", "out"])?, timeout })
    }

    /// What the program makes of a picture.
    ///
    /// # Errors
    /// [`CommandError`] if it fails, or writes no picture, one of another size, or one that is not finite.
    pub fn apply(&self, image: &LinearImage) -> Result<LinearImage, CommandError> {
        let run = PictureRun::new()?;
        let (given, out) = (run.input(), run.out());
        write_exr(&given, &RenderLayers::rgb(image.width, image.height, &image.pixels))?;
        let value = |name: &str| if name == "in" { given.clone() } else { out.clone() };
        let words = self.template.fill(|name| value(name).into_os_string());
        let (made, command) = run.finish(&words, self.timeout)?;
        let (size, got) = ((image.width, image.height), (made.width, made.height));
        if got != size {
            return Err(RunFault::Resized { size, got }.of(command));
        }
        if !made.pixels.iter().flatten().all(|c| c.is_finite()) {
            return Err(RunFault::NotFinite.of(command));
        }
        Ok(made)
    }
}
