//! A render in a few lines, for people.

use super::{CHECKPOINT, Output, open_for, typical_threshold, uniform_samples};
use crate::job::CriterionJob;
use noisefloor::{Audience, Session, criterion::OpenFor, display::luminance, driver::Clock};
use noisefloor_cli::say::{NotSaid, say};
use noisefloor_cli::sources::Source;
use noisefloor_ptwne::ReferenceNoise;

impl Output {
    /// Says what came of the render.
    pub fn summarise(&self, session: &Session, clock: Clock, source: &dyn Source) -> Result<(), NotSaid> {
        self.say_stops(session)?;
        self.say_denoised(session)?;
        say!(
            "{:.1} s, of which {:.2} s ({:.2} %) in the oracle",
            clock.total_seconds,
            clock.criterion_seconds,
            100.0 * clock.criterion_seconds / clock.total_seconds.max(1e-9),
        )?;
        let counts = source.counts();
        for (count, what) in [
            (session.film().rejected(), "were not finite and were left out"),
            (session.negative_samples(), "were negative on average over their batch"),
            (counts.map_or(0, |c| c.dropped), "were not finite and counted as black"),
            (counts.map_or(0, |c| c.clamped), "were brighter than --clamp and scaled down"),
        ] {
            if count > 0 {
                say!("{count} samples {what}")?;
            }
        }
        if let Some(noise) = source.reference_noise() {
            say_noise(noise)?;
        }
        say!("written to {}", self.folder())?;
        if self.path(CHECKPOINT).exists() {
            say!("to continue, repeat the command with --resume")?;
        }
        Ok(())
    }

    fn say_stops(&self, session: &Session) -> Result<(), NotSaid> {
        let grid = session.film().grid();
        let samples = session.film().total_samples() as f64;
        let spp: Vec<u64> = session.stops().map(|s| s.spp).collect();
        let satisfied = session.stops().filter(|s| s.reason.is_satisfied()).count();
        // A count has looked at no noise
        let counts = session.criterion().only_counts();
        let as_wanted = if counts { "have the samples that were asked for" } else { "converged" };
        let (least, most) = (spp.iter().min().unwrap_or(&0), spp.iter().max().unwrap_or(&0));
        let range = if least == most { format!("{most}") } else { format!("{least} to {most}") };
        say!(
            "{satisfied} of {} tiles {as_wanted}, after {range} samples per pixel ({:.0} on average: \
             {:.0} % of uniform rendering at {most})",
            spp.len(),
            samples / (grid.width() * grid.height()) as f64,
            100.0 * samples / uniform_samples(session).max(1) as f64,
        )?;
        let audience = session.params().audience;
        if audience != Audience::TRAINED && !counts {
            let Audience { slope, offset } = audience;
            let more = if offset == 0.0 { String::new() } else { format!(" {offset:+}") };
            say!("tiles stop at {slope:.2} times the samples that the model's observers need{more}")?;
        }
        if let Some(rate) = session.params().viewing.frames_per_second().filter(|_| !counts) {
            say!(
                "judged for {rate} frames a second, by the vision model; people's thresholds come from stills"
            )?;
        }
        if let Some(threshold) = typical_threshold(session) {
            let stop = match self.job.criterion {
                CriterionJob::Oracle { people, .. } => {
                    format!("; tiles stop where {people} of them see none")
                }
                _ => String::new(),
            };
            say!(
                "in the typical tile, 10 % of people see no noise from {} samples per pixel on, \
                 90 % from {}{stop}",
                threshold.low,
                threshold.high
            )?;
        }
        if let Some(share) = session.share_in_picture() {
            say!("{:.0} % of people see no noise anywhere in the picture", 100.0 * share)?;
        }
        self.say_open_for(session)?;
        let unfamiliar = session.stops().filter(|s| s.unfamiliar).count();
        if unfamiliar > 0 {
            say!(
                "tiles with texture or light unlike any that the model was tested on: {unfamiliar}; \
                 their verdicts are less certain, and take up to twice the samples for it"
            )?;
        }
        Ok(())
    }

    /// Says what keeps tiles open, where that is not their noise in more than a tenth of them.
    fn say_open_for(&self, session: &Session) -> Result<(), NotSaid> {
        let (counts, tiles) = (open_for(session), session.film().grid().len());
        let other =
            counts.iter().filter(|(why, _)| **why != OpenFor::Noise).map(|(_, count)| count).sum::<usize>();
        if session.criterion().only_counts() || other * 10 <= tiles {
            return Ok(());
        }
        for (&why, count) in &counts {
            match why {
                OpenFor::Exposure => say!(
                    "{count} of {tiles} tiles wait for the exposure, which so few samples do not tell yet; --exposure sets one"
                )?,
                OpenFor::UnmetLight => {
                    let dot = brightest_find(session).map(|(x, y, share)| {
                        format!("; one dot at ({x}, {y}) holds {:.0} % of it", 100.0 * share)
                    });
                    say!(
                        "{count} of {tiles} tiles wait for light that few samples have met elsewhere, \
                         and that would be seen in them{}",
                        dot.unwrap_or_default()
                    )?;
                }
                OpenFor::FewSamples => say!(
                    "{count} of {tiles} tiles wait for more samples: of light that one in {} meets, these may have met none",
                    session.film().total_samples()
                )?,
                OpenFor::Doubt => {
                    say!("{count} of {tiles} tiles wait since the samples are doubted: see the warnings")?
                }
                _ => (),
            }
        }
        Ok(())
    }
}

/// The pixel that has most of the light which one half alone has met, and its share of all of that.
fn brightest_find(session: &Session) -> Option<(usize, usize, f64)> {
    let (film, width) = (session.film(), session.film().grid().width());
    let found = |(tile, pixel): (usize, usize)| {
        let [a, b] = film.pixel_halves(tile, pixel).map(|(mean, _)| f64::from(luminance(mean)));
        ((a - b).abs(), pixel)
    };
    let pixels =
        film.grid().tiles().flat_map(|tile| tile.rows(width).flatten().map(move |pixel| (tile.index, pixel)));
    let (all, (most, pixel)) = pixels
        .map(found)
        .fold((0.0, (0.0, 0)), |(all, most), one| (all + one.0, if one.0 > most.0 { one } else { most }));
    (most > 0.0).then(|| (pixel % width, pixel / width, most / all))
}

/// What a reference is like.
pub fn say_noise(noise: &ReferenceNoise) -> Result<(), NotSaid> {
    say!(
        "the reference took {:.0} samples a pixel; deviation of its noise mask {:.2}/255, {:.2}/255 in its worst block",
        noise.samples,
        255.0 * noise.deviation(),
        255.0 * noise.worst(),
    )?;
    if noise.unsettled > 0 {
        say!(
            "warning: {} of {} blocks of the reference are noisier than it promises, so tiles there may stop too late; \
             a model trained on half buffers needs no reference",
            noise.unsettled,
            noise.deviations.len()
        )?;
    }
    Ok(())
}
