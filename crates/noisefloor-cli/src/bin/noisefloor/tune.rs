//! `noisefloor tune`.

mod keep;
mod pictures;

use crate::tune::keep::Keep;
use crate::tune::pictures::{Judged, Judges, Pictures};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use noisefloor::tune::{Ending, Knob, Next, Tuning};
use noisefloor::{Audience, Oracle, Params, ToneMapping, Viewing};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::say::{note, say, say_json};
use noisefloor_cli::signals::end_on_signal;
use noisefloor_cli::sources::{Resources, SourceJob};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A setting to find: checked.
pub struct TuneJob {
    pub source: SourceJob,
    pub resources: Resources,
    pub tuning: Tuning,
    /// Most samples per pixel of a picture with a threshold.
    pub most_spp: Option<u64>,
    pub criterion: TuneCriterion,
    pub tone: ToneMapping,
    pub viewing: Viewing,
    pub audience: Audience,
    pub keep: Option<PathBuf>,
    pub earlier: Earlier,
    pub json: bool,
    pub quiet: bool,
}

/// What is judged.
pub enum TuneCriterion {
    /// The noise of the picture.
    Noise(Box<Oracle>),
    /// What is wrong with the denoised picture, in JODs that its worst square may have lost.
    Denoised { lost: f64 },
}

/// What is sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum KnobChoice {
    /// The renderer's own noise threshold.
    Threshold,
    /// Samples per pixel.
    Samples,
}

/// One line of the search.
#[derive(Clone, Debug, Serialize)]
struct Row {
    /// One picture with it is as good as the mean of the two.
    setting: f64,
    /// What each of the two was rendered with.
    each: f64,
    /// What is wrong in the worst place, over what may be; null where it cannot be told.
    ratio: Option<f64>,
    /// The worst place.
    x: Option<usize>,
    y: Option<usize>,
    /// For both pictures, and what judging them took.
    seconds: f64,
    judging_seconds: f64,
}

#[derive(Serialize)]
struct Report {
    knob: &'static str,
    /// Null if none was found.
    setting: Option<f64>,
    /// The setting tried last, and the one before, which was too coarse.
    enough: Option<f64>,
    too_coarse: Option<f64>,
    ending: &'static str,
    judged: String,
    steps: Vec<Row>,
    seconds: f64,
}

pub fn run(mut job: TuneJob) -> anyhow::Result<ExitCode> {
    job.resources.start_threads()?;
    end_on_signal("stopped; what was found so far stands above")?;
    let keep = job.keep.take().map(|folder| Keep::claim(folder, job.earlier)).transpose()?;
    let began = Instant::now();
    let mut params =
        Params::default().with_viewing(job.viewing).with_tone_mapping(job.tone.clone()).with_tile(TILE);
    params.audience = job.audience;
    let mut pictures = Pictures::open(&job.source, job.resources, job.tuning.knob(), job.most_spp)?;
    let mut judges = Judges::begin(&job.criterion, params, &mut pictures, job.resources.timeout)?;
    let mut rows = Vec::new();
    let mut last: Option<Judged> = None;
    let ending = loop {
        let (each, setting) = match job.tuning.next() {
            Next::Done(ending) => break ending,
            Next::Render { each, setting } => (each, setting),
        };
        let bar = spinner(job.quiet, format!("{} {setting}: two pictures", name(job.tuning.knob())));
        let start = Instant::now();
        let pair = pictures.pair(each, &bar)?;
        let rendered = start.elapsed();
        bar.set_message(format!("{} {setting}: judging", name(job.tuning.knob())));
        let judged = judges.judge(pair)?;
        bar.finish_and_clear();
        let excess = judged.excess;
        job.tuning.tell(excess);
        let row = Row {
            setting,
            each,
            ratio: excess.ratio.is_finite().then_some(excess.ratio),
            x: excess.place.map(|(x, _)| x),
            y: excess.place.map(|(_, y)| y),
            seconds: rendered.as_secs_f64(),
            judging_seconds: (start.elapsed() - rendered).as_secs_f64(),
        };
        if !job.quiet && !job.json {
            say_step(&job, &row)?;
        }
        rows.push(row);
        last = Some(judged);
        if let (Some(keep), Some(last)) = (&keep, &last) {
            keep.write(last, &report(&job, &judges, None, &rows, began.elapsed()))?;
        }
    };
    let report = report(&job, &judges, Some(ending), &rows, began.elapsed());
    if let (Some(keep), Some(last)) = (&keep, &last) {
        keep.write(last, &report)?;
    }
    say_all(&job, &report, ending)?;
    pictures.notes().iter().for_each(|line| note!("note: {line}"));
    Ok(if matches!(ending, Ending::Found { .. }) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Edge of the tiles in which noise is described: windows are what is judged, whatever the tiles.
const TILE: usize = 64;

fn name(knob: Knob) -> &'static str {
    match knob {
        Knob::Samples { .. } => "samples",
        Knob::Threshold { .. } => "threshold",
    }
}

fn report(
    job: &TuneJob,
    judges: &Judges<'_>,
    ending: Option<Ending>,
    rows: &[Row],
    took: Duration,
) -> Report {
    let (setting, enough, too_coarse) = match ending {
        Some(Ending::Found { setting, enough, too_coarse }) => (Some(setting), Some(enough), too_coarse),
        _ => (None, None, None),
    };
    let ending = match ending {
        None => "searching",
        Some(Ending::Found { .. }) => "found",
        Some(Ending::AtFinest { .. }) => "at-finest",
        Some(Ending::Unchanged) => "unchanged",
        Some(Ending::NotFalling { .. }) => "not-falling",
    };
    Report {
        knob: name(job.tuning.knob()),
        setting,
        enough,
        too_coarse,
        ending,
        judged: judges.said(),
        steps: rows.to_vec(),
        seconds: took.as_secs_f64(),
    }
}

fn say_step(job: &TuneJob, row: &Row) -> anyhow::Result<()> {
    let what = match (&job.criterion, row.ratio) {
        (_, None) => "noise of which nothing can be said yet".to_owned(),
        (TuneCriterion::Noise(oracle), Some(ratio)) if ratio > 1.0 => {
            format!("noise {ratio:.2} times what {} of people do not see", oracle.people())
        }
        (TuneCriterion::Noise(oracle), Some(ratio)) => {
            format!("{} of people see none: {ratio:.2} of what they do not see", oracle.people())
        }
        (TuneCriterion::Denoised { lost }, Some(ratio)) => {
            format!("the denoised picture has lost {:.3} JOD, {lost} are allowed", ratio * lost)
        }
    };
    let at = match (row.x, row.y) {
        (Some(x), Some(y)) => format!(" around ({x}, {y})"),
        _ => String::new(),
    };
    let name = name(job.tuning.knob());
    Ok(say!("{name} {}: {what}, at worst{at}; {:.1} s", row.setting, row.seconds + row.judging_seconds)?)
}

fn say_all(job: &TuneJob, report: &Report, ending: Ending) -> anyhow::Result<()> {
    if job.json {
        return say_json(report);
    }
    if let Ending::Found { setting, .. } = ending
        && job.quiet
    {
        return Ok(say!("{setting}")?);
    }
    let name = name(job.tuning.knob());
    match ending {
        Ending::Found { setting, enough, too_coarse: None } => {
            say!("{name} {setting}: the coarsest tried, and {enough} is enough; --from tries coarser ones")?
        }
        Ending::Found { setting, enough, too_coarse: Some(coarse) } if setting == enough => {
            say!("{name} {setting}; {coarse} is too coarse")?;
        }
        Ending::Found { setting, enough, too_coarse: Some(coarse) } => say!(
            "{name} {setting}: between {coarse}, which is too coarse, and {enough}, which is more than enough"
        )?,
        Ending::AtFinest { ratio } => note!(
            "error: even {name} {} leaves {ratio:.2} times too much; --to goes on from there",
            report.steps.last().map_or(0.0, |step| step.setting)
        ),
        Ending::Unchanged => note!(
            "error: finer settings give the same pictures: the renderer does not look at the {name}, or has \
             reached its most samples (--max-spp)"
        ),
        Ending::NotFalling { ratio } => note!(
            "error: more samples do not make it better ({ratio:.2} times too much): what is wrong is no noise; a \
             denoiser may have reached its limit, or the pictures share their random numbers"
        ),
    }
    if matches!(ending, Ending::Found { .. }) {
        let last: f64 = report.steps.last().map_or(0.0, |step| step.seconds);
        let all: f64 = report.steps.iter().map(|step| step.seconds + step.judging_seconds).sum();
        say!("{}; {:.0} s, of which the last two pictures took {last:.0} s", report.judged, all)?;
    }
    Ok(())
}

fn spinner(quiet: bool, message: String) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner().with_message(message);
    bar.enable_steady_tick(Duration::from_millis(200));
    match ProgressStyle::with_template("{spinner} {msg}  {elapsed_precise}") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}
