use noisefloor_image::write_png;
use noisefloor_pages::http::Exposure;
use noisefloor_study::explore::{ExploreServer, ExploreSetup};
use noisefloor_study::simulated::Public;
use noisefloor_study::{Study, StudyServer};
use noisefloor_testkit::HANG;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::thread::JoinHandle;
use tempfile::TempDir;
use tokio::sync::oneshot;

const LOCAL: ([u8; 4], u16) = ([127, 0, 0, 1], 0);
pub(crate) const JSON: &str = "content-type: application/json\r\n";

/// A running mean of `spp` samples of a picture with texture: noise of variance 0.1/spp, uniform, from
/// fixed seeds.
pub(crate) fn picture(width: usize, height: usize, spp: u64) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(spp);
    let amplitude = (3.0f64 * 0.5 / spp as f64).sqrt();
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

/// Folders of running means for the frames of a loop: noise that is new in each, and in the first four pixels
/// of the first four rows a grey by the number of the frame.
pub(crate) fn film(dir: &Path, (width, height): (usize, usize), levels: &[u64], frames: usize) {
    for frame in 0..frames {
        let folder = dir.join(format!("{:04}", frame + 1));
        std::fs::create_dir_all(&folder).unwrap();
        for &spp in levels {
            // Shifted by rows, so that the noise is new in each frame; that the wall moves as well does not
            // matter
            let mut bytes = picture(width, height, spp);
            bytes.rotate_left(3 * width * (frame % height));
            for (y, x) in (0..4).flat_map(|y| (0..4).map(move |x| (y, x))) {
                bytes[3 * (y * width + x)..][..3].fill((240 / frames * frame) as u8);
            }
            write_png(folder.join(format!("{spp:05}.png")), width, height, &bytes).unwrap();
        }
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

/// A server in a thread of its own until it is dropped, or one that another process runs.
pub(crate) struct Running {
    pub(crate) address: SocketAddr,
    pub(crate) url: String,
    /// Path of the experimenter's page of a study, with its key.
    pub(crate) experimenter: String,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Takes the address of a server once it is bound, and says when it stops.
type Life = (mpsc::Sender<(SocketAddr, String)>, oneshot::Receiver<()>);

impl Running {
    pub(crate) fn start(study: Arc<Study>) -> Self {
        Self::exposed(study, Exposure::default())
    }

    pub(crate) fn exposed(study: Arc<Study>, exposure: Exposure) -> Self {
        Self::serving(study, exposure, StudyServer::admitting_simulated)
    }

    /// As the command serves it: for people.
    pub(crate) fn for_people(study: Arc<Study>) -> Self {
        Self::serving(study, Exposure::default(), |server| server)
    }

    fn serving(study: Arc<Study>, exposure: Exposure, set_up: fn(StudyServer) -> StudyServer) -> Self {
        Self::living(async move |(tell, stopped)| {
            let server = set_up(StudyServer::bind(study, LOCAL.into(), &exposure).await.unwrap());
            tell.send((server.address(), server.experimenter_path())).unwrap();
            server.run(async { drop(stopped.await) }).await.unwrap();
        })
    }

    pub(crate) fn explorer(setup: ExploreSetup) -> Self {
        Self::living(async move |(tell, stopped)| {
            let server = ExploreServer::bind(setup, LOCAL.into(), &Exposure::default()).await.unwrap();
            tell.send((server.address(), String::new())).unwrap();
            server.run(async { drop(stopped.await) }).await.unwrap();
        })
    }

    fn living(serve: impl AsyncFnOnce(Life) + Send + 'static) -> Self {
        let (stop, stopped) = oneshot::channel();
        let (tell, told) = mpsc::channel();
        let thread = std::thread::spawn(move || {
            let runtime =
                tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
            runtime.block_on(serve((tell, stopped)));
        });
        let (address, experimenter) = told.recv().unwrap();
        let url = format!("http://{address}");
        Self { address, url, experimenter, stop: Some(stop), thread: Some(thread) }
    }

    /// One that listens there.
    pub(crate) fn elsewhere(address: SocketAddr) -> Self {
        let (url, experimenter) = (format!("http://{address}"), String::new());
        Self { address, url, experimenter, stop: None, thread: None }
    }

    /// Sends bytes as they are; what comes until the server closes.
    pub(crate) fn exchange(&self, bytes: &[u8]) -> Vec<u8> {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(HANG)).unwrap();
        // The server may answer and close before it has read everything
        drop(stream.write_all(bytes));
        let mut said = Vec::new();
        drop(stream.read_to_end(&mut said));
        said
    }

    /// Sends a request with these headers; status, headers in lower case, body.
    pub(crate) fn raw(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> (u16, String, Vec<u8>) {
        let mut head = format!("{method} {path} HTTP/1.1\r\nconnection: close\r\n{headers}");
        if !headers.contains("host:") {
            head += &format!("host: {}\r\n", self.address);
        }
        if !headers.contains("content-length") {
            head += &format!("content-length: {}\r\n", body.len());
        }
        let bytes = self.exchange(&[head.as_bytes(), b"\r\n", body].concat());
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").unwrap_or(bytes.len());
        let head = String::from_utf8_lossy(&bytes[..end]).to_lowercase();
        let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0);
        (status, head, bytes.get(end + 4..).unwrap_or_default().to_vec())
    }

    /// Status and JSON of the answer to a request.
    pub(crate) fn ask(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> (u16, Value) {
        let (status, _, body) = self.raw(method, path, headers, body);
        (status, serde_json::from_slice(&body).unwrap_or(Value::Null))
    }

    pub(crate) fn get(&self, path: &str) -> Value {
        let (status, value) = self.ask("GET", path, "", b"");
        assert_eq!(status, 200, "{path}: {value}");
        value
    }

    pub(crate) fn post(&self, path: &str, body: &Value) -> (u16, Value) {
        self.ask("POST", path, JSON, body.to_string().as_bytes())
    }

    pub(crate) fn put(&self, path: &str, body: &Value) -> (u16, Value) {
        self.ask("PUT", path, JSON, body.to_string().as_bytes())
    }

    pub(crate) fn delete(&self, path: &str) -> (u16, Value) {
        self.ask("DELETE", path, "", b"")
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.stop.take());
        drop(self.thread.take().map(JoinHandle::join));
    }
}

/// A refusal says what, where and what to do, and names no path of the machine.
pub(crate) fn refused((status, said): (u16, Value), expected: u16) {
    assert_eq!(status, expected, "{said}");
    for part in ["what", "where", "what_to_do"] {
        assert!(said[part].as_str().is_some_and(|s| s.len() > 1), "{part}: {said}");
    }
    assert!(!said.to_string().contains("/tmp"), "paths of the machine: {said}");
}

/// Observers whose median stops seeing noise at these thresholds, the same in each stack.
pub(crate) fn public(stacks: usize, thresholds: &[f64]) -> Public {
    let thresholds = vec![thresholds.to_vec(); stacks];
    Public { between: 0.3, within: 0.1, lapse: 0.01, ..Public::of(thresholds) }
}
