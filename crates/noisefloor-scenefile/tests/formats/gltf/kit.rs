//! Makes glTF files, and renders them.

use base64::prelude::{BASE64_STANDARD, Engine};
use gltf::json::{Value, deserialize, serialize};
use noisefloor::Rgb;
use noisefloor_ptwne::RenderOptions;
use noisefloor_scenefile::{LoadError, Loaded};
use std::fmt::Write;
use std::io::Cursor;

pub(crate) fn json(text: &str) -> Value {
    deserialize::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

/// A glTF file in the making: its JSON, and one buffer.
#[derive(Clone)]
pub(crate) struct Maker {
    pub(crate) root: Value,
    pub(crate) bytes: Vec<u8>,
}

impl Maker {
    /// A scene seen from the origin along −z through a field of view of 90°: 8×8 pixels at z = −1 are 0.25
    /// wide.
    pub(crate) fn new() -> Self {
        let mut maker = Self::empty();
        maker.push("cameras", r#"{"type": "perspective", "perspective": {"yfov": 1.5707963, "znear": 0.1}}"#);
        maker.node(r#"{"camera": 0}"#);
        maker
    }

    /// The same with a rectangle that fills the picture, at z = −1.
    pub(crate) fn wall(material: &str) -> Self {
        let mut maker = Self::new();
        maker.show([-1.0, 1.0], [-1.0, 1.0], -1.0, material);
        maker
    }

    /// A scene of nothing.
    pub(crate) fn empty() -> Self {
        let root = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}"#;
        Self { root: json(root), bytes: vec![] }
    }

    /// Adds an element to an array of the root, and returns its index.
    pub(crate) fn push(&mut self, array: &str, element: &str) -> usize {
        let elements = &mut self.root[array];
        if elements.is_null() {
            *elements = json("[]");
        }
        let elements = elements.as_array_mut().unwrap();
        elements.push(json(element));
        elements.len() - 1
    }

    /// Adds a node to the scene.
    pub(crate) fn node(&mut self, node: &str) -> usize {
        let index = self.push("nodes", node);
        self.root["scenes"][0]["nodes"].as_array_mut().unwrap().push(index.into());
        index
    }

    /// Adds bytes to the buffer as a view.
    pub(crate) fn view(&mut self, bytes: &[u8], more: &str) -> usize {
        let (start, length) = (self.bytes.len(), bytes.len());
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = format!(r#"{{"buffer": 0, "byteOffset": {start}, "byteLength": {length}{more}}}"#);
        self.push("bufferViews", &view)
    }

    /// Adds an accessor of the elements in `bytes`.
    pub(crate) fn accessor(
        &mut self,
        kind: u32,
        shape: &str,
        count: usize,
        bytes: &[u8],
        more: &str,
    ) -> usize {
        let view = self.view(bytes, "");
        let accessor = format!(
            r#"{{"bufferView": {view}, "componentType": {kind}, "type": "{shape}", "count": {count}{more}}}"#
        );
        self.push("accessors", &accessor)
    }

    pub(crate) fn floats<const N: usize>(&mut self, elements: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = elements.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let shape = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        self.accessor(5126, shape, elements.len(), &bytes, "")
    }

    /// Gives the first mesh an attribute of these elements.
    pub(crate) fn attribute<const N: usize>(&mut self, name: &str, elements: &[[f32; N]]) {
        let accessor = self.floats(elements);
        self.root["meshes"][0]["primitives"][0]["attributes"][name] = accessor.into();
    }

    pub(crate) fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        self.accessor(5123, "SCALAR", indices.len(), &bytes, "")
    }

    /// Adds a mesh of the rectangle `[x0, x1]`×`[y0, y1]` at z that faces +z, with texture coordinates (0, 0)
    /// at its top left and (1, 1) at its bottom right.
    pub(crate) fn rectangle(&mut self, x: [f32; 2], y: [f32; 2], z: f32, material: &str) -> usize {
        let material = self.push("materials", material);
        let positions = self.floats(&[[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]]);
        let uvs = self.floats(&[[0.0f32, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        let indices = self.indices(&[0, 1, 2, 0, 2, 3]);
        self.push(
            "meshes",
            &format!(
                r#"{{"primitives": [{{"attributes": {{"POSITION": {positions}, "TEXCOORD_0": {uvs}}},
                    "indices": {indices}, "material": {material}}}]}}"#
            ),
        )
    }

    /// Adds such a rectangle, and a node that shows it.
    pub(crate) fn show(&mut self, x: [f32; 2], y: [f32; 2], z: f32, material: &str) -> usize {
        let mesh = self.rectangle(x, y, z, material);
        self.node(&format!(r#"{{"mesh": {mesh}}}"#));
        mesh
    }

    /// Adds a cube around the scene that shines with a radiance of 1, and reflects nothing.
    pub(crate) fn surroundings(&mut self) {
        let material =
            self.push("materials", r#"{"doubleSided": true, "extensions": {"KHR_materials_unlit": {}}}"#);
        let corners: [[f32; 3]; 8] =
            std::array::from_fn(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 50.0 } else { -50.0 }));
        let positions = self.floats(&corners);
        let sides = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let indices: Vec<u16> = sides.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]).collect();
        let indices = self.indices(&indices);
        let mesh = format!(
            r#"{{"primitives": [{{"attributes": {{"POSITION": {positions}}},
                "indices": {indices}, "material": {material}}}]}}"#
        );
        let mesh = self.push("meshes", &mesh);
        self.node(&format!(r#"{{"mesh": {mesh}}}"#));
    }

    /// Adds a texture of an image of `width` pixels a row.
    pub(crate) fn texture(&mut self, width: u32, pixels: &[[u8; 4]], sampler: &str) -> usize {
        let height = pixels.len() as u32 / width;
        let image = image::RgbaImage::from_raw(width, height, pixels.concat()).unwrap();
        let mut png = Cursor::new(vec![]);
        image.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let source = self.push(
            "images",
            &format!(r#"{{"uri": "data:image/png;base64,{}"}}"#, BASE64_STANDARD.encode(png.get_ref())),
        );
        let sampler = self.push("samplers", sampler);
        self.push("textures", &format!(r#"{{"source": {source}, "sampler": {sampler}}}"#))
    }

    /// The file as JSON with its buffer in a data URI.
    pub(crate) fn gltf(&self) -> Vec<u8> {
        let uri = format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&self.bytes));
        serialize::to_vec(&self.with_buffer(Some(&uri))).unwrap()
    }

    /// The file as GLB.
    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut text = serialize::to_vec(&self.with_buffer(None)).unwrap();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut file = b"glTF".to_vec();
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        for word in [2, length as u32, text.len() as u32] {
            file.extend(word.to_le_bytes());
        }
        file.extend(b"JSON");
        file.extend(text);
        file.extend((self.bytes.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(&self.bytes);
        file
    }

    /// The JSON with a buffer of the right length, unless a test has set one.
    fn with_buffer(&self, uri: Option<&str>) -> Value {
        let mut root = self.root.clone();
        if root["buffers"].is_null() {
            let mut buffer = json("{}");
            buffer["byteLength"] = self.bytes.len().into();
            if let Some(uri) = uri {
                buffer["uri"] = uri.into();
            }
            root["buffers"] = Value::Array(vec![buffer]);
        }
        root
    }

    pub(crate) fn load(&self) -> Result<Loaded, LoadError> {
        load("scene.gltf", &self.gltf())
    }
}

/// Loads a file of that name with those contents.
pub(crate) fn load(name: &str, contents: &[u8]) -> Result<Loaded, LoadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, contents).unwrap();
    noisefloor_scenefile::load(&path)
}

/// Means of `samples` samples a pixel of paths of up to `max_depth` segments, row-major from the top left.
pub(crate) fn render(loaded: Loaded, size: usize, samples: u64, max_depth: u32) -> Vec<Rgb> {
    crate::util::render(
        loaded,
        [size; 2],
        samples,
        RenderOptions { max_depth, seed: 5, ..RenderOptions::default() },
    )
}

/// What is seen directly of the red channel, as a drawing: `#` above ½, `.` below.
pub(crate) fn drawing(loaded: Loaded, size: usize) -> String {
    let mut drawing = String::new();
    for row in render(loaded, size, 4, 1).chunks(size) {
        for pixel in row {
            drawing.push(if pixel[0] > 0.5 { '#' } else { '.' });
        }
        writeln!(drawing).unwrap();
    }
    drawing
}
