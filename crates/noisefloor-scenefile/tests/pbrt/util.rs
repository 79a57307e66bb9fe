use noisefloor::{ProgressiveSource, Request, Rgb, TileGrid};
use noisefloor_ptwne::{Ptwne, RenderOptions};
use noisefloor_scenefile::{LoadOptions, Loaded, load_with};
use std::path::Path;
use tempfile::TempDir;

/// A camera 5 units up the z axis that looks down it through a pinhole.
pub(crate) const CAMERA: &str = "LookAt 0 0 5  0 0 0  0 1 0 Camera \"perspective\" \"float fov\" 0.1\n";

/// A folder for a scene and its files. Scenes may have `'` for `"`.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn with(self, name: &str, bytes: impl AsRef<[u8]>) -> Self {
        let mut bytes = bytes.as_ref().to_vec();
        if name.ends_with(".pbrt") {
            bytes.iter_mut().filter(|byte| **byte == b'\'').for_each(|byte| *byte = b'"');
        }
        std::fs::write(self.path().join(name), bytes).unwrap();
        self
    }

    pub(crate) fn with_exr(self, name: &str, width: usize, pixels: &[Rgb]) -> Self {
        let layers = noisefloor_image::RenderLayers::rgb(width, pixels.len() / width, pixels);
        noisefloor_image::write_exr(self.path().join(name), &layers).unwrap();
        self
    }

    pub(crate) fn load_with(&self, text: &str, options: &LoadOptions) -> Result<Loaded, String> {
        let path = self.path().join("scene.pbrt");
        std::fs::write(&path, text.replace('\'', "\"")).unwrap();
        load_with(&path, options).map_err(|error| {
            let findings: Vec<String> = error.findings().iter().map(ToString::to_string).collect();
            findings.join("\n")
        })
    }

    /// Loads a scene with [`CAMERA`]; `world` starts on line 3.
    pub(crate) fn world(&self, world: &str) -> Result<Loaded, String> {
        self.load_with(&format!("{CAMERA}WorldBegin\n{world}"), &LoadOptions::default())
    }

    /// What [`CAMERA`] sees of a world.
    pub(crate) fn see(&self, world: &str) -> Rgb {
        look(self.world(world).unwrap_or_else(|e| panic!("{world}: {e}")), 1)[0]
    }
}

/// What the camera of a scene sees, in `side`×`side` pixels.
pub(crate) fn look(loaded: Loaded, side: usize) -> Vec<Rgb> {
    let options = RenderOptions { seed: 1, clamp: loaded.clamp, ..RenderOptions::default() };
    let mut source = Ptwne::new(loaded.scene, side, side, options).unwrap();
    let tile = TileGrid::new(side, side, 64).unwrap().tile(0);
    source.sample(&[Request::new(tile, 0, 4096)]).unwrap()[0].mean.clone()
}

/// Compares two colours to a relative tolerance.
#[track_caller]
pub(crate) fn close(got: Rgb, want: Rgb, tolerance: f32, what: &str) {
    let off = got.iter().zip(want).any(|(got, want)| (got - want).abs() > tolerance * want.abs().max(1e-3));
    assert!(!off, "{what}: {got:?}, want {want:?}");
}
