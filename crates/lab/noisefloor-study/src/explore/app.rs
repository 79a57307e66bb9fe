//! State shared by all requests: the model, the pictures, and the stored answers.

use super::answers::Disagreements;
use super::gallery::Gallery;
use super::job::Job;
use super::verdicts::Judged;
use noisefloor::{Audience, Model, Viewing, tile::DEFAULT_TILE};
use noisefloor_learn::Table;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

#[derive(Debug)]
pub struct ExploreSetup {
    pub model: Model,
    /// Initial probability from which a tile counts as converged.
    pub people: noisefloor::People,
    pub audience: Audience,
    /// On which display pictures are seen, and from how far.
    pub viewing: Viewing,
    /// Initial tile edge in pixels, 16…512.
    pub tile: usize,
    pub database: PathBuf,
    /// Human thresholds for retraining; without them the page cannot retrain.
    pub table: Option<Table>,
    /// Layer of EXR files that is read; `None` for the one that renderers mean.
    pub layer: Option<String>,
    /// Pictures to start with.
    pub pictures: Vec<PathBuf>,
}

impl ExploreSetup {
    /// Defaults: the bundled model, and disagreements stored in `database`.
    pub fn new(database: impl AsRef<Path>) -> Self {
        Self {
            model: Model::bundled(),
            people: noisefloor::People::DEFAULT,
            audience: Audience::TRAINED,
            viewing: Model::bundled().viewing(),
            tile: DEFAULT_TILE,
            database: database.as_ref().to_owned(),
            table: None,
            layer: None,
            pictures: Vec::new(),
        }
    }
}

pub(crate) struct App {
    pub(super) setup: ExploreSetup,
    pub(super) kept: Arc<Disagreements>,
    pub(super) gallery: Mutex<Gallery>,
    /// Described pictures; locked while one is being described.
    pub(super) judged: tokio::sync::Mutex<Judged>,
    /// Locked during an upload, so that memory holds one file at a time.
    pub(super) incoming: tokio::sync::Mutex<()>,
    pub(super) job: Arc<Mutex<Job>>,
}

impl App {
    pub(super) fn gallery(&self) -> MutexGuard<'_, Gallery> {
        self.gallery.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn job(&self) -> MutexGuard<'_, Job> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
