//! `noisefloor merge`.

use super::frame::{Elsewhere, Work, on_session, output_of, parse};
use super::warn;
use crate::args::MergeArgs;
use crate::folder::{Earlier, Folder};
use crate::render::{JOB, RenderJob};
use crate::say::{note, say};
use anyhow::{Context, bail};
use noisefloor::{
    Session,
    criterion::Resumable,
    driver::{Clock, Progress, TimelinePoint},
};
use noisefloor_farm::{FarmError, FrameJob, ShardFile, ShardJob, ShardSet};
use std::process::ExitCode;

/// What is missing is named so far.
const MOST_NAMED: usize = 5;

pub fn merge(args: MergeArgs) -> anyhow::Result<ExitCode> {
    let Some(first) = args.shards.iter().find_map(|path| ShardFile::open(path).ok()) else {
        let error = ShardFile::open(&args.shards[0]).err().map(|e| e.to_string()).unwrap_or_default();
        bail!("none of these files is a shard; {}: {error}", args.shards[0].display());
    };
    let render = parse(first.arguments()).with_context(|| {
        format!("{}: its job cannot be set up; merge where its model and LUT are", first.path().display())
    })?;
    let shards = first.job().clone();
    let (scene, source) = first.names().unwrap_or(("unnamed scene", "unnamed renderer"));
    let job = FrameJob { scene: scene.to_owned(), source: source.to_owned(), shards };
    let ShardJob { source, width, height, .. } = job.shards.clone();
    on_session(&render, (width, height), source, Whole { args: &args, render: &render, job: &job })
}

/// Merges everything from the beginning.
struct Whole<'a> {
    args: &'a MergeArgs,
    render: &'a RenderJob,
    job: &'a FrameJob,
}

impl Work for Whole<'_> {
    type Outcome = ExitCode;

    fn run<C: Resumable>(self, mut session: Session<C>) -> anyhow::Result<ExitCode> {
        let Self { args, render, job } = self;
        let now = ShardJob::of(job.shards.source.clone(), &session);
        now.check(&job.shards).map_err(FarmError::Edited)?;
        let folder = Folder::claim(args.out.clone())?;
        let mut output = output_of(render, job, folder, Earlier::of(args.force, false))?;
        let mut shards = ShardSet::gather(&now, &args.shards);
        let merged = shards.merge_into(&mut session)?;
        shards.find_overlaps(&session);
        warn(shards.problems());

        let seconds: f64 = shards.files().iter().map(ShardFile::seconds).sum();
        let clock = Clock { source_seconds: seconds, criterion_seconds: 0.0, total_seconds: seconds };
        let film = session.film();
        let point =
            TimelinePoint { seconds, samples: film.total_samples(), active_tiles: session.open_tiles() };
        output.record(&session, &Progress { now: point, tiles: film.grid().len(), eta_seconds: None });
        let source = Elsewhere::new(&job.source, &job.shards);
        output.write(&session, Some(session.checkpoint(JOB)), (clock, &source))?;
        say!(
            "{} batches of {} shards, {} of {} tiles done; written to {}",
            merged.batches,
            shards.files().len(),
            film.grid().len() - session.open_tiles(),
            film.grid().len(),
            output.folder()
        )?;
        if session.is_done() {
            return Ok(ExitCode::SUCCESS);
        }
        let missing = session.next_batches();
        for batch in missing.iter().take(MOST_NAMED) {
            let (first, end) = (batch.first, batch.first + batch.spp);
            note!("warning: no shard has tile {}, samples {first} to {end}", batch.tile.index);
        }
        if missing.len() > MOST_NAMED {
            note!("warning: nor the next samples of {} more tiles", missing.len() - MOST_NAMED);
        }
        note!(
            "`noisefloor render --resume` with the same options and this output folder takes what is missing"
        );
        Ok(ExitCode::FAILURE)
    }
}
