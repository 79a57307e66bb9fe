//! One frame: what it is, and its merge.

use super::warn;
use crate::args::{Cli, Command};
use crate::folder::{Earlier, Folder};
use crate::output::{Finished, Output, render_in};
use crate::render::{JOB, Judge, RenderJob, origin};
use crate::say::note;
use crate::sources::Source;
use anyhow::{Context, bail};
use clap::Parser;
use noisefloor::{
    Batch, Counts, FixedSpp, ProgressiveSource, Repeats, Request, Session, SourceError, SourceInfo, TileGrid,
    Unit,
    criterion::Resumable,
    driver::{Clock, Progress, TimelinePoint},
    source::SourceIdentity,
};
use noisefloor_farm::{
    FarmError, FarmFolder, FarmJob, FrameJob, FrameState, PlannedBatch, ShardError, ShardFile, ShardJob,
    ShardSet,
};
use std::time::Instant;

/// When a merge writes pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pictures {
    WhenDone,
    Always,
}

/// Options of `noisefloor render` that a farm has use for.
pub fn parse(arguments: &[String]) -> anyhow::Result<RenderJob> {
    let words = ["noisefloor", "render"].into_iter().chain(arguments.iter().map(String::as_str));
    let cli = Cli::try_parse_from(words).map_err(|error| anyhow::anyhow!("after `--`: {error}"))?;
    let Command::Render(args) = cli.command else { bail!("after `--`, options of `noisefloor render`") };
    if args.is_sequence() {
        bail!("--frames: before `--`, as in `farm plan DIR --frames 1-240 -- 'hall.{{frame:04}}.xml'`");
    }
    let job = args.check()?;
    #[cfg(feature = "study")]
    let watched = job.watch.is_some();
    #[cfg(not(feature = "study"))]
    let watched = false;
    for (option, given) in [
        ("--tev", job.tev.is_some()),
        ("--watch", watched),
        ("--out", job.out.is_some()),
        ("--time", job.time.is_some()),
        ("--against", job.against.is_some()),
        ("--resume and --force", job.earlier != Earlier::Keep),
    ] {
        if given {
            bail!(
                "{option}: not for a farm, which renders into its own folder, to the end, on other machines; leave it out"
            );
        }
    }
    Ok(job)
}

/// What is done with a session, whatever its criterion.
pub trait Work {
    type Outcome;
    fn run<C: Resumable>(self, session: Session<C>) -> anyhow::Result<Self::Outcome>;
}

/// Begins the session that a render would have.
pub fn on_session<W: Work>(
    job: &RenderJob,
    (width, height): (usize, usize),
    source: SourceIdentity,
    work: W,
) -> anyhow::Result<W::Outcome> {
    let params = job.params;
    match &job.judge {
        Judge::Oracle(oracle) => {
            let mut session = Session::new(width, height, oracle.as_ref().clone(), params)?;
            session.set_source(source);
            work.run(session)
        }
        Judge::Fixed(spp) => {
            let mut session = Session::new(width, height, FixedSpp(*spp), params)?;
            session.set_source(source);
            work.run(session)
        }
        _ => bail!(
            "a farm judges by the oracle or by `--criterion spp:N`; `noisefloor render` does all others"
        ),
    }
}

/// A source whose samples have been taken elsewhere.
pub struct Elsewhere(SourceInfo);

impl Elsewhere {
    pub fn new(name: &str, job: &ShardJob) -> Self {
        let (unit, counts, repeats) = (Unit::SamplesPerPixel, Counts::Asked, Repeats::Samples);
        let (width, height) = (job.width, job.height);
        Self(SourceInfo { name: name.to_owned(), width, height, unit, aims: true, repeats, counts })
    }
}

impl ProgressiveSource for Elsewhere {
    fn info(&self) -> SourceInfo {
        self.0.clone()
    }

    fn sample(&mut self, _requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let (name, what) = (self.0.name.clone(), "its samples are taken elsewhere".into());
        Err(SourceError::Contract { name, what })
    }
}

impl Source for Elsewhere {}

/// The session's shards.
struct Identity(SourceIdentity);

impl Work for Identity {
    type Outcome = ShardJob;

    fn run<C: Resumable>(self, session: Session<C>) -> anyhow::Result<ShardJob> {
        if session.criterion().needs().reference {
            bail!(
                "this model needs a reference, which a farm does not render; use a model trained on half buffers"
            );
        }
        Ok(ShardJob::of(self.0, &session))
    }
}

/// A frame of a farm.
pub struct Frame<'a> {
    folder: &'a FarmFolder,
    farm: &'a FarmJob,
    name: &'a str,
    render: RenderJob,
    job: FrameJob,
}

impl<'a> Frame<'a> {
    /// Opens the scene once, and keeps what it is.
    pub fn find_out(folder: &FarmFolder, farm: &FarmJob, index: usize, name: &str) -> anyhow::Result<()> {
        let place = folder.frame(name);
        if let Some(file) = render_in(&place) {
            bail!(
                "{}: holds a render already ({file}), which the farm would overwrite; move it away, or \
                 choose another folder for the farm",
                place.display()
            );
        }
        let render = parse(&farm.arguments_of(index))?;
        let mut opened = render.source.open()?;
        if index == 0 {
            opened.warn();
        }
        let info = opened.source.info();
        if info.repeats != Repeats::Samples {
            return Err(FarmError::Repeats(info.name).into());
        }
        if render.params.blocks > 0 && opened.source.sample_blocks(&[])?.is_none() {
            return Err(FarmError::Blocks(info.name).into());
        }
        let identity = Identity(opened.source.identity()?);
        let shards = on_session(&render, (info.width, info.height), opened.source.identity()?, identity)?;
        let job = FrameJob { scene: opened.scene, source: info.name, shards };
        Ok(folder.write_frame_job(name, &job)?)
    }

    pub fn open(
        folder: &'a FarmFolder,
        farm: &'a FarmJob,
        index: usize,
        name: &'a str,
    ) -> anyhow::Result<Self> {
        let render = parse(&farm.arguments_of(index))?;
        let job = folder.frame_job(name)?.with_context(|| format!("{name} was not planned"))?;
        Ok(Self { folder, farm, name, render, job })
    }

    /// Its tiles.
    pub fn grid(&self) -> Result<TileGrid, ShardError> {
        self.job.shards.grid()
    }

    /// Merges the shards that are there; how far the frame then is, and what it needs next.
    pub fn merge(self, pictures: Pictures) -> anyhow::Result<(FrameState, Vec<PlannedBatch>)> {
        let state = self.folder.state(self.name)?;
        if state.done {
            return Ok((state, Vec::new()));
        }
        let ShardJob { source, width, height, .. } = &self.job.shards;
        let work = Merge { state, pictures, frame: &self };
        on_session(&self.render, (*width, *height), source.clone(), work)
    }
}

struct Merge<'a> {
    frame: &'a Frame<'a>,
    state: FrameState,
    pictures: Pictures,
}

impl Work for Merge<'_> {
    type Outcome = (FrameState, Vec<PlannedBatch>);

    fn run<C: Resumable>(mut self, mut session: Session<C>) -> anyhow::Result<Self::Outcome> {
        let began = Instant::now();
        let Frame { folder, name, render, job, .. } = self.frame;
        job.shards.check(&ShardJob::of(job.shards.source.clone(), &session)).map_err(FarmError::Edited)?;

        // A merge that was killed may have written the last picture without saying so in its state
        let place = folder.frame(name);
        match Finished::of(&place, &session.checkpoint(JOB).job_digest())? {
            Finished::This => {
                let state = FrameState { done: true, open: 0, ..self.state };
                folder.write_state(name, &state)?;
                return Ok((state, Vec::new()));
            }
            Finished::Other => bail!(
                "{}: holds a picture of another job than the farm's; move it away, or plan the farm in another \
                 folder",
                place.display()
            ),
            Finished::Not => {}
        }

        // Take up the frame where the last merge left it
        let mut output = output_of(render, job, Folder::claim(place)?, Earlier::Overwrite)?;
        if let Some(checkpoint) = output.checkpoint()? {
            session = session.resume(JOB, checkpoint).with_context(|| output.checkpoint_file())?;
            output.take_up(session.film().total_samples());
        }

        // Add what is there, and keep it before anything is removed
        let mut shards = ShardSet::gather(&job.shards, &folder.shards(name)?);
        let merged = shards.merge_into(&mut session)?;
        let used_up = shards.used_up(&session);
        let source_seconds: f64 = used_up.iter().map(|shard| shard.seconds()).sum();
        let clock = self.count(&session, &used_up, source_seconds, began.elapsed().as_secs_f64());
        self.state.rounds += merged.rounds;
        if self.state.done || self.pictures == Pictures::Always || merged.batches > 0 {
            self.keep(&session, &mut output, clock)?;
        }
        folder.write_state(name, &self.state)?;
        self.put_away(&shards, &used_up)?;

        let mut wanted = PlannedBatch::ahead(&session);
        wanted.retain(|batch| !shards.has(batch));
        Ok((self.state, wanted))
    }
}

impl Merge<'_> {
    /// Notes how far the frame is, and the time that this merge stands for.
    fn count<C: Resumable>(
        &mut self,
        session: &Session<C>,
        used_up: &[&ShardFile],
        source_seconds: f64,
        merge_seconds: f64,
    ) -> Clock {
        let state = &mut self.state;
        state.samples = session.film().total_samples();
        state.sampled += used_up.iter().map(|shard| shard.samples()).sum::<u64>();
        state.source_seconds += source_seconds;
        state.merge_seconds += merge_seconds;
        (state.tiles, state.open) = (session.film().grid().len(), session.open_tiles());
        (state.to_go, state.done) = (session.expected_samples_to_go(), session.is_done());
        Clock {
            source_seconds,
            criterion_seconds: merge_seconds,
            total_seconds: source_seconds + merge_seconds,
        }
    }

    /// Writes the files of a render: pictures at the end, or if they are asked for.
    fn keep<C: Resumable>(
        &self,
        session: &Session<C>,
        output: &mut Output,
        clock: Clock,
    ) -> anyhow::Result<()> {
        let FrameState { tiles, open, samples, .. } = self.state;
        let now = TimelinePoint { seconds: clock.total_seconds, samples, active_tiles: open };
        output.record(session, &Progress { now, tiles, eta_seconds: None });
        let checkpoint = Some(session.checkpoint(JOB));
        if self.state.done || self.pictures == Pictures::Always {
            let source = Elsewhere::new(&self.frame.job.source, &self.frame.job.shards);
            output.write(session, checkpoint, (clock, &source))
        } else {
            output.write_progress(session, checkpoint)
        }
    }

    /// Puts away the shards that are used up, and those that cannot be used.
    fn put_away(&self, shards: &ShardSet, used_up: &[&ShardFile]) -> anyhow::Result<()> {
        let Frame { folder, farm, name, .. } = self.frame;
        warn(shards.problems());
        let useless: Vec<_> = shards.problems().iter().filter(|problem| problem.useless).collect();
        for shard in used_up.iter().filter(|shard| useless.iter().all(|problem| problem.path != shard.path()))
        {
            folder.retire(name, shard, farm.keep)?;
        }
        for problem in useless {
            let aside = folder.set_aside(&problem.path)?;
            note!("{} was put aside; what it lacks is rendered again", aside.display());
        }
        Ok(())
    }
}

/// The output folder of a frame: that of a render.
pub fn output_of(
    render: &RenderJob,
    job: &FrameJob,
    folder: Folder,
    earlier: Earlier,
) -> anyhow::Result<Output> {
    let (scene, source) = (job.scene.clone(), job.source.clone());
    let info = Elsewhere::new(&source, &job.shards).info();
    let origin = origin(&render.source, &scene, &info);
    let mut output = Output::create(folder, earlier, scene, source, render.source.seed)?;
    output.origin = origin;
    if let Judge::Oracle(oracle) = &render.judge {
        output.model = Some(oracle.model().digest());
    }
    Ok(output)
}
