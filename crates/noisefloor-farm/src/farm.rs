//! A farm: planned once, then rounds of tasks and merges until every frame is done.

use crate::batch::PlannedBatch;
use crate::error::{FarmError, PathFault};
use crate::folder::{FarmFolder, FarmLock};
use crate::frame::{Frame, Pictures};
use crate::local::run_local;
use crate::plan::{Task, split};
use crate::shard::Shard;
use crate::slurm::Slurm;
use crate::state::{FarmPlan, FrameJob, FrameState, Frames, Round, RoundState};
use crate::studio::{News, Studio};
use crate::task::sample;
use noisefloor::ProgressiveSource;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Rounds in a row without samples after which a farm gives up.
const MOST_BARREN: usize = 3;
/// Seconds that a step waits for the lock of its folder.
const LOCK_TRIES: usize = 600;

/// A farm in its folder: to be looked at, and to take tasks from.
pub struct Farm<'a, S: Studio> {
    studio: &'a S,
    folder: FarmFolder,
    plan: FarmPlan<S::Job>,
}

/// The farm as the one process that plans and merges sees it.
pub struct Coordinator<'a, S: Studio> {
    farm: Farm<'a, S>,
    _lock: FarmLock,
}

/// The samples that one process takes.
pub struct Order<'a, J> {
    folder: &'a FarmFolder,
    name: String,
    frame: FrameJob,
    task: Task,
    shard: PathBuf,
    /// The render that they are of.
    pub job: J,
}

/// What came of an order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Delivery {
    pub frame: String,
    /// Batches in the shard.
    pub batches: usize,
    /// Batches that were asked for.
    pub of: usize,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FarmProgress {
    /// The round under way, or the last one.
    pub round: usize,
    pub tasks: usize,
    /// Tasks whose shards are there.
    pub delivered: usize,
    pub slurm_left: Option<usize>,
    pub done: bool,
    pub frames: Vec<FrameProgress>,
    /// Seconds since the round was planned.
    #[serde(skip)]
    pub seconds: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameProgress {
    pub frame: String,
    /// Whether it waits for the frame whose exposure it is to have.
    pub waits: bool,
    /// Samples per pixel, in the mean.
    pub spp: f64,
    /// Seconds left, at the pace of the last round.
    pub eta_seconds: Option<f64>,
    #[serde(flatten)]
    pub state: FrameState,
}

/// Seconds since 1970.
fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

impl<'a, S: Studio> Farm<'a, S> {
    /// Says what is to be rendered in a folder, and opens every scene once.
    pub fn plan(studio: &'a S, dir: &Path, plan: FarmPlan<S::Job>) -> Result<(), FarmError> {
        let folder = FarmFolder::new(dir);
        if folder.planned::<S::Job>()?.is_some() {
            let what =
                "a farm was planned here already; leave out what follows `--`, or choose another folder";
            return Err(FarmError::at(dir, what.to_owned()));
        }
        let _lock = folder.lock()?;
        let farm = Self { studio, folder, plan };
        for (index, name) in farm.plan.names().iter().enumerate() {
            let waits = farm.plan.waits(index);
            farm.of_job(farm.planned_job(index), name).plan(waits).map_err(FarmError::of(name))?;
        }
        // Last: a farm whose plan was killed is none
        farm.folder.write_plan(&farm.plan)
    }

    pub fn open(studio: &'a S, dir: &Path) -> Result<Self, FarmError> {
        let folder = FarmFolder::new(dir);
        let plan = folder.plan()?;
        Ok(Self { studio, folder, plan })
    }

    /// Locks the folder, to plan and to merge.
    pub fn claim(self) -> Result<Coordinator<'a, S>, FarmError> {
        let lock = self.folder.lock()?;
        Ok(Coordinator { farm: self, _lock: lock })
    }

    pub fn folder(&self) -> &FarmFolder {
        &self.folder
    }

    fn of_job<'b>(&'b self, job: S::Job, name: &'b str) -> Frame<'b, S> {
        Frame { studio: self.studio, folder: &self.folder, name, job, keep: self.plan.keep }
    }

    /// The render of a frame, as far as it is known without other frames.
    fn planned_job(&self, index: usize) -> S::Job {
        match self.plan.frames.as_ref().and_then(|frames| frames.get(index)) {
            Some(frame) => self.studio.of_frame(&self.plan.job, frame),
            None => self.plan.job.clone(),
        }
    }

    /// The render of a frame; those that it waits for are done.
    fn job(&self, index: usize) -> Result<S::Job, FarmError> {
        let job = self.planned_job(index);
        let frame = self.plan.frames.as_ref().and_then(|frames| frames.get(index));
        let Some(frame) = frame.filter(|_| self.plan.waits(index)) else { return Ok(job) };
        let with_folder = |&frame: &i32| (frame, self.folder.frame(&Frames::folder(frame)));
        let first: Vec<_> = self.plan.first.iter().map(with_folder).collect();
        Ok(self.studio.after(&job, frame, &first)?)
    }

    /// Whether the frames that others wait for are done.
    fn are_first_done(&self) -> Result<bool, FarmError> {
        for &frame in &self.plan.first {
            if !self.folder.state(&Frames::folder(frame))?.done {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Merges a frame; it is nowhere as long as it waits for others.
    fn merge(
        &self,
        index: usize,
        name: &str,
        pictures: Pictures,
    ) -> Result<(FrameState, Vec<PlannedBatch>), FarmError> {
        let waits = self.plan.waits(index);
        if waits && !self.are_first_done()? {
            return Ok((FrameState::default(), Vec::new()));
        }
        let frame = self.of_job(self.job(index)?, name);
        if waits {
            frame.begin()?;
        }
        frame.merge(pictures)
    }

    /// Frames by their indices: those that others wait for come first.
    fn in_order(&self) -> impl Iterator<Item = usize> {
        let frames = self.plan.frames.as_ref().map_or(1, Frames::count);
        let waiting = |waits| (0..frames).filter(move |&index| self.plan.waits(index) == waits);
        waiting(false).chain(waiting(true))
    }

    /// What a task of the round under way is to do.
    pub fn order(&self, number: usize, task: usize) -> Result<Order<'_, S::Job>, FarmError> {
        let round = self.folder.round()?;
        let names = self.plan.names();
        let wanted = round.tasks.into_iter().nth(task).filter(|_| round.number == number);
        let wanted = wanted.and_then(|wanted| Some((names.get(wanted.frame)?.clone(), wanted)));
        let no_task = || FarmError::at(self.folder.path(), PathFault::NoTask { number, task });
        let (name, wanted) = wanted.ok_or_else(no_task)?;
        Ok(Order {
            folder: &self.folder,
            frame: self.folder.frame_job(&name)?,
            shard: self.folder.shard(&name, number, task),
            job: self.job(wanted.frame)?,
            task: wanted,
            name,
        })
    }

    pub fn progress(&self) -> Result<FarmProgress, FarmError> {
        let (round, names) = (self.folder.round()?, self.plan.names());
        let is_there = |(index, task): (usize, &Task)| {
            names.get(task.frame).is_some_and(|name| self.folder.shard(name, round.number, index).exists())
        };
        let delivered = round.tasks.iter().enumerate().filter(|task| is_there(*task)).count();
        let mut frames = Vec::new();
        for name in &names {
            let (state, shards) = (self.folder.state(name)?, self.folder.frame_job(name)?.shards);
            let pace = (round.brought > 0 && round.took > 0.0).then(|| round.brought as f64 / round.took);
            let eta_seconds = pace.zip(state.to_go).map(|(pace, samples)| samples as f64 / pace);
            let (waits, spp) =
                (state.tiles == 0, state.samples as f64 / (shards.width * shards.height) as f64);
            frames.push(FrameProgress { frame: name.clone(), waits, spp, eta_seconds, state });
        }
        let slurm_left = round.slurm().and_then(|jobs| match Slurm::left(jobs) {
            Ok(left) => Some(left),
            Err(error) => {
                self.studio.tell(News::Unsure(round.number, &error));
                None
            }
        });
        Ok(FarmProgress {
            round: round.number,
            tasks: round.tasks.len(),
            delivered,
            slurm_left,
            done: frames.iter().all(|frame| frame.state.done),
            frames,
            seconds: (now() - round.planned).max(0.0),
        })
    }

    /// Looks after rounds on Slurm until all is done, every so often. Jobs can vanish: a node takes the
    /// step with it, or somebody cancels them; they are submitted again.
    pub fn wait(self, slurm: &Slurm, every: Duration) -> Result<(), FarmError> {
        let mut vanished = 0;
        loop {
            std::thread::sleep(every.max(Duration::from_millis(100)));
            let states: Result<Vec<_>, _> =
                self.plan.names().iter().map(|name| self.folder.state(name)).collect();
            if states?.iter().all(|state| state.done) {
                return Ok(());
            }
            let round = self.folder.round()?;
            let left = round.slurm().map_or(Ok(0), Slurm::left)?;
            // A step that has just ended may have submitted another round since the file was read
            if left > 0 || self.folder.round()? != round {
                vanished = 0;
                continue;
            }
            self.check_fruitful(&round)?;
            vanished += 1;
            if vanished > MOST_BARREN {
                let coordinator = Self::open(self.studio, self.folder.path())?.claim()?;
                self.studio.tell(News::Vanished(round.number));
                coordinator.submit(slurm)?;
                vanished = 0;
            }
        }
    }

    fn check_fruitful(&self, round: &Round) -> Result<(), FarmError> {
        match round.barren {
            Some(rounds) if rounds >= MOST_BARREN => {
                let log = self.folder.log(round.number.saturating_sub(1), 0);
                Err(FarmError::at(self.folder.path(), PathFault::Barren { rounds, log }))
            }
            _ => Ok(()),
        }
    }
}

impl<J: Serialize> Order<'_, J> {
    /// Takes the samples, and writes them. Once `cancel` says so, it writes those that it has.
    ///
    /// # Errors
    /// [`FarmError`] if the source is not the planned one, fails, or gives nothing before it is cancelled.
    pub fn deliver(
        self,
        source: &mut impl ProgressiveSource,
        cancel: impl Fn() -> bool,
    ) -> Result<Delivery, FarmError> {
        let FrameJob { scene, source: renderer, shards, .. } = self.frame;
        let shard: Shard = sample(source, shards, &self.task.batches, cancel)?;
        if shard.is_empty() {
            let what = "stopped before the first batch was there".to_owned();
            return Err(FarmError::at(self.folder.path(), what));
        }
        let shard = shard.with_render(&self.job).with_names(scene, renderer);
        shard.write(self.shard)?;
        Ok(Delivery { frame: self.name, batches: shard.len(), of: self.task.batches.len() })
    }
}

impl<S: Studio> Coordinator<'_, S> {
    /// Merges what is there, judges, and plans the next round; it has no tasks if everything is done.
    pub fn next_round(&self) -> Result<Round, FarmError> {
        self.check_idle()?;
        self.advance()
    }

    fn advance(&self) -> Result<Round, FarmError> {
        let Farm { folder, plan, .. } = &self.farm;
        let before = folder.round()?;
        let (names, mut samples) = (plan.names(), 0);
        let mut needs = vec![Vec::new(); names.len()];
        for index in self.farm.in_order() {
            let name = &names[index];
            let (state, batches) =
                self.farm.merge(index, name, Pictures::WhenDone).map_err(FarmError::of(name))?;
            samples += state.samples;
            needs[index] = batches;
        }
        let mut wanted = Vec::new();
        for (name, batches) in names.iter().zip(needs) {
            let grid = folder.frame_job(name)?.shards.grid().map_err(FarmError::Edited);
            wanted.push((grid.map_err(FarmError::of(name))?, batches));
        }
        let planned = now();
        let (started, brought) = (before.is_started(), samples - before.samples.min(samples));
        let barren = if started && brought == 0 { before.barren.map_or(0, |barren| barren + 1) } else { 0 };
        let round = Round {
            number: before.number + usize::from(started || before.number == 0),
            tasks: split(wanted, plan.tasks),
            planned,
            took: if started { (planned - before.planned).max(0.0) } else { 0.0 },
            samples,
            brought,
            barren: Some(barren),
            state: RoundState::Planned,
        };
        folder.write_round(&round)?;
        Ok(round)
    }

    /// Merges what is there, and writes the pictures as far as they are; how far each frame is.
    pub fn merge(&self) -> Result<Vec<(String, FrameState)>, FarmError> {
        let names = self.farm.plan.names();
        let merge = |(index, name): (usize, String)| {
            let merged = self.farm.merge(index, &name, Pictures::Always);
            let (state, _) = merged.map_err(FarmError::of(&name))?;
            Ok((name, state))
        };
        names.into_iter().enumerate().map(merge).collect()
    }

    /// Refuses to work on a round that Slurm is working on.
    fn check_idle(&self) -> Result<(), FarmError> {
        let Round { number, state, .. } = self.farm.folder.round()?;
        let RoundState::OnSlurm(jobs) = state else { return Ok(()) };
        match Slurm::left(&jobs) {
            Ok(0) => {}
            Ok(left) => {
                let fault = PathFault::UnderWay { number, tasks: jobs.tasks, step: jobs.step, left };
                return Err(FarmError::at(self.farm.folder.path(), fault));
            }
            Err(error) => self.farm.studio.tell(News::Unsure(number, &error)),
        }
        Ok(())
    }

    /// Begins rounds that somebody asked for: what was wrong has been mended, and a round that was killed
    /// meanwhile is no sign of the contrary.
    pub fn begin(&self) -> Result<(), FarmError> {
        self.check_idle()?;
        let round = self.farm.folder.round()?;
        let state = if round.is_started() { RoundState::Started } else { RoundState::Planned };
        self.farm.folder.write_round(&Round { barren: None, state, ..round })
    }

    /// Renders round after round in `processes` at a time of `program`; see [`run_local`]. False if `cancel`
    /// ended it.
    pub fn run_local(
        &self,
        program: &Path,
        processes: usize,
        cancel: impl Fn() -> bool,
    ) -> Result<bool, FarmError> {
        let Farm { folder, studio, .. } = &self.farm;
        loop {
            let round = self.advance()?;
            if round.tasks.is_empty() {
                return Ok(true);
            }
            self.farm.check_fruitful(&round)?;
            let round = Round { state: RoundState::Started, ..round };
            folder.write_round(&round)?;
            studio.tell(News::Round(&round));
            let failed = run_local(program, folder, &round, processes, &cancel)?;
            if cancel() {
                self.advance()?;
                return Ok(false);
            }
            if let Some(first) = failed.first() {
                let (tasks, log) = (round.tasks.len(), folder.log(round.number, *first));
                studio.tell(News::Failed { failed: failed.len(), tasks, log });
            }
        }
    }

    /// Merges, plans, and submits what is planned; false if everything is done.
    pub fn submit(&self, slurm: &Slurm) -> Result<bool, FarmError> {
        let Farm { folder, studio, .. } = &self.farm;
        let mut round = self.advance()?;
        if round.tasks.is_empty() {
            return Ok(false);
        }
        self.farm.check_fruitful(&round)?;
        if round.tasks.len() > Slurm::most_tasks() {
            // The rest comes with the next round
            round.tasks.truncate(Slurm::most_tasks());
            folder.write_round(&round)?;
        }
        round.state = RoundState::OnSlurm(slurm.submit(folder, &round)?);
        folder.write_round(&round)?;
        studio.tell(News::Round(&round));
        Ok(true)
    }

    /// What follows a round on Slurm: merge, judge, and submit the next one; false if everything is done.
    /// Waits for a `farm merge` that somebody has typed meanwhile: without this step nothing would go on.
    /// `own` is its Slurm job.
    pub fn step<'a>(
        farm: Farm<'a, S>,
        number: usize,
        own: Option<&str>,
        slurm: &Slurm,
    ) -> Result<bool, FarmError>
    where
        S: 'a,
    {
        let mut tries = 0;
        let _lock = loop {
            match farm.folder.lock() {
                Err(FarmError::Path { fault: PathFault::Locked, .. }) if tries < LOCK_TRIES => {
                    tries += 1;
                    std::thread::sleep(Duration::from_secs(1));
                }
                claimed => break claimed?,
            }
        };
        let coordinator = Coordinator { farm, _lock };
        let round = coordinator.farm.folder.round()?;
        // A step that Slurm started once more, or whose round was given up
        let superseded = round.slurm().zip(own).is_some_and(|(jobs, own)| jobs.step != own);
        if round.number != number || superseded {
            return Err(FarmError::Superseded { number, now: round.number });
        }
        coordinator.submit(slurm)
    }
}
