use noisefloor::{ProgressiveSource, Request, Rgb, Tile};
use noisefloor_ptwne::{Ptwne, RenderOptions};
use noisefloor_scenefile::{LoadOptions, Loaded, load_with};
use std::fmt::Display;
use std::io::Write;
use std::path::Path;
use tempfile::TempDir;

/// A camera 5 units up the z axis that looks down it, of Mitsuba and of pbrt.
pub(crate) const CAMERA: &str = concat!(
    r#"<sensor type="perspective"><float name="fov" value="0.1"/><transform name="to_world">"#,
    r#"<lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform></sensor>"#
);
pub(crate) const PINHOLE: &str = "LookAt 0 0 5  0 0 0  0 1 0 Camera \"perspective\" \"float fov\" 0.1\n";

/// A folder for a scene and its files. Those of pbrt may have `'` for `"`.
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

    /// Loads the scene of that name, which is `text`.
    fn load_as(&self, name: &str, text: &str, options: &LoadOptions) -> Result<Loaded, String> {
        let path = self.path().join(name);
        std::fs::write(&path, text).unwrap();
        load_with(&path, options).map_err(|error| error.to_string())
    }

    /// Loads Mitsuba's scene file `text`. Most of these scenes have no light: that warning has a test of its own.
    pub(crate) fn load(&self, text: &str) -> Result<Loaded, String> {
        let mut loaded = self.load_as("scene.xml", text, &LoadOptions::default())?;
        loaded.warnings.retain(|warning| !warning.what.contains("no light"));
        Ok(loaded)
    }

    /// Loads a scene of version 3 with [`CAMERA`]; `body` starts on line 2.
    pub(crate) fn body(&self, body: &str) -> Result<Loaded, String> {
        self.load(&format!("<scene version=\"3.0.0\">{CAMERA}\n{body}</scene>"))
    }

    /// Loads pbrt's scene file `text`.
    pub(crate) fn load_with(&self, text: &str, options: &LoadOptions) -> Result<Loaded, String> {
        self.load_as("scene.pbrt", &text.replace('\'', "\""), options)
    }

    /// Loads a scene with [`PINHOLE`]; `world` starts on line 3.
    pub(crate) fn world(&self, world: &str) -> Result<Loaded, String> {
        self.load_with(&format!("{PINHOLE}WorldBegin\n{world}"), &LoadOptions::default())
    }

    /// What the camera sees of a body of Mitsuba or a world of pbrt.
    pub(crate) fn see(&self, scene: &str) -> Rgb {
        let loaded = if scene.trim_start().starts_with('<') { self.body(scene) } else { self.world(scene) };
        seen(loaded.unwrap_or_else(|e| panic!("{scene}: {e}")))
    }
}

/// What the camera of a scene sees, in the mean over a pixel.
pub(crate) fn seen(loaded: Loaded) -> Rgb {
    look(loaded, 1)[0]
}

/// What the camera of a scene sees, in `side`×`side` pixels.
pub(crate) fn look(loaded: Loaded, side: usize) -> Vec<Rgb> {
    let options = RenderOptions { seed: 1, clamp: loaded.clamp, ..RenderOptions::default() };
    render(loaded, [side; 2], 4096, options)
}

/// Means of that many samples a pixel, row-major from the top left.
pub(crate) fn render(
    loaded: Loaded,
    [width, height]: [usize; 2],
    samples: u64,
    options: RenderOptions,
) -> Vec<Rgb> {
    let mut source = Ptwne::new(loaded.scene, width, height, options).unwrap();
    let tile = Tile { index: 0, x: 0, y: 0, width, height };
    source.sample(&[Request::new(tile, 0, samples)]).unwrap().remove(0).mean
}

/// Asserts that something is refused, and that the message says so.
#[track_caller]
pub(crate) fn fails<T>(result: Result<T, impl Display>, want: &str) {
    let error = result.err().unwrap_or_else(|| panic!("accepted, not: {want}")).to_string();
    assert!(error.contains(want), "{error}\nwant: {want}");
}

/// Asserts that one warning alone has all these parts.
#[track_caller]
pub(crate) fn assert_warns(loaded: &Loaded, parts: &[&str]) {
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let found = warnings.iter().filter(|w| parts.iter().all(|part| w.contains(part))).count();
    assert_eq!(found, 1, "warnings about {parts:?} in {warnings:#?}");
}

/// Compares two colours to a relative tolerance.
#[track_caller]
pub(crate) fn close(got: Rgb, want: Rgb, tolerance: f32, what: &str) {
    let off = got.iter().zip(want).any(|(got, want)| (got - want).abs() > tolerance * want.abs().max(1e-3));
    assert!(!off, "{what}: {got:?}, want {want:?}");
}

// Elements of Mitsuba's scenes.

/// White all around.
pub(crate) const SKY: &str = r#"<emitter type="constant"/>"#;

/// A parameter.
pub(crate) fn value(tag: &str, name: &str, value: impl Display) -> String {
    format!("<{tag} name=\"{name}\" value=\"{value}\"/>")
}

pub(crate) fn float(name: &str, number: f32) -> String {
    value("float", name, number)
}

pub(crate) fn rgb(name: &str, colour: impl Display) -> String {
    value("rgb", name, colour)
}

/// An object, and what is in it.
pub(crate) fn of(tag: &str, kind: &str, inside: &str) -> String {
    format!("<{tag} type=\"{kind}\">{inside}</{tag}>")
}

pub(crate) fn bsdf(kind: &str, inside: &str) -> String {
    of("bsdf", kind, inside)
}

/// A picture whose pixels are seen one by one.
pub(crate) fn nearest(name: &str, file: &str, raw: bool) -> String {
    format!(
        r#"<texture type="bitmap" name="{name}"><string name="filename" value="{file}"/>
            <string name="filter_type" value="nearest"/><boolean name="raw" value="{raw}"/></texture>"#
    )
}

pub(crate) fn to_world(steps: &str) -> String {
    format!("<transform name=\"to_world\">{steps}</transform>")
}

/// A shape moved by x and y.
pub(crate) fn shape_at(kind: &str, x: f32, y: f32, inside: &str) -> String {
    of("shape", kind, &(to_world(&format!("<translate x=\"{x}\" y=\"{y}\"/>")) + inside))
}

/// A PLY file in text: rows of vertices, whose position further properties of floats may follow, and one of faces.
pub(crate) fn ply(more: &str, vertices: &[&str], faces: &[&str]) -> String {
    let more: String = more.split_whitespace().map(|name| format!("property float {name}\n")).collect();
    let (points, count) = (vertices.len(), faces.len());
    format!(
        "ply\nformat ascii 1.0\nelement vertex {points}\nproperty float x\nproperty float y\nproperty float z\n{more}\
         element face {count}\nproperty list uchar int vertex_indices\nend_header\n{}\n{}\n",
        vertices.join("\n"),
        faces.join("\n")
    )
}

/// A mesh of Mitsuba's own format, of what is inside it.
pub(crate) fn serialized(version: u8, inside: &[u8]) -> Vec<u8> {
    let header = vec![0x1c, 0x04, version, 0];
    let mut encoder = flate2::write::ZlibEncoder::new(header, flate2::Compression::default());
    encoder.write_all(inside).unwrap();
    let mut bytes = encoder.finish().unwrap();
    bytes.extend(&[0; 8][..if version == 4 { 8 } else { 4 }]);
    bytes.extend(1u32.to_le_bytes());
    bytes
}
