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
pub use race::{Course, CurvePoint, Entrant};

use crate::error::LabError;
use noisefloor::ProgressiveSource;
use noisefloor_denoise::Denoiser;

/// Lets the entrants watch one run of the source, and says what each took and left. With a `denoiser`, every picture is also looked at denoised, without
/// albedo and normals.
pub fn run(
    source: &mut dyn ProgressiveSource,
    entrants: Vec<Entrant>,
    course: Course<'_>,
    labels: Labels,
    mut denoiser: Option<&mut dyn Denoiser>,
) -> Result<(Comparison, Pictures), LabError> {
    let name = source.info().name;
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
