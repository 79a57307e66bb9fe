//! A glTF file as it is: its JSON, and the bytes that it names.

use super::parts::{DRACO, INSTANCES, VISIBILITY, WEBP, name};
use super::{properties, uri};
use crate::load::Load;
use crate::{LoadError, Place};
use gltf::json::root::Get;
use gltf::json::{Buffer, Index, Root, Value, buffer, deserialize};
use std::cell::{Cell, OnceCell, RefCell};
use std::collections::BTreeSet;
use std::path::Path;

/// Most bytes that a scene may have in all its files.
pub(super) const MAX_BYTES: u64 = 1 << 32;
/// Most objects, arrays and commas of the JSON: a few bytes of text become an object of up to a kilobyte.
const MAX_VALUES: u64 = 1 << 22;

/// Extensions that a file may require. `KHR_mesh_quantization` is but a wider choice of accessors, all of which are
/// read; of `KHR_materials_variants` the material without a variant is shown, as its specification has it.
const KNOWN: &[&str] = &[
    DRACO,
    INSTANCES,
    VISIBILITY,
    WEBP,
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// A parsed file. Nothing that the JSON says is checked beyond the types of its fields.
#[derive(Debug)]
pub(super) struct Asset<'a> {
    pub(super) path: &'a Path,
    pub(super) load: &'a Load,
    pub(super) root: Root,
    /// Properties that nobody knows, each with what has it.
    pub(super) unread: Vec<(String, String)>,
    binary: Option<&'a [u8]>,
    /// Those that are not the binary chunk, filled when first asked for.
    buffers: Vec<OnceCell<Vec<u8>>>,
    bytes: Cell<u64>,
    /// Extensions that some warning names.
    left_out: RefCell<BTreeSet<String>>,
}

impl<'a> Asset<'a> {
    /// Parses `file`, the bytes of the scene: JSON or GLB.
    pub(super) fn parse(load: &'a Load, file: &'a [u8]) -> Result<Self, LoadError> {
        let path = load.path.as_path();
        let (json, binary) = if file.starts_with(b"glTF") { split_glb(path, file)? } else { (file, None) };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        let values = json.iter().filter(|b| matches!(b, b'{' | b'[' | b',')).count() as u64;
        Place::file(path).at_most("JSON values", values, MAX_VALUES)?;
        let parsed = || {
            let mut root: Value = deserialize::from_slice(json).map_err(|e| {
                Place::part(path, format_args!("line {} of the JSON", e.line()))
                    .bad(format_args!("not the JSON of a glTF file: {e}"))
            })?;
            properties::tidy(&mut root);
            Ok::<_, LoadError>(root)
        };
        let root = parsed()?;
        // Lists of later versions are objects in version 1, which its types would not take
        properties::check_version(path, &root)?;
        let unread = properties::unread(&root);
        let root: Root = match deserialize::from_value(root) {
            Ok(root) => root,
            Err(e) => {
                let place = match properties::culprit(&parsed()?) {
                    Some(part) => Place::part(path, part),
                    None => Place::file(path),
                };
                return Err(place.bad(format_args!("not the JSON of a glTF file: {e}")));
            }
        };
        let buffers = root.buffers.iter().map(|_| OnceCell::new()).collect();
        let bytes = Cell::new(file.len() as u64);
        Ok(Self { path, load, root, unread, binary, buffers, bytes, left_out: RefCell::default() })
    }

    /// The element of that index, named by `place`; `kind` is what to call it.
    pub(super) fn get<T>(&self, index: Index<T>, kind: &str, place: &Place) -> Result<&T, LoadError>
    where
        Root: Get<T>,
    {
        let missing = || place.bad(format_args!("{kind} {} does not exist", index.value()));
        self.root.get(index).ok_or_else(missing)
    }

    /// Bytes in all the files read so far: what is allocated stays in proportion to them.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes.get()
    }

    /// The bytes of a buffer view that `place` names.
    pub(super) fn view(&self, index: Index<buffer::View>, place: &Place) -> Result<&[u8], LoadError> {
        let view = self.get(index, "buffer view", place)?;
        let bytes = self.buffer(view.buffer, place)?;
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.checked_add(view.byte_length.0);
        let range = usize::try_from(start).ok().zip(end.and_then(|end| usize::try_from(end).ok()));
        range.and_then(|(start, end)| bytes.get(start..end)).ok_or_else(|| {
            Place::part(self.path, format_args!("buffer view {}", index.value())).bad(format_args!(
                "{} bytes from byte {start} reach past the end of buffer {}, which has {}",
                view.byte_length.0,
                view.buffer.value(),
                bytes.len()
            ))
        })
    }

    /// The bytes that `uri` names. They count towards [`MAX_BYTES`].
    pub(super) fn resolve(&self, uri: &str, place: &Place) -> Result<Vec<u8>, LoadError> {
        let bytes = uri::read(uri, &self.load.folder, place, MAX_BYTES.saturating_sub(self.bytes()))?;
        self.bytes.set(self.bytes() + bytes.len() as u64);
        Ok(bytes)
    }

    /// Adds bytes that the file stands for as a buffer of its own, and returns the view of all of them.
    pub(super) fn add_view(&mut self, bytes: Vec<u8>) -> Index<buffer::View> {
        let byte_length = (bytes.len() as u64).into();
        // Any name will do: it is there already
        let uri = Some(String::new());
        let extras = Default::default;
        let whole = Buffer { byte_length, name: None, uri, extensions: None, extras: extras() };
        self.buffers.push(OnceCell::from(bytes));
        let view = buffer::View {
            buffer: Index::push(&mut self.root.buffers, whole),
            byte_length,
            byte_offset: None,
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: extras(),
        };
        Index::push(&mut self.root.buffer_views, view)
    }

    fn buffer(&self, index: Index<Buffer>, place: &Place) -> Result<&[u8], LoadError> {
        let buffer = self.get(index, "buffer", place)?;
        let place = || Place::part(self.path, name("buffer", index.value(), buffer.name.as_deref()));
        let bytes = match (&buffer.uri, self.buffers[index.value()].get(), self.binary) {
            (Some(_), Some(bytes), _) => bytes,
            (Some(uri), None, _) => {
                let bytes = self.resolve(uri, &place())?;
                self.buffers[index.value()].get_or_init(|| bytes)
            }
            (None, _, Some(binary)) if index.value() == 0 => binary,
            (None, ..) => {
                return Err(place().bad("it has neither a `uri` nor the binary chunk of a GLB file"));
            }
        };
        // What is past byteLength is padding
        let length = buffer.byte_length.0;
        usize::try_from(length).ok().and_then(|length| bytes.get(..length)).ok_or_else(|| {
            place().bad(format_args!("its byteLength is {length}, but it has {} bytes", bytes.len()))
        })
    }
}

// What a load does without.

impl Asset<'_> {
    /// An element has these extensions, which are ignored.
    pub(super) fn leave_out<'n>(&self, place: &Place, names: impl IntoIterator<Item = &'n String>) {
        for name in names {
            self.load.ignored(place, format_args!("the extension {name} is ignored"));
            self.left_out.borrow_mut().insert(name.clone());
        }
    }

    /// Warns of properties that nobody knows, and of the extensions that the file uses but no element that was read.
    pub(super) fn say_unread(&self) {
        for (place, property) in &self.unread {
            let place = Place::part(self.path, place);
            self.load.ignored(&place, format_args!("the property `{property}` is ignored"));
        }
        let place = Place::part(self.path, "extensionsUsed");
        let mentioned = self.left_out.take();
        let used = self.root.extensions_used.iter().filter(|name| !mentioned.contains(*name));
        self.leave_out(&place, used.filter(|name| !KNOWN.contains(&name.as_str())));
    }

    /// Checks that the file requires no extension that would be missed.
    pub(super) fn check_required(&self) -> Result<(), LoadError> {
        let required = self.root.extensions_required.iter();
        let missing: Vec<&str> = required.map(String::as_str).filter(|name| !KNOWN.contains(name)).collect();
        let each = match missing.len() {
            0 => return Ok(()),
            1 => "the extension",
            _ => "each of the extensions",
        };
        let what = format_args!("{each} {}, which the file requires,", missing.join(", "));
        Err(Place::part(self.path, "extensionsRequired").unsupported(what))
    }
}

/// The JSON and the binary chunk of a GLB file (glTF 2.0, §4.4).
fn split_glb<'a>(path: &Path, file: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), LoadError> {
    let place = Place::part(path, "GLB header");
    let Some((header, _)) = file.split_first_chunk::<12>() else {
        return Err(place.bad(format_args!("a GLB file has at least 12 bytes, this one has {}", file.len())));
    };
    let [_, version, length] = words(header);
    if version != 2 {
        return Err(place.unsupported(format_args!("version {version} of GLB")));
    }
    let mut chunks = file.get(12..length as usize).ok_or_else(|| {
        let found = file.len();
        place.bad(format_args!(
            "it says that the file has {length} bytes, but it has {found}; it may be cut short"
        ))
    })?;
    let (kind, json) = next_chunk(path, &mut chunks)?;
    if kind != *b"JSON" {
        return Err(place.bad("the first chunk is not JSON"));
    }
    // It is to be padded with spaces, but some programs write zeros
    let json = &json[..json.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1)];
    if chunks.is_empty() {
        return Ok((json, None));
    }
    let (kind, binary) = next_chunk(path, &mut chunks)?;
    // Chunks of unknown kinds are to be ignored
    Ok((json, (kind == *b"BIN\0").then_some(binary)))
}

/// Takes the first chunk of a GLB file off `bytes`: its kind and its contents.
fn next_chunk<'a>(path: &Path, bytes: &mut &'a [u8]) -> Result<([u8; 4], &'a [u8]), LoadError> {
    let place = Place::part(path, "GLB chunk");
    let Some((header, rest)) = bytes.split_first_chunk::<8>() else {
        return Err(place.bad(format_args!("its header has 8 bytes, but only {} follow", bytes.len())));
    };
    let [length, kind] = words(header);
    let Some((contents, rest)) = rest.split_at_checked(length as usize) else {
        return Err(
            place.bad(format_args!("it says that it has {length} bytes, but only {} follow", rest.len()))
        );
    };
    *bytes = rest;
    Ok((kind.to_le_bytes(), contents))
}

/// Little-endian words.
fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
    std::array::from_fn(|i| u32::from_le_bytes(std::array::from_fn(|j| bytes[4 * i + j])))
}
