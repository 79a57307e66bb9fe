//! Tiles as PNG files, made once a level and kept while there is room.

use crate::config::Study;
use crate::error::StudyError;
use axum::body::Bytes;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{OnceCell, Semaphore};

/// Room for encoded tiles, in bytes; a level that is being asked for is made even if it alone is larger.
const ROOM: usize = 512 << 20;
/// Levels that are made at the same time: each needs the memory of its picture.
const AT_ONCE: usize = 2;

/// Stack, level and frame.
type Key = (u32, u32, u32);
type Tiles = Arc<OnceCell<Arc<Vec<Bytes>>>>;

#[derive(Default)]
struct Kept {
    levels: HashMap<Key, (u64, usize, Tiles)>,
    clock: u64,
    bytes: usize,
}

/// Encoded tiles by stack, level and frame.
pub(crate) struct TileCache {
    study: Arc<Study>,
    kept: Mutex<Kept>,
    makers: Semaphore,
}

impl TileCache {
    pub(crate) fn new(study: Arc<Study>) -> Self {
        Self { study, kept: Mutex::default(), makers: Semaphore::new(AT_ONCE) }
    }

    /// All tiles of a level that exists. Whoever asks while they are made waits for them.
    pub(crate) async fn level(&self, key: Key) -> Result<Arc<Vec<Bytes>>, StudyError> {
        let cell = {
            let mut kept = self.lock();
            kept.clock += 1;
            let clock = kept.clock;
            let (used, _, cell) = kept.levels.entry(key).or_default();
            *used = clock;
            cell.clone()
        };
        let tiles = cell.get_or_try_init(|| self.make(key)).await?;
        Ok(tiles.clone())
    }

    async fn make(&self, key: Key) -> Result<Arc<Vec<Bytes>>, StudyError> {
        let stopped = || StudyError::Other("the server is being stopped".to_owned());
        let _turn = self.makers.acquire().await.map_err(|_| stopped())?;
        let (study, (stack, level, frame)) = (self.study.clone(), key);
        let work = move || study.stacks[stack as usize].tile_pngs(level, frame);
        let pngs = tokio::task::spawn_blocking(work).await.map_err(|_| stopped())??;
        let tiles: Vec<Bytes> = pngs.into_iter().map(Bytes::from).collect();
        self.account(key, tiles.iter().map(Bytes::len).sum());
        Ok(Arc::new(tiles))
    }

    /// Notes the size of a level, and forgets those unused for longest while there is no room.
    fn account(&self, key: Key, bytes: usize) {
        let mut kept = self.lock();
        if let Some(entry) = kept.levels.get_mut(&key) {
            entry.1 = bytes;
            kept.bytes += bytes;
        }
        while kept.bytes > ROOM {
            let others = kept.levels.iter().filter(|(k, (_, bytes, _))| **k != key && *bytes > 0);
            let Some(oldest) = others.min_by_key(|(_, (used, ..))| *used).map(|(k, _)| *k) else { break };
            let freed = kept.levels.remove(&oldest).map_or(0, |(_, bytes, _)| bytes);
            kept.bytes -= freed;
        }
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
