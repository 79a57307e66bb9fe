//! A scene that is being read, and what all directives need.

use super::arguments::Arguments;
use super::camera::View;
use super::params::Params;
use super::state::{Definition, Object, Part, State};
use super::tokens::{Kind, Tokens};
use crate::error::{Errors, LoadError, Place};
use crate::files::{self, MAX_FILE_BYTES, has_memory};
use crate::load::Load;
use crate::loaded::{Loaded, anywhere, title};
use crate::mesh::solids::Balls;
use crate::options::LoadOptions;
use flate2::read::GzDecoder;
use glam::DMat4;
use noisefloor_ptwne::{MaterialId, Pixels, SceneBuilder};
use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// How deep files may include each other, and transforms nest.
pub(super) const MAX_DEPTH: u32 = 64;
/// Longest path of the integrators, in bounces.
pub(super) const BOUNCES: u32 = 5;
/// Most bytes of all files of directives, and most files, where those that are included more than once count as
/// often: a sponge of instances (shadeops/pbrt-v4-menger) has 160,000 files of 3.5 kB. Empty ones count no bytes, and
/// files that include others twice would have 2⁶⁴.
const MAX_BYTES: u64 = 1 << 30;
const MAX_FILES: u64 = 1 << 18;
/// Longest file of directives that is kept, in bytes: what is included often is short.
const KEPT: usize = 1 << 16;

/// A scene that is being read.
pub(super) struct Reader<'a> {
    pub(super) load: Load,
    pub(super) options: &'a LoadOptions,
    pub(super) state: State,
    pub(super) view: View,
    /// Collected parts of the scene. Its camera is set at the end.
    pub(super) builder: SceneBuilder,
    pub(super) named_materials: HashMap<String, Rc<Definition>>,
    pub(super) materials: HashMap<(usize, Option<String>), MaterialId>,
    /// Definitions whose addresses are keys of `materials`.
    pub(super) kept: Vec<Rc<Definition>>,
    pub(super) objects: HashMap<String, Object>,
    /// Spheres that ellipsoids of a material share.
    pub(super) balls: Balls,
    /// The object that is being defined.
    pub(super) open_object: Option<(String, Vec<Part>)>,
    pub(super) surrounded: bool,
    pub(super) max_depth: u32,
    /// Pixels with a factor above 1, by address and factor, and what they are where 1 is the most. The former stay here,
    /// so that no other ones get their address.
    pub(super) bounded: HashMap<(usize, [u32; 3]), (Pixels, Pixels)>,
    pub(super) stack: Vec<State>,
    pub(super) transforms: Vec<DMat4>,
    pub(super) coordinate_systems: HashMap<String, DMat4>,
    pub(super) in_world: bool,
    /// Whether the file is of version 3: version 4 has no `WorldEnd`.
    pub(super) version_3: bool,
    bytes: u64,
    files: u64,
    /// Short files of directives, by their paths.
    texts: HashMap<PathBuf, Rc<str>>,
    pub(super) errors: Errors,
}

impl<'a> Reader<'a> {
    pub(super) fn new(path: &Path, options: &'a LoadOptions) -> Result<Self, LoadError> {
        let place = Place::file(path);
        Ok(Self {
            load: Load::new(path, options.root.as_deref(), options.identity()),
            options,
            state: State::new(place.clone()),
            view: View::default(),
            builder: SceneBuilder::new(title(path), anywhere()).map_err(place.refused())?,
            named_materials: HashMap::new(),
            materials: HashMap::new(),
            kept: vec![],
            objects: HashMap::new(),
            balls: Balls::default(),
            open_object: None,
            surrounded: false,
            max_depth: BOUNCES + 1,
            bounded: HashMap::new(),
            stack: vec![],
            transforms: vec![],
            coordinate_systems: HashMap::new(),
            in_world: false,
            version_3: false,
            bytes: 0,
            files: 0,
            texts: HashMap::new(),
            errors: Errors::default(),
        })
    }

    /// Executes the file in `path`, which may be gzipped.
    pub(super) fn file(&mut self, path: &Path, depth: u32) -> Result<(), LoadError> {
        let place = Place::file(path);
        place.at_most("levels of included files", u64::from(depth), u64::from(MAX_DEPTH))?;
        self.files += 1;
        place.at_most("files of directives", self.files, MAX_FILES)?;
        let text = match self.texts.get(path) {
            Some(text) => text.clone(),
            None => {
                let bytes = self.bytes_of(path, MAX_FILE_BYTES, &place)?;
                let text: Rc<str> = files::text(&bytes).into();
                if text.len() <= KEPT {
                    self.texts.insert(path.to_owned(), text.clone());
                }
                text
            }
        };
        self.bytes += text.len() as u64;
        let what = "bytes of directives so far (a file that is included again counts again)";
        place.at_most(what, self.bytes, MAX_BYTES)?;
        self.version_3 |= depth == 0 && has_world_end(path, &text);
        let mut tokens = Tokens::new(path, &text);
        loop {
            let Some(token) = tokens.next()? else { return Ok(()) };
            let word = match token.kind {
                Kind::Word(word) if word.starts_with(|c: char| c.is_ascii_alphabetic()) => word,
                _ => return Err(tokens.place(token.line).bad("expected a directive such as Shape")),
            };
            self.directive(&word, &mut Arguments::new(&mut tokens, token.line, &word), depth)?;
        }
    }

    /// The bytes of a file, inflated if it is gzipped.
    pub(super) fn bytes_of(&self, path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
        let bytes = self.load.folder.read(path, limit.min(MAX_FILE_BYTES), place)?;
        if !bytes.starts_with(&[0x1f, 0x8b]) {
            return Ok(bytes);
        }
        // DEFLATE makes at most 1032 bytes of one; twice, since a buffer that grows is copied
        let most = limit.min(self.load.folder.left());
        has_memory(most.min(1032 * bytes.len() as u64), 2, place)?;
        let mut inflated = Vec::new();
        let read = GzDecoder::new(bytes.as_slice()).take(most + 1).read_to_end(&mut inflated);
        read.map_err(|e| Place::file(path).bad(format!("the file cannot be inflated: {e}")))?;
        let length = inflated.len() as u64;
        Place::file(path).at_most("bytes, inflated", length, limit)?;
        self.load.folder.inflate(length, &Place::file(path))?;
        Ok(inflated)
    }

    /// Warns of parameters that nobody asked for.
    pub(super) fn say_unused(&self, params: &Params, called: &str) {
        for param in params.unused() {
            self.load.ignored(&params.place, format!("`{}` of {called} is ignored", param.name));
        }
    }

    /// The scene, after the last directive.
    pub(super) fn finish(self) -> Result<Loaded, LoadError> {
        let Self { view, mut builder, errors, load, max_depth, in_world, .. } = self;
        errors.finish()?;
        let whole = Place::file(&load.path);
        if !in_world {
            return Err(whole.bad("the scene has no WorldBegin: it is a part of another file"));
        }
        let refused = whole.refused();
        builder.optics(view.optics()).map_err(&refused)?;
        let scene = builder.build().map_err(&refused)?;
        let scene =
            scene.with_camera(view.to_camera()).map_err(&refused)?.with_identity(load.folder.contents());
        Ok(Loaded {
            scene,
            size: Some(view.size()),
            max_depth: Some(max_depth),
            clamp: view.clamp,
            warnings: load.into_warnings(),
        })
    }
}

/// Whether a file has the directive `WorldEnd`, which version 4 has not: a comment may have the word.
fn has_world_end(path: &Path, text: &str) -> bool {
    let mut tokens = Tokens::new(path, text);
    text.contains("WorldEnd")
        && std::iter::from_fn(|| tokens.next().ok().flatten())
            .any(|token| matches!(token.kind, Kind::Word(word) if word == "WorldEnd"))
}
