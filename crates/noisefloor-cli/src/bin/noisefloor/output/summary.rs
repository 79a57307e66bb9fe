//! A render in a few lines, for people.

use super::report::{open_for, typical_threshold, uniform_samples};
use super::{CHECKPOINT, Output};
use crate::job::CriterionJob;
use noisefloor::{
    Audience, Rgb, Session, Tile,
    criterion::OpenFor,
    display::{Display, luminance},
    driver::Clock,
};
use noisefloor_cli::say::{NotSaid, say};
use noisefloor_cli::sources::Source;
use noisefloor_ptwne::ReferenceNoise;

/// Edge of the window in which people look for noise, in degrees.
const WINDOW: f64 = 0.75;

impl Output {
    /// Says what came of the render.
    pub fn summarise(&self, session: &Session, clock: Clock, source: &dyn Source) -> Result<(), NotSaid> {
        self.say_stops(session)?;
        self.denoised.as_ref().map_or(Ok(()), |denoised| denoised.say(session))?;
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
            let stop = match self.about.job.criterion {
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

    /// Says which dot keeps tiles open by its noise, and what else keeps them open if it is more than a tenth of them.
    fn say_open_for(&self, session: &Session) -> Result<(), NotSaid> {
        let (counts, tiles) = (open_for(session), session.film().grid().len());
        let other =
            counts.iter().filter(|(why, _)| **why != OpenFor::Noise).map(|(_, count)| count).sum::<usize>();
        if session.criterion().only_counts() {
            return Ok(());
        }
        let noisy: Vec<Tile> =
            session.film().grid().tiles().filter(|tile| shows_noise(session, tile.index)).collect();
        let display = session.display_so_far();
        let dots = noisy.iter().filter_map(|&tile| Dot::of_noise(session, &display, tile));
        if let Some(dot) = dots.max_by(|a, b| a.share.total_cmp(&b.share)) {
            let count = noisy.iter().filter(|&&tile| dot.is_near(tile, session)).count();
            say!(
                "one dot at ({}, {}) keeps {count} of {tiles} tiles open: it holds {:.0} % of the noise of its own",
                dot.x,
                dot.y,
                100.0 * dot.share
            )?;
        }
        if other * 10 <= tiles {
            return Ok(());
        }
        for (&why, count) in &counts {
            match why {
                OpenFor::Exposure => say!(
                    "{count} of {tiles} tiles wait for the exposure, which so few samples do not tell yet; --exposure sets one"
                )?,
                OpenFor::UnmetLight => {
                    let light = |[a, b]: [Rgb; 2]| (luminance(a) - luminance(b)).abs();
                    let dot = brightest_find(session, session.film().grid().tiles(), light).map(
                        |Dot { x, y, share }| {
                            format!("; one dot at ({x}, {y}) holds {:.0} % of it", 100.0 * share)
                        },
                    );
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

/// The pixel of `tiles` that has most of what the halves differ by, in some measure, and its share of all of that.
fn brightest_find(
    session: &Session,
    tiles: impl IntoIterator<Item = Tile>,
    differ: impl Fn([Rgb; 2]) -> f32,
) -> Option<Dot> {
    let (film, width) = (session.film(), session.film().grid().width());
    let (mut all, mut most, mut brightest) = (0.0, 0.0, 0);
    for (tile, pixel) in
        tiles.into_iter().flat_map(|tile| tile.rows(width).flatten().map(move |pixel| (tile.index, pixel)))
    {
        let found = f64::from(differ(film.pixel_halves(tile, pixel).map(|(mean, _)| mean)));
        all += found;
        if found > most {
            (most, brightest) = (found, pixel);
        }
    }
    (most > 0.0).then(|| Dot { x: brightest % width, y: brightest / width, share: most / all })
}

/// Whether a tile is open for noise as it was rendered.
fn shows_noise(session: &Session, tile: usize) -> bool {
    session.open_for(tile) == Some(OpenFor::Noise)
        && session.verdict(tile).is_some_and(|it| it.lost.is_none())
}

/// A pixel that has more than its share.
struct Dot {
    x: usize,
    y: usize,
    share: f64,
}

impl Dot {
    /// One that has most of the noise which a tile shows.
    fn of_noise(session: &Session, display: &Display, tile: Tile) -> Option<Self> {
        let shown = |halves: [Rgb; 2]| {
            let [a, b] = halves.map(|mean| display.luma(mean));
            (a - b).powi(2)
        };
        brightest_find(session, [tile], shown).filter(|dot| dot.share > 0.5)
    }

    /// Whether a window in which people look for noise may lie in both it and a tile.
    fn is_near(&self, tile: Tile, session: &Session) -> bool {
        let window = (WINDOW * session.params().viewing.pixels_per_degree()) as usize;
        let near = |at: usize, from: usize, length: usize| at + window > from && at < from + length + window;
        near(self.x, tile.x, tile.width) && near(self.y, tile.y, tile.height)
    }
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
