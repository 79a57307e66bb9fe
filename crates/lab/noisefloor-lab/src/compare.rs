//! Criteria side by side on one run.
//!
//! The scene is rendered once, uniformly. Every criterion sees the same samples and takes those of a tile
//! until it stops it. Its samples, their cost, and the distance of its picture from the converged one are
//! compared with uniform sampling.

mod costs;
mod denoising;
mod files;
mod kept;
mod outcome;
mod page;
mod pictures;
mod plots;
mod quality;
mod race;

pub use denoising::AfterDenoising;
pub use files::{write_page, write_scene};
pub use kept::{Converged, ReferenceJob, render_reference};
pub use outcome::{AgainstUniform, Comparison, CriterionRun, Labels, Taken, TileStop};
pub use page::{page, section};
pub use pictures::{Crop, Pictures};
pub use plots::{Cost, plot};
pub use quality::Quality;
pub use race::{CurvePoint, Entrant};

use crate::advance::Watch;
use crate::error::LabError;
use noisefloor::{Params, ProgressiveSource, Rgb};
use noisefloor_denoise::Denoiser;
use noisefloor_vision::VisionModel;
use race::Course;
use std::sync::atomic::AtomicBool;

#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// Tiles, tone mapping, viewing conditions and the largest number of samples.
    pub params: &'a Params,
    /// Samples per pixel between two verdicts.
    pub batch: u64,
    /// The converged picture: linear radiance, row-major, as many pixels as the source renders.
    pub reference: &'a [Rgb],
    /// How far people are from the screen, for FLIP: pixels in a degree of their view.
    pub pixels_per_degree: f64,
}

/// Lets the entrants watch one run of the source, and says what each took and left. Setting `cancel` ends
/// the run after the batch that is under way. With a `denoiser`, every picture is also looked at denoised, without
/// albedo and normals.
pub fn run(
    source: &mut dyn ProgressiveSource,
    entrants: Vec<Entrant>,
    setting: Setting<'_>,
    labels: Labels,
    mut denoiser: Option<&mut dyn Denoiser>,
    cancel: &AtomicBool,
    watch: Watch<'_>,
) -> Result<(Comparison, Pictures), LabError> {
    let name = source.info().name;
    let course = Course {
        params: setting.params,
        step: setting.batch.div_ceil(2),
        truth: setting.reference,
        pixels_per_degree: setting.pixels_per_degree,
        vision: VisionModel::new(&setting.params.viewing),
        cancel,
        watch,
    };
    let (race, yardstick) = course.run(source, entrants, &mut denoiser)?;
    let seen = race.entrants.iter().map(|entrant| pictures::Seen::new(entrant, &yardstick));
    let seen: Vec<pictures::Seen<'_>> = seen.collect::<Result<_, _>>()?;
    let flips: Vec<Vec<f64>> = seen.iter().map(|seen| yardstick.flip_of_tiles(&seen.errors)).collect();
    let mut comparison = Comparison::new(labels, name, &race, &yardstick, &flips)?;
    if let Some(denoiser) = denoiser {
        for (run, entrant) in comparison.runs.iter_mut().zip(&race.entrants) {
            run.denoised = Some(AfterDenoising::of(&entrant.film().image(), denoiser, &yardstick)?);
        }
    }
    Ok((comparison, Pictures::new(&seen, &yardstick)))
}
