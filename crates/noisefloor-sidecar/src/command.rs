//! Any program that renders into a file, as a source.

use crate::contents::contents;
use crate::error::{CommandError, RunFault};
use crate::picture_run::PictureRun;
use crate::renderer::DEFAULT_TIMEOUT;
use crate::template::{RunValues, Template};
use noisefloor::{
    Batch, ProgressiveSource, Request, SourceError, SourceInfo, Tile, source::SourceIdentity,
    text::printable, tile::check_image, watch::LightCheck,
};
use noisefloor_image::LinearImage;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Seeds are positive in 31 bits, which every program accepts.
const SEEDS: u64 = 1 << 31;

/// What a command is given. Made by [`CommandOptions::default`]; all fields can then be changed.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CommandOptions {
    /// The scene, for `{scene}`. Any file name, Unicode or not.
    pub scene: Option<PathBuf>,
    /// The seed from which the seeds of all runs follow.
    pub seed: u64,
    /// Width and height of the whole image in pixels; if `None`, one sample is rendered to determine them.
    pub size: Option<(usize, usize)>,
    /// Time limit for one run of the command.
    pub timeout: Duration,
}

impl Default for CommandOptions {
    /// No scene, seed 1, an unknown size, and [`DEFAULT_TIMEOUT`].
    fn default() -> Self {
        Self { scene: None, seed: 1, size: None, timeout: DEFAULT_TIMEOUT }
    }
}

/// A program that renders a scene into an EXR or PFM file, run once for each batch.
///
/// The command is a template with placeholders. It is split into words as a POSIX shell does, with quotes and
/// backslashes; no shell is run.
///
/// | placeholder | value |
/// |---|---|
/// | `{scene}` | the scene |
/// | `{seed}` | a number in 0…2³¹−1, different in every run; required |
/// | `{spp}` | samples per pixel; required |
/// | `{x0}`, `{x1}` | columns of the tile; **x1 is exclusive** |
/// | `{y0}`, `{y1}` | rows of the tile, from the top; **y1 is exclusive** |
/// | `{width}`, `{height}` | of the whole image |
/// | `{out}` | a path without extension in an empty folder, as in `{out}.exr`; required |
///
/// With `{x0}` the command renders tile by tile, and its picture is the tile or the whole image. Without it,
/// the command renders whole images, and single tiles cannot be requested. The one file that it writes beside
/// `{out}` is read as EXR or PFM, whatever its name. What the program leaves running when it ends is killed.
///
/// Random numbers must differ for different seeds; this is not checked. Use a filter one pixel wide.
#[derive(Debug)]
pub struct CommandSource {
    template: Template,
    options: CommandOptions,
    info: SourceInfo,
    /// Runs so far.
    runs: u64,
    light: LightCheck,
    identity: SourceIdentity,
}

impl CommandSource {
    /// Checks the template, and determines the size if it is not given.
    ///
    /// # Errors
    /// [`CommandError`] if the template is not a command or lacks a placeholder, or if the run that
    /// determines the size fails.
    pub fn new(template: &str, options: CommandOptions) -> Result<Self, CommandError> {
        let typed = template;
        let template = Template::renderer(template, options.scene.is_some())?;
        let stem = Path::new(template.program()).file_stem().unwrap_or_default().to_string_lossy();
        let info = SourceInfo::new(format!("command {}", printable(&stem)), 0, 0).with_aims(template.aims());
        let about = format!("command {typed}, seed {}", options.seed);
        let identity = match &options.scene {
            Some(scene) => contents(scene, about)
                .map_err(|source| CommandError::Scene { scene: scene.clone(), source })?,
            None => SourceIdentity::new(about),
        };
        let light = LightCheck::default();
        let mut source = Self { template, options, info, runs: 0, light, identity };
        let (width, height) = source.options.size.map_or_else(|| source.find_size(), Ok)?;
        check_image(width, height).map_err(|e| CommandError::Size(e.to_string()))?;
        (source.info.width, source.info.height) = (width, height);
        Ok(source)
    }

    /// The size of the picture that the command renders when asked for one sample, of one pixel if it can
    /// aim.
    fn find_size(&mut self) -> Result<(usize, usize), CommandError> {
        if self.template.has("width") || self.template.has("height") {
            return Err(CommandError::Size("the command needs it".to_owned()));
        }
        let (image, _) = self.run(&Tile { index: 0, x: 0, y: 0, width: 1, height: 1 }, 1)?;
        match (image.width, image.height) {
            (1, 1) if self.info.aims => {
                Err(CommandError::Size("the command renders only the tile".to_owned()))
            }
            size => Ok(size),
        }
    }

    /// Renders samples of a tile, or of the whole image if the command cannot aim. Returns the command that
    /// was run, too.
    fn run(&mut self, tile: &Tile, samples: u64) -> Result<(LinearImage, String), CommandError> {
        let run = PictureRun::new()?;
        let words = self.template.fill_run(&RunValues {
            scene: self.options.scene.as_deref(),
            seed: scatter(self.options.seed, self.runs),
            spp: samples,
            threshold: 0.0,
            tile: *tile,
            size: (self.info.width, self.info.height),
            out: &run.out(),
        });
        self.runs += 1;
        run.finish(&words, self.options.timeout)
    }

    /// One tile.
    fn aimed(&mut self, request: &Request) -> Result<Batch, CommandError> {
        let Request { tile, spp: samples, .. } = *request;
        let (image, command) = self.run(&tile, samples)?;
        let mean = if (image.width, image.height) == (tile.width, tile.height) {
            image.pixels
        } else {
            self.check_whole(&image, &tile, command)?;
            cut(&image, &tile)
        };
        let batch = Batch::new(tile, samples, mean);
        self.light.check(&batch.mean)?;
        Ok(batch)
    }

    /// All tiles from one picture.
    fn whole(&mut self, requests: &[Request]) -> Result<Vec<Batch>, CommandError> {
        let Some(samples) = requests.iter().map(|r| r.spp).max() else { return Ok(Vec::new()) };
        let SourceInfo { width, height, .. } = self.info;
        let all = Tile { index: 0, x: 0, y: 0, width, height };
        let (image, command) = self.run(&all, samples)?;
        self.check_whole(&image, &all, command)?;
        let mut batches = Vec::with_capacity(requests.len());
        for Request { tile, .. } in requests {
            let batch = Batch::new(*tile, samples, cut(&image, tile));
            self.light.check(&batch.mean)?;
            batches.push(batch);
        }
        Ok(batches)
    }

    fn check_whole(&self, image: &LinearImage, tile: &Tile, command: String) -> Result<(), CommandError> {
        if (image.width, image.height) == (self.info.width, self.info.height) {
            return Ok(());
        }
        let (size, got) = ((tile.width, tile.height), (image.width, image.height));
        Err(RunFault::Picture { size, got }.of(command))
    }
}

impl ProgressiveSource for CommandSource {
    fn info(&self) -> SourceInfo {
        self.info.clone()
    }

    /// The command, the scene, and what can be known of the files that it reads. Never fails.
    fn identity(&self) -> Result<SourceIdentity, SourceError> {
        Ok(self.identity.clone())
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let name = self.info.name.clone();
        let failed = |tile, cause: CommandError| {
            let (name, cause) = (name.clone(), Box::new(cause));
            SourceError::Failed { name, tile, cause }
        };
        if !self.info.aims {
            return self.whole(requests).map_err(|cause| failed(None, cause));
        }
        requests.iter().map(|r| self.aimed(r).map_err(|cause| failed(Some(r.tile.index), cause))).collect()
    }
}

fn cut(image: &LinearImage, tile: &Tile) -> Vec<noisefloor::Rgb> {
    tile.rows(image.width).flat_map(|row| image.pixels[row].iter().copied()).collect()
}

/// The seed of a run. Scattered, since some programs derive correlated random numbers from neighbouring
/// seeds; different in every run, since each step is a bijection of 31 bits.
fn scatter(seed: u64, run: u64) -> u64 {
    const MASK: u64 = SEEDS - 1;
    let key = (seed ^ (seed >> 31) ^ (seed >> 62)) & MASK;
    let mut x = run.wrapping_add(key.wrapping_mul(0x2545_f491)) & MASK;
    for odd in [0x7feb_352d_u64, 0x046c_a68b, 0x3c6e_f363] {
        x ^= x >> 16;
        x = x.wrapping_mul(odd) & MASK;
    }
    x ^ (x >> 15)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn seeds_never_come_twice_and_differ_by_seed() {
        let seeds: HashSet<u64> = (0..100_000).map(|run| scatter(7, run)).collect();
        assert!(seeds.len() == 100_000 && seeds.iter().all(|&seed| seed < SEEDS));
        let same = (0..1000).filter(|&run| scatter(7, run) == scatter(8, run)).count();
        assert_eq!(same, 0);
    }
}
