use noisefloor::{ProgressiveSource, Request, Rgb, TileGrid};
use noisefloor_ptwne::{Ptwne, RenderOptions};
use noisefloor_scenefile::{Loaded, load};
use std::error::Error;
use std::path::Path;
use tempfile::TempDir;

/// A camera 5 units up the z axis that looks down it.
pub(crate) const CAMERA: &str = concat!(
    r#"<sensor type="perspective"><float name="fov" value="0.1"/><transform name="to_world">"#,
    r#"<lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform></sensor>"#
);

/// A folder for a scene and its files.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn with(self, name: &str, bytes: impl AsRef<[u8]>) -> Self {
        std::fs::write(self.path().join(name), bytes).unwrap();
        self
    }

    pub(crate) fn with_png(self, name: &str, width: u32, pixels: &[[u8; 4]]) -> Self {
        let height = pixels.len() as u32 / width;
        let image = image::RgbaImage::from_raw(width, height, pixels.concat()).unwrap();
        image.save(self.path().join(name)).unwrap();
        self
    }

    pub(crate) fn with_exr(self, name: &str, width: usize, pixels: &[Rgb]) -> Self {
        let layers = noisefloor_image::RenderLayers::rgb(width, pixels.len() / width, pixels);
        noisefloor_image::write_exr(self.path().join(name), &layers).unwrap();
        self
    }

    /// Loads the scene file `text`; an error comes with its causes. Most of these scenes have no light: that
    /// warning has a test of its own.
    pub(crate) fn load(&self, text: &str) -> Result<Loaded, String> {
        let mut loaded = self.load_all(text)?;
        loaded.warnings.retain(|warning| !warning.what.contains("no light"));
        Ok(loaded)
    }

    /// The same with all warnings.
    pub(crate) fn load_all(&self, text: &str) -> Result<Loaded, String> {
        let path = self.path().join("scene.xml");
        std::fs::write(&path, text).unwrap();
        load(&path).map_err(|error| {
            let (mut message, mut cause) = (error.to_string(), error.source());
            while let Some(error) = cause {
                message += &format!(": {error}");
                cause = error.source();
            }
            message
        })
    }

    /// Loads a scene of version 3 with [`CAMERA`]; `body` starts on line 2.
    pub(crate) fn body(&self, body: &str) -> Result<Loaded, String> {
        self.load(&format!("<scene version=\"3.0.0\">{CAMERA}\n{body}</scene>"))
    }

    /// What [`CAMERA`] sees of a scene.
    pub(crate) fn see(&self, body: &str) -> Rgb {
        look(self.body(body).unwrap_or_else(|e| panic!("{body}: {e}")))
    }
}

/// What the camera of a scene sees, in the mean over a pixel.
pub(crate) fn look(loaded: Loaded) -> Rgb {
    let mut source =
        Ptwne::new(loaded.scene, 1, 1, RenderOptions { seed: 1, ..RenderOptions::default() }).unwrap();
    let tile = TileGrid::new(1, 1, 16).unwrap().tile(0);
    source.sample(&[Request::new(tile, 0, 4096)]).unwrap()[0].mean[0]
}

/// Compares two colours to a relative tolerance.
#[track_caller]
pub(crate) fn close(got: Rgb, want: Rgb, tolerance: f32, what: &str) {
    let off = got.iter().zip(want).any(|(got, want)| (got - want).abs() > tolerance * want.abs().max(1e-3));
    assert!(!off, "{what}: {got:?}, want {want:?}");
}
