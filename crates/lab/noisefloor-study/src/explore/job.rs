//! Retraining in the background, one job at a time.

use super::learn::{LearnStep, Learned, retrain};
use noisefloor::{Model, People};
use noisefloor_learn::{Answer, Table, TrainParams};
use serde::Serialize;
use std::sync::{Arc, Mutex, PoisonError};

/// The job, in JSON as the page sees it.
#[derive(Debug, Default, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
pub(crate) enum Job {
    #[default]
    Idle,
    Running(LearnStep),
    Failed {
        what: String,
    },
    Done(Box<Retrained>),
}

#[derive(Debug, Serialize)]
pub(crate) struct Retrained {
    #[serde(skip)]
    model: Model,
    #[serde(flatten)]
    learned: Learned,
}

impl Job {
    pub(crate) fn is_running(&self) -> bool {
        matches!(self, Self::Running(_))
    }

    pub(crate) fn model(&self) -> Option<&Model> {
        match self {
            Self::Done(done) => Some(&done.model),
            _ => None,
        }
    }
}

/// Starts retraining. The caller marks the job as running first.
pub(crate) fn begin(job: Arc<Mutex<Job>>, table: Table, answers: Vec<Answer>, model: Model, people: People) {
    let set = move |to: Job| *job.lock().unwrap_or_else(PoisonError::into_inner) = to;
    // The model's corpus names this table only if their digests agree
    let corpus = if model.record().table_digest == table.digest() {
        model.record().corpus.clone()
    } else {
        format!("a table of {}", table.scenes().join(", "))
    };
    // A thread, not a task: stopping the server does not wait for it
    std::thread::spawn(move || {
        let work = || {
            let on_step = |step| set(Job::Running(step));
            let params = TrainParams::for_descriptor(&table.descriptor);
            retrain(&table, answers, &params, (&model, people), &corpus, on_step)
        };
        // A panic in the solver must not leave the page waiting
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
        set(match outcome {
            Ok(Ok((model, learned))) => Job::Done(Box::new(Retrained { model, learned })),
            Ok(Err(error)) => Job::Failed { what: error.to_string() },
            Err(_) => Job::Failed { what: "the training met a contradiction and gave up".into() },
        });
    });
}
