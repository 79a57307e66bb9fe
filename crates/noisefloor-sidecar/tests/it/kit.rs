use noisefloor::{Request, Rgb, Tile, TileGrid};
use noisefloor_sidecar::{HostOptions, Job, Renderer, Sidecar, SidecarError};
use noisefloor_testkit::{HANG, require_python};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub(crate) const FAKE: Renderer = Renderer {
    name: "fake",
    title: "Fake",
    script: include_str!("fake_host.py"),
    requirements: "",
    pythons: &[10, 11, 12, 13, 14],
    probe: "print('1.0')",
};

/// The image of the fake renderer: 4 tiles of 32 pixels, all but the first ragged.
pub(crate) const SIZE: (usize, usize) = (48, 40);

/// Calls of the fake renderer, with a folder for its files.
pub(crate) struct Fake {
    pub(crate) python: PathBuf,
    pub(crate) folder: TempDir,
    pub(crate) options: BTreeMap<String, String>,
    pub(crate) job: Job,
}

impl Fake {
    /// `None` without Python, as `require_python` says it.
    pub(crate) fn new(how: &str) -> Option<Self> {
        let python = require_python()?;
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene π.fake");
        std::fs::write(&scene, "lamps").unwrap();
        let pids = folder.path().join("pids").display().to_string();
        let options = BTreeMap::from([("how".to_owned(), how.to_owned()), ("pids".to_owned(), pids)]);
        let mut job = Job::new(scene);
        (job.timeout, job.seed) = (HANG, 5);
        Some(Self { python, folder, options, job })
    }

    /// It misbehaves in one process, and in no other.
    pub(crate) fn once(mut self) -> Self {
        self.options.insert("once".to_owned(), self.folder.path().join("once").display().to_string());
        self
    }

    pub(crate) fn open(&self) -> Result<Sidecar, SidecarError> {
        let mut options = HostOptions::default();
        options.options = self.options.clone();
        Sidecar::open(&FAKE, &self.python, &self.job, options)
    }

    /// Process numbers of all processes so far.
    pub(crate) fn pids(&self) -> Vec<u32> {
        pids(&self.folder.path().join("pids"))
    }
}

pub(crate) fn pids(file: &Path) -> Vec<u32> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    text.lines().filter_map(|line| line.parse().ok()).collect()
}

pub(crate) fn tiles() -> Vec<Tile> {
    TileGrid::new(SIZE.0, SIZE.1, 26).unwrap().tiles().collect()
}

pub(crate) fn requests(first: u64, samples: u64) -> Vec<Request> {
    tiles().into_iter().map(|tile| Request::new(tile, first, samples)).collect()
}

/// What fake_host.py renders.
pub(crate) fn expected(seed: u64, request: &Request) -> Vec<Rgb> {
    let Request { tile, first, spp: samples, .. } = *request;
    let value = |x: usize, y: usize, s: u64, c: usize| {
        let mixed = (seed * 31 + x as u64 * 7 + y as u64 * 13 + s * 17 + c as u64 * 5) % 97;
        mixed as f64 / 97.0
    };
    let mean = |x, y, c| {
        let sum: f64 = (first..first + samples).map(|s| value(x, y, s, c)).sum();
        (sum / samples as f64) as f32
    };
    let pixels =
        (tile.y..tile.y + tile.height).flat_map(|y| (tile.x..tile.x + tile.width).map(move |x| (x, y)));
    pixels.map(|(x, y)| [0, 1, 2].map(|c| mean(x, y, c))).collect()
}
