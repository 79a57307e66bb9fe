//! `noisefloor tune`.

mod job;
mod keep;
mod pictures;

pub use job::{TuneCriterion, TuneJob};

use crate::tune::job::{Row, TILE};
use crate::tune::keep::{Keep, KeptSearch};
use crate::tune::pictures::{Crop, Judged, Judges, Pair, View};
use anyhow::Context;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use noisefloor::source::SourceIdentity;
use noisefloor::stills::{Evidence, SnapshotPair, Still, StillWarning};
use noisefloor::tune::{Ending, Excess, Knob, Look, Search};
use noisefloor::{Params, Tile, ToneMapping};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::say::{note, say, say_json};
use noisefloor_cli::signals::end_on_signal;
use serde::Serialize;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// What is sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum KnobChoice {
    /// The renderer's own noise threshold.
    Threshold,
    /// Samples per pixel.
    Samples,
}

#[derive(Serialize)]
struct Report {
    knob: &'static str,
    /// Null if none was found.
    setting: Option<f64>,
    /// As [`Ending::Found`] has it.
    too_coarse: Option<f64>,
    ending: &'static str,
    judged: String,
    /// The frames of a sequence, worst first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    frames: Vec<i32>,
    /// The crops, worst first: x, y, width and height.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    regions: Vec<[usize; 4]>,
    steps: Vec<Row>,
    seconds: f64,
    /// What the search depends on: it is resumed only by the same.
    identity: Vec<SourceIdentity>,
}

pub fn run(mut job: TuneJob) -> anyhow::Result<ExitCode> {
    job.resources.start_threads()?;
    end_on_signal(match job.keep {
        Some(_) => "stopped; --resume goes on from what was found so far",
        None => "stopped; what was found so far stands above",
    })?;
    let keep = job.keep.take().map(|folder| Keep::claim(folder, job.earlier)).transpose()?;
    let mut tune = Tune::begin(&job, keep)?;
    let mut search = match (&tune.keep, job.earlier) {
        (Some(keep), Earlier::Resume) => tune.resume(keep.earlier(&tune.identity)?)?,
        _ => job.search.clone(),
    };
    while let Some(look) = search.next() {
        let (excess, squares) = tune.look(&look)?;
        if search.tell(excess, &squares) {
            tune.step(&search)?;
        }
    }
    let ending = search.ending().context("the search asks for nothing, and has not ended")?;
    let report = tune.report(&search, Some(ending));
    if let Some(keep) = &tune.keep {
        keep.write_report(&report)?;
    }
    say_all(&job, &report, ending)?;
    tune.views.iter().flat_map(View::notes).for_each(|line| note!("note: {line}"));
    Ok(if matches!(ending, Ending::Found { .. }) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

struct Tune<'a> {
    job: &'a TuneJob,
    keep: Option<Keep>,
    /// One, or the frames of a sequence.
    views: Vec<View>,
    /// How each is displayed, once it was seen.
    tones: Vec<Option<ToneMapping>>,
    /// Each as it was last seen, with the setting; none once it was said that the setting changes them.
    before: Vec<Option<(f64, Still)>>,
    judges: Judges<'a>,
    identity: Vec<SourceIdentity>,
    rows: Vec<Row>,
    /// Whole pictures since the last row, of which crops may be wanted: of the hardest views, how hard first.
    whole: Vec<(f64, usize, Pair)>,
    /// Of the looks since the last row: the worst, and the times.
    worst: Option<(Look, Judged)>,
    rendering: Duration,
    judging: Duration,
    /// How many were rendered.
    rendered: usize,
}

impl<'a> Tune<'a> {
    fn begin(job: &'a TuneJob, keep: Option<Keep>) -> anyhow::Result<Self> {
        let mut params = Params::default().with_viewing(job.viewing).with_tile(TILE);
        (params.tone_mapping, params.audience) = (job.tone.load()?, job.audience);
        let mut judges = Judges::begin(&job.criterion, params, job.resources.timeout)?;
        let frames: Vec<Option<i32>> = match job.frames.as_slice() {
            [] => vec![None],
            frames => frames.iter().copied().map(Some).collect(),
        };
        let views = frames.into_iter().map(|frame| View::open(job, frame, &mut judges));
        let views: Vec<View> = views.collect::<anyhow::Result<_>>()?;
        let identity: anyhow::Result<_> = views.iter().map(|view| view.identity(job, &judges)).collect();
        Ok(Self {
            job,
            keep,
            identity: identity?,
            tones: vec![None; views.len()],
            before: vec![None; views.len()],
            views,
            judges,
            rows: Vec::new(),
            whole: Vec::new(),
            worst: None,
            rendering: Duration::ZERO,
            judging: Duration::ZERO,
            rendered: 0,
        })
    }

    /// A search that takes over what an earlier one has found.
    fn resume(&mut self, kept: Option<KeptSearch>) -> anyhow::Result<Search> {
        let job = self.job;
        let (steps, frames) = kept.map(|kept| (kept.steps, kept.frames)).unwrap_or_default();
        let mut search = job.search.clone();
        for row in steps {
            // With another --from or --to, the search may go another way from some step on
            if !search.repeat(row.setting, row.excess()) {
                break;
            }
            if !job.quiet && !job.json {
                say_step(job, &row)?;
            }
            self.rows.push(row);
        }
        let number = |frame: &i32| self.views.iter().position(|view| view.frame == Some(*frame));
        let hardest: Vec<usize> = frames.iter().filter_map(number).collect();
        Ok(search.ordered(&hardest))
    }

    fn look(&mut self, look: &Look) -> anyhow::Result<(Excess, Vec<(Tile, f64)>)> {
        let job = self.job;
        let view = &mut self.views[look.view];
        let mut what = format!("{} {}", job.search.knob().name(), look.setting);
        if let Some(frame) = view.frame {
            what += &format!(", frame {frame}");
        }
        if let Some(crop) = look.crop {
            what += &format!(", around ({}, {})", crop.x + crop.width / 2, crop.y + crop.height / 2);
        }
        let bar = spinner(job.quiet, format!("{what}: two pictures"));
        let start = Instant::now();
        let rendered = self.whole.iter().find(|(_, number, _)| look.is_rendered && *number == look.view);
        let pair = match (rendered, look.crop) {
            (Some((.., whole)), Some(crop)) => whole.cropped(crop),
            _ => view.pictures.pair(look.each, look.crop, &bar)?,
        };
        if look.crop.is_none() {
            view.check_size(&pair)?;
        }
        self.rendering += start.elapsed();
        self.rendered += usize::from(!look.is_rendered);
        bar.set_message(format!("{what}: judging"));
        let start = Instant::now();
        let whole = (look.crop.is_none() && job.regions > 0).then(|| pair.clone());
        let crop = look.crop.zip(self.tones[look.view].clone()).map(|(tile, tone)| Crop { tile, tone });
        let judged = self.judges.judge(pair, view.guides.as_ref(), crop.as_ref())?;
        self.judging += start.elapsed();
        bar.finish_and_clear();
        if look.crop.is_none() {
            self.tones[look.view] = Some(self.judges.tone(&judged));
            self.compare(look, &judged);
        }
        if let Some(whole) = whole {
            // So many crops lie in so many views at the most, which are the worst
            self.whole.push((judged.looked.excess.ratio, look.view, whole));
            self.whole.sort_by(|(a, ..), (b, ..)| b.total_cmp(a));
            self.whole.truncate(job.regions);
        }
        let found = (judged.looked.excess, judged.looked.squares.clone());
        let worse = |worst: &(Look, Judged)| judged.looked.excess.ratio > worst.1.looked.excess.ratio;
        // Crops of whole pictures are another look at the same
        if !look.is_rendered && self.worst.as_ref().is_none_or(worse) {
            self.worst = Some((*look, judged));
        }
        Ok(found)
    }

    /// Says once that another setting makes a view brighter or darker.
    fn compare(&mut self, look: &Look, judged: &Judged) {
        let Some(place) = self.before.get_mut(look.view) else { return };
        // Said to have unlike numbers of samples: noise of unlike settings is skewed unlike
        let picture = Still::new(judged.size, judged.mean.clone(), 2.0);
        let before = place.replace((look.setting, Still::new(judged.size, judged.mean.clone(), 1.0)));
        let Some((setting, before)) = before else { return };
        let tone = ToneMapping::default();
        let Ok(pair) = SnapshotPair::new(Evidence::Reference, &picture, &[&before], tone, None) else {
            return;
        };
        for warning in pair.warnings() {
            if let StillWarning::Brightness(times) = warning {
                let name = self.job.search.knob().name();
                note!(
                    "warning: with {name} {}, the picture is {times:.2} times as bright as with {setting}, by more than \
                     noise explains: what a setting does to the picture beside its noise is not judged",
                    look.setting
                );
                self.before.clear();
                return;
            }
        }
    }

    fn step(&mut self, search: &Search) -> anyhow::Result<()> {
        let job = self.job;
        self.whole.clear();
        let Some((look, judged)) = self.worst.take() else { return Ok(()) };
        // The last look at the whole, after crops, is no step of the search if it passes
        let step = search.steps().next_back().filter(|(setting, _)| *setting == look.setting);
        let told = step.map_or(judged.looked.excess, |(_, excess)| excess);
        self.rows.push(Row {
            setting: look.setting,
            each: look.each,
            ratio: told.ratio.is_finite().then_some(told.ratio),
            alone: told.alone.filter(|alone| alone.is_finite()),
            floor: told.floor,
            frame: self.views[look.view].frame,
            x: judged.looked.excess.place.map(|(x, _)| x),
            y: judged.looked.excess.place.map(|(_, y)| y),
            crops: if look.crop.is_some() { job.regions } else { 0 },
            pictures: told.pictures,
            seconds: std::mem::take(&mut self.rendering).as_secs_f64(),
            views: std::mem::take(&mut self.rendered).max(1),
            judging_seconds: std::mem::take(&mut self.judging).as_secs_f64(),
        });
        if !job.quiet && !job.json {
            say_step(job, &self.rows[self.rows.len() - 1])?;
        }
        if let Some(keep) = &self.keep {
            keep.write_pictures(&judged)?;
            keep.write_report(&self.report(search, None))?;
        }
        Ok(())
    }

    /// Those of a sequence, worst first.
    fn frames(&self, search: &Search) -> Vec<i32> {
        search.views().iter().filter_map(|&view| self.views[view].frame).collect()
    }

    fn report(&self, search: &Search, ending: Option<Ending>) -> Report {
        let (setting, too_coarse) = match ending {
            Some(Ending::Found { setting, too_coarse }) => (Some(setting), too_coarse),
            _ => (None, None),
        };
        let ending = ending.map_or("searching", |ending| ending.name());
        Report {
            knob: search.knob().name(),
            setting,
            too_coarse,
            ending,
            judged: self.judges.said(),
            frames: self.frames(search),
            regions: search
                .crops()
                .iter()
                .map(|(_, crop)| [crop.x, crop.y, crop.width, crop.height])
                .collect(),
            steps: self.rows.clone(),
            seconds: self.rows.iter().map(|row| row.seconds + row.judging_seconds).sum(),
            identity: self.identity.clone(),
        }
    }
}

impl Row {
    fn excess(&self) -> Excess {
        let mut excess = Excess::new(self.ratio.unwrap_or(f64::INFINITY));
        (excess.place, excess.pictures) = (self.x.zip(self.y), self.pictures);
        (excess.alone, excess.floor) = (self.alone, self.floor);
        excess
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
        (TuneCriterion::Denoised { lost, .. }, Some(ratio)) => {
            format!("the denoised picture may have lost {:.3} JOD, {lost} are allowed", ratio * lost)
        }
    };
    let mut at = match (row.x, row.y) {
        (Some(x), Some(y)) => format!(" around ({x}, {y})"),
        _ => String::new(),
    };
    if let Some(frame) = row.frame {
        at = format!("{at} in frame {frame}");
    }
    if row.crops > 0 {
        at += ", looked at in crops";
    }
    let name = job.search.knob().name();
    Ok(say!("{name} {}: {what}, at worst{at}; {:.1} s", row.setting, row.seconds + row.judging_seconds)?)
}

/// A setting, with what one picture leaves and the seconds that it takes.
#[derive(Clone, Copy)]
struct Tried {
    setting: f64,
    ratio: f64,
    seconds: f64,
}

impl Tried {
    /// Of one that lies between two, along the line in logarithms.
    fn between(setting: f64, [a, b]: [Self; 2]) -> Self {
        let share = (setting / a.setting).ln() / (b.setting / a.setting).ln();
        let at = |a: f64, b: f64| a * (b / a).powf(share);
        Self { setting, ratio: at(a.ratio, b.ratio), seconds: at(a.seconds, b.seconds) }
    }
}

/// What whole pictures leave and take with the settings that were tried, from coarse to fine, and with the one that was found.
fn tried(knob: Knob, steps: &[Row], found: Option<f64>) -> Vec<Tried> {
    let mut so_far = 0.0;
    let mut all: Vec<Tried> = Vec::new();
    for row in steps.iter().filter(|row| row.crops == 0) {
        // Two pictures together are as good as one; with samples, they grow
        let seconds = row.seconds / row.views as f64;
        so_far = if matches!(knob, Knob::Samples { .. }) { so_far + seconds } else { seconds };
        let Some(ratio) = row.ratio else { continue };
        all.push(Tried { setting: row.setting, ratio, seconds: so_far });
    }
    all.sort_by(|a, b| match knob {
        Knob::Samples { .. } => a.setting.total_cmp(&b.setting),
        _ => b.setting.total_cmp(&a.setting),
    });
    if let Some(found) = found
        && let Some(at) = all.windows(2).position(|two| (two[0].setting > found) != (two[1].setting > found))
        && all.iter().all(|tried| tried.setting != found)
    {
        all.insert(at + 1, Tried::between(found, [all[at], all[at + 1]]));
    }
    all
}

/// As a table, with a bar as long as a picture takes.
fn say_tried(job: &TuneJob, report: &Report) -> anyhow::Result<()> {
    const LONGEST: f64 = 40.0;
    let all = tried(job.search.knob(), &report.steps, report.setting);
    let most = all.iter().map(|tried| tried.seconds).fold(f64::MIN_POSITIVE, f64::max);
    let (left, unit) = match &job.criterion {
        TuneCriterion::Noise(_) => ("noise left", 1.0),
        TuneCriterion::Denoised { lost, .. } => ("JOD lost", *lost),
    };
    say!("  {:>10} {left:>11} {:>8}", report.knob, "seconds")?;
    for Tried { setting, ratio, seconds } in all {
        let mark = if report.setting == Some(setting) { '>' } else { ' ' };
        let bar = "▇".repeat((seconds / most * LONGEST).ceil() as usize);
        say!("{mark} {setting:>10} {:>11.2} {seconds:>8.1} {bar}", ratio * unit)?;
    }
    Ok(())
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
    let name = job.search.knob().name();
    match ending {
        Ending::Found { setting, too_coarse: None } => {
            say!("{name} {setting}: the coarsest tried is enough; --from tries coarser ones")?
        }
        Ending::Found { setting, too_coarse: Some(coarse) } => {
            say!("{name} {setting}; {coarse} is too coarse")?
        }
        Ending::AtFinest { ratio } => note!(
            "error: even {name} {} leaves {ratio:.2} times too much in the mean of two pictures; --to goes on from there",
            report.steps.last().map_or(0.0, |step| step.each)
        ),
        Ending::Unchanged => note!(
            "error: the finest settings, down to {name} {}, give the same pictures: \
             the renderer does not look at the {name}, or has reached its most samples (--max-spp), \
             or takes its fewest samples with all of them (--to tries finer ones)",
            report.steps.last().map_or(0.0, |step| step.each)
        ),
        Ending::Capped { ratio } => note!(
            "error: {ratio:.2} times too much is left, mostly by pixels that have the most samples: \
             a finer {name} cannot help them; --max-spp allows for more"
        ),
        Ending::NotFalling { ratio } => note!(
            "error: more samples do not make it better ({ratio:.2} times too much): \
             few samples may find much of the light, a denoiser may have reached its limit, \
             or the pictures share their random numbers"
        ),
        other => note!("error: the search has ended: {}", other.name()),
    }
    if matches!(ending, Ending::Found { .. }) {
        let last: f64 = report.steps.last().map_or(0.0, |step| step.seconds);
        let many = report.frames.len() > 1;
        let pictures = if many { "the last pictures" } else { "the last two pictures" };
        say!("{}; {:.0} s, of which {pictures} took {last:.0} s", report.judged, report.seconds)?;
    }
    say_tried(job, report)
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
