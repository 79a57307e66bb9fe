//! `noisefloor audit`, and `render --audit`: whether a finished render keeps what was promised.

use crate::job::{CriterionJob, Ready, RenderJob};
use crate::output::{REPORT, picture_of};
use anyhow::{Context, bail};
use noisefloor::{Film, Rgb, Tile, TileGrid};
use noisefloor_cli::bars::bar;
use noisefloor_cli::end::ANSWER_IS_NO;
use noisefloor_cli::files::{read_reference, write_json};
use noisefloor_cli::folder::Folder;
use noisefloor_cli::say::{NotSaid, note, say, say_json};
use noisefloor_cli::sources::{Opened, Resources, fill};
use noisefloor_denoise::jods_lost_beside;
use noisefloor_vision::VisionModel;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::cmp::Reverse;
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// JODs that a place of a picture that is not denoised may have lost: as much as the worst squares of zones where people
/// stopped seeing noise.
pub const PLAIN_JODS_LOST: f64 = 0.5;
/// Samples of a place that is rendered again, as a multiple of those that it has.
const TIMES: u64 = 4;
/// Of places, this share has to keep the limit.
const PROMISED: f64 = 0.95;
/// With this confidence, the share is not below the bound that is reported.
const CONFIDENCE: f64 = 0.95;

/// What is looked at again, and how.
pub struct AuditJob {
    pub folder: PathBuf,
    pub places: usize,
    /// Chooses the places, and their samples.
    pub seed: u64,
    /// JODs that a place may have lost; by default what the render was to keep.
    pub lost: Option<f64>,
    /// Whether the exit code tells.
    pub check: bool,
    pub json: bool,
    pub quiet: bool,
    pub resources: Resources,
}

/// A line of stops.csv, as far as it matters.
#[derive(Clone, Deserialize)]
struct Stopped {
    tile: usize,
    spp: u64,
    probability: Option<f64>,
    reason: String,
    jods_lost: Option<f64>,
}

#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Drawn {
    Random,
    /// Among those that had the most noise left when they stopped.
    Earliest,
}

#[derive(Serialize)]
struct Place {
    #[serde(flatten)]
    tile: Tile,
    drawn: Drawn,
    spp: u64,
    jods_lost: f64,
}

/// Numbers without pictures, for report.json.
#[derive(Serialize)]
struct Audit {
    limit: f64,
    kept: usize,
    /// The share of places that keep the limit, at least, with a confidence of 95 %.
    kept_at_least: f64,
    worst: f64,
    seconds: f64,
    share_of_render: Option<f64>,
    seed: u64,
    places: Vec<Place>,
}

pub fn run(job: &AuditJob) -> anyhow::Result<ExitCode> {
    let began = Instant::now();
    let path = job.folder.join(REPORT);
    let file = File::open(&path).with_context(|| format!("{}: holds no render", job.folder.display()))?;
    let mut report: Value =
        serde_json::from_reader(BufReader::new(file)).with_context(|| path.display().to_string())?;
    let _lock = Folder::claim(job.folder.clone())?;
    let mut audit = look(job, &report).with_context(|| job.folder.display().to_string())?;
    audit.seconds = began.elapsed().as_secs_f64();
    let seconds = |key: &str| report[key].as_f64().unwrap_or(0.0);
    let render = seconds("seconds_before") + seconds("seconds_setup") + seconds("seconds_total");
    audit.share_of_render = (render > 0.0).then(|| audit.seconds / render);
    report["audit"] = serde_json::to_value(&audit)?;
    write_json(&path, &report)?;
    if job.json {
        say_json(&audit)?;
    } else if !job.quiet {
        audit.say()?;
    }
    let (missed, places) = (audit.places.len() - audit.kept, audit.places.len());
    let is_below = (audit.kept as f64) < PROMISED * places as f64;
    if is_below {
        note!(
            "warning: {missed} of {places} places have lost more than {} JOD, and one of 20 may: \
             of renders that keep that, {:.0} % have as many",
            audit.limit,
            100.0 * at_least(missed, places, 1.0 - PROMISED)
        );
    }
    Ok(if job.check && is_below { ExitCode::from(ANSWER_IS_NO) } else { ExitCode::SUCCESS })
}

/// Renders the places again, and measures what they have lost.
fn look(job: &AuditJob, report: &Value) -> anyhow::Result<Audit> {
    let render = RenderJob::deserialize(&report["render"]).context("report.json is of another version")?;
    let exposure =
        report["exposure"].as_f64().context("the render has no exposure yet; --resume goes on with it")?;
    let Ready { params, .. } = render.read()?;
    let stops = csv::Reader::from_path(job.folder.join("stops.csv"))?.into_deserialize();
    let stops: Vec<Stopped> = stops.collect::<Result<_, _>>().context("stops.csv")?;
    if stops.iter().enumerate().any(|(index, stop)| stop.tile != index) {
        bail!("stops.csv is not as the render wrote it: a line for each tile, in their order");
    }
    let drawn = draw(&stops, job.places, job.seed);
    if drawn.is_empty() {
        bail!("no tile has stopped for its noise, or at its samples: there is nothing to audit");
    }

    let opened = render.source.audited(job.seed)?.open(job.resources)?;
    opened.warn();
    let Opened { mut source, .. } = opened;
    let info = source.info();
    let size = (info.width, info.height);
    let grid = TileGrid::new(size.0, size.1, render.limits.tile)?;
    if grid.len() != stops.len() {
        bail!("the scene has {}×{} pixels now, and had others: it has changed since", size.0, size.1);
    }
    let picture = read_reference(&job.folder.join(picture_of(&render)), size)?;
    let mut film = Film::new(grid);
    let wanted: Vec<(Tile, u64)> =
        drawn.iter().map(|(stop, _)| (grid.tile(stop.tile), stop.spp.saturating_mul(TIMES).max(2))).collect();
    let progress = if job.quiet { indicatif::ProgressBar::hidden() } else { bar(100, "% of the audit") };
    fill(source.as_mut(), &mut film, &wanted, |done| progress.set_position((100.0 * done) as u64))?;
    progress.finish_and_clear();

    let display = render.tone.exposed_as(exposure as f32).load()?.settle(&picture);
    let eyes = VisionModel::new(&params.viewing);
    let lost = |(stop, drawn): (Stopped, Drawn)| {
        let tile = grid.tile(stop.tile);
        let cut = |of: &dyn Fn(usize) -> Rgb| -> Vec<Rgb> { tile.rows(size.0).flatten().map(of).collect() };
        let half = |n: usize| cut(&|pixel| film.pixel_halves(tile.index, pixel)[n].0);
        let own = cut(&|pixel| picture[pixel]);
        let size = (tile.width, tile.height);
        let jods_lost = jods_lost_beside(size, &own, [&half(0), &half(1)], &display, &eyes)?;
        Ok(Place { tile, drawn, spp: stop.spp, jods_lost })
    };
    let places: Vec<Place> = drawn.into_iter().map(lost).collect::<anyhow::Result<_>>()?;
    let limit = job.lost.unwrap_or(match render.criterion {
        CriterionJob::Denoised { lost, .. } => lost,
        _ => PLAIN_JODS_LOST,
    });
    let kept = places.iter().filter(|place| place.jods_lost <= limit).count();
    Ok(Audit {
        limit,
        kept,
        kept_at_least: share_at_least(kept, places.len()),
        worst: places.iter().map(|place| place.jods_lost).fold(0.0, f64::max),
        seconds: 0.0,
        share_of_render: None,
        seed: job.seed,
        places,
    })
}

/// Half of the places at random, and half at random among the quarter of tiles that had the most noise left when they stopped.
fn draw(stops: &[Stopped], places: usize, seed: u64) -> Vec<(Stopped, Drawn)> {
    let mut tiles: Vec<&Stopped> =
        stops.iter().filter(|stop| matches!(stop.reason.as_str(), "converged" | "reached-spp")).collect();
    let shuffle = |tiles: &mut [&Stopped]| {
        tiles.sort_by_key(|stop| {
            *blake3::hash(&[seed, stop.tile as u64].map(u64::to_le_bytes).concat()).as_bytes()
        });
    };
    shuffle(&mut tiles);
    let (quarter, places) = (tiles.len().div_ceil(4), places.min(tiles.len()));
    let mut rest = tiles.split_off(places.div_ceil(2));
    let noise = |stop: &Stopped| {
        stop.jods_lost.or(stop.probability.map(|p| 1.0 - p)).unwrap_or(1.0 / stop.spp as f64)
    };
    rest.sort_by(|a, b| noise(b).total_cmp(&noise(a)));
    rest.truncate(quarter.max(places / 2));
    shuffle(&mut rest);
    rest.truncate(places / 2);
    let mut drawn: Vec<_> = tiles.into_iter().map(|stop| (stop.clone(), Drawn::Random)).collect();
    drawn.extend(rest.into_iter().map(|stop| (stop.clone(), Drawn::Earliest)));
    drawn
}

impl Audit {
    fn say(&self) -> Result<(), NotSaid> {
        let mut places: Vec<&Place> = self.places.iter().collect();
        places.sort_by_key(|place| Reverse((1e6 * place.jods_lost) as u64));
        say!("tile     x     y      spp  JOD lost  drawn")?;
        for Place { tile, drawn, spp, jods_lost } in places {
            let drawn = match drawn {
                Drawn::Random => "at random",
                Drawn::Earliest => "among those that stopped earliest for their noise",
            };
            say!("{:4} {:5} {:5} {spp:8} {jods_lost:9.2}  {drawn}", tile.index, tile.x, tile.y)?;
        }
        let cost = self
            .share_of_render
            .map_or(String::new(), |share| format!("; cost {:.0} % of the render", 100.0 * share));
        say!(
            "{} of {} places keep the limit of {} JOD, the worst has lost {:.2} JOD \
             (with 95 % confidence at least {:.0} % of places keep it){cost}",
            self.kept,
            self.places.len(),
            self.limit,
            self.worst,
            100.0 * self.kept_at_least
        )
    }
}

/// The chance of `hits` or more of `all`, of which each has this chance.
fn at_least(hits: usize, all: usize, chance: f64) -> f64 {
    let mut term = (1.0 - chance).powi(all as i32);
    let mut below = 0.0;
    for n in 0..hits {
        below += term;
        term *= (all - n) as f64 / (n + 1) as f64 * chance / (1.0 - chance);
    }
    (1.0 - below).clamp(0.0, 1.0)
}

/// The lower end of what share of all places may be found in `kept` of `all` of them, with [`CONFIDENCE`] (Clopper and Pearson
/// 1934): with a smaller share, as many would be found in one of 20 audits or fewer.
fn share_at_least(kept: usize, all: usize) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    // As many halvings as a double has bits
    for _ in 0..53 {
        let middle = 0.5 * (low + high);
        if at_least(kept, all, middle) <= 1.0 - CONFIDENCE { low = middle } else { high = middle }
    }
    if kept == 0 { 0.0 } else { low }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_bound_is_that_of_clopper_and_pearson() {
        // Of all: the root; the others by bisection of the binomial sum in Python
        let bounds = [
            (8, 8, 0.05f64.powf(1.0 / 8.0)),
            (7, 8, 0.529_320_6),
            (0, 8, 0.0),
            (1, 1, 0.05),
            (19, 20, 0.783_893_8),
        ];
        for (kept, all, bound) in bounds {
            assert!(
                (share_at_least(kept, all) - bound).abs() < 1e-6,
                "{kept} of {all}: {}",
                share_at_least(kept, all)
            );
        }
    }

    #[test]
    fn half_is_random_and_half_had_the_most_noise_left() {
        let stop = |tile: usize| Stopped {
            tile,
            spp: 100,
            probability: Some(1.0 - tile as f64 / 200.0),
            reason: if tile.is_multiple_of(10) { "max-spp" } else { "converged" }.into(),
            jods_lost: None,
        };
        let stops: Vec<Stopped> = (0..100).map(stop).collect();
        let mut all = BTreeSet::new();
        for seed in 0..50 {
            let drawn = draw(&stops, 9, seed);
            let tiles: BTreeSet<usize> = drawn.iter().map(|(stop, _)| stop.tile).collect();
            assert!(tiles.len() == 9 && tiles.iter().all(|tile| !tile.is_multiple_of(10)));
            let earliest: Vec<_> =
                drawn.iter().filter(|(_, drawn)| matches!(drawn, Drawn::Earliest)).collect();
            // A quarter of 90, beside five that may have been taken already
            assert!(earliest.len() == 4 && earliest.iter().all(|(stop, _)| stop.tile > 69));
            all.extend(tiles);
        }
        // Of 90 tiles, each is missed by 5 of 90 in all of 50 draws with a chance of 6 %
        assert!(all.len() > 75, "{}", all.len());
        assert_eq!(draw(&stops[..5], 9, 1).len(), 4);
    }
}
