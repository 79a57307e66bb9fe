use noisefloor_exr::write_png;
use noisefloor_study::simulated::Public;
use noisefloor_study::{Server, Study};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;
use tempfile::TempDir;
use tokio::sync::oneshot;

/// A running mean of `spp` samples of a picture with texture: noise of variance 0.1/spp, uniform, from fixed seeds.
pub(crate) fn picture(width: usize, height: usize, spp: u64) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(spp);
    let amplitude = (3.0f64 * 0.1 / spp as f64).sqrt();
    let value = |i: usize| {
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        0.35 + 0.25 * (x / 17.0).sin() * (y / 23.0).cos() + 0.1 * x / width as f64
    };
    let byte = |v: f64| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    (0..width * height)
        .flat_map(|i| {
            let shown = byte(value(i) + amplitude * (2.0 * random.f64() - 1.0));
            [shown, shown, shown]
        })
        .collect()
}

/// A folder of running means.
pub(crate) fn stack(dir: &Path, (width, height): (usize, usize), levels: &[u64]) {
    std::fs::create_dir_all(dir).unwrap();
    for &spp in levels {
        write_png(dir.join(format!("{spp:05}.png")), width, height, &picture(width, height, spp)).unwrap();
    }
}

/// Levels that grow by a factor, from 10 on.
pub(crate) fn levels(count: usize, factor: f64) -> Vec<u64> {
    (0..count).map(|i| (10.0 * factor.powi(i as i32)).round() as u64).collect()
}

/// A folder with a study file.
pub(crate) struct Folder {
    pub(crate) dir: TempDir,
    pub(crate) file: PathBuf,
}

impl Folder {
    /// `stacks` of 64×32 pixels in tiles of 32, with `extra` lines in the study file.
    pub(crate) fn new(protocol: &str, stacks: &[&str], levels: &[u64], extra: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let mut text =
            format!("protocol = \"{protocol}\"\ndatabase = \"answers.sqlite\"\ntile = 32\n{extra}\n");
        text += "[text.en]\ntitle = \"Walls\"\ninstructions = \"Look.\"\nconsent = \"I take part.\"\n";
        for name in stacks {
            stack(&dir.path().join(name), (64, 32), levels);
            text += &format!("[[stack]]\nname = \"{name}\"\nfolder = \"{name}\"\n");
            if protocol == "validation" {
                let last = levels[levels.len() / 2];
                std::fs::write(
                    dir.path().join(format!("{name}.csv")),
                    format!("tile,spp\n0,{last}\n1,{last}\n"),
                )
                .unwrap();
                text += &format!("stops = \"{name}.csv\"\n");
            }
        }
        let file = dir.path().join("study.toml");
        std::fs::write(&file, text).unwrap();
        Self { dir, file }
    }

    pub(crate) fn study(&self) -> Arc<Study> {
        Arc::new(Study::open(&self.file).unwrap())
    }
}

/// A server in a thread of its own, until it is dropped.
pub(crate) struct Running {
    pub(crate) address: SocketAddr,
    pub(crate) url: String,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    pub(crate) fn start(study: Arc<Study>) -> Self {
        let (stop, stopped) = oneshot::channel::<()>();
        let (tell, told) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let runtime =
                tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
            runtime.block_on(async {
                let server = Server::bind(study, ([127, 0, 0, 1], 0).into(), &[]).await.unwrap();
                tell.send(server.address()).unwrap();
                server.run(async { drop(stopped.await) }).await.unwrap();
            });
        });
        let address = told.recv().unwrap();
        Self { address, url: format!("http://{address}"), stop: Some(stop), thread: Some(thread) }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

/// Observers whose median stops seeing noise at these thresholds, the same in each stack.
pub(crate) fn public(stacks: usize, thresholds: &[f64]) -> Public {
    Public {
        thresholds: vec![thresholds.to_vec(); stacks],
        between: 0.3,
        within: 0.1,
        lapse: 0.01,
        bias: 0.0,
    }
}
