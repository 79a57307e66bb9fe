//! A scene that is being read, and what all directives need.

use super::arguments::Arguments;
use super::camera::View;
use super::params::{Params, at};
use super::state::{Definition, Object, Part, State};
use super::tokens::{Kind, Tokens};
use crate::bounds::Bounds;
use crate::channels::Means;
use crate::error::{Errors, LoadError, Place, Warning};
use crate::files::{self, Folder, MAX_FILE_BYTES, has_memory};
use crate::loaded::{Loaded, title};
use crate::options::LoadOptions;
use flate2::read::GzDecoder;
use glam::DMat4;
use noisefloor_ptwne::{MaterialId, ObjectId, Pixels, SceneBuilder, SceneError};
use std::collections::{HashMap, HashSet};
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
const MAX_WARNINGS: usize = 10_000;
/// Most pixels of all pictures together.
const MAX_PIXELS: u64 = 1 << 27;

/// A scene that is being read.
pub(super) struct Reader<'a> {
    pub(super) path: PathBuf,
    pub(super) options: &'a LoadOptions,
    pub(super) folder: Folder,
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
    pub(super) balls: HashMap<MaterialId, ObjectId>,
    /// The object that is being defined.
    pub(super) open_object: Option<(String, Vec<Part>)>,
    pub(super) surrounded: bool,
    pub(super) max_depth: u32,
    pub(super) pixels: u64,
    /// Of materials in materials, and of all work.
    pub(super) bounds: Bounds,
    pub(super) means: Means,
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
    warnings: Vec<Warning>,
    said: HashSet<(Option<String>, String)>,
}

impl<'a> Reader<'a> {
    pub(super) fn new(path: &Path, options: &'a LoadOptions) -> Result<Self, LoadError> {
        let place = Place::file(path);
        let refused = |cause| LoadError::Scene { place: place.clone(), cause };
        Ok(Self {
            path: path.to_owned(),
            options,
            folder: Folder::of(path, options.root.as_deref(), options.identity()),
            state: State::new(place.clone()),
            view: View::default(),
            builder: SceneBuilder::new(title(path), View::anywhere()).map_err(refused)?,
            named_materials: HashMap::new(),
            materials: HashMap::new(),
            kept: vec![],
            objects: HashMap::new(),
            balls: HashMap::new(),
            open_object: None,
            surrounded: false,
            max_depth: BOUNCES + 1,
            pixels: 0,
            bounds: Bounds::default(),
            means: Means::default(),
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
            warnings: vec![],
            said: HashSet::new(),
        })
    }

    /// Executes the file in `path`, which may be gzipped.
    pub(super) fn file(&mut self, path: &Path, depth: u32) -> Result<(), LoadError> {
        let place = Place::file(path);
        place.clone().at_most("levels of included files", u64::from(depth), u64::from(MAX_DEPTH))?;
        self.files += 1;
        place.clone().at_most("files of directives", self.files, MAX_FILES)?;
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
        self.version_3 |= depth == 0 && has_world_end(&text);
        let mut tokens = Tokens::new(&text);
        loop {
            let open = |line: u32| at(path, line).bad("a quote does not end");
            let Some(token) = tokens.next().map_err(open)? else { return Ok(()) };
            let word = match token.kind {
                Kind::Word(word) if word.starts_with(|c: char| c.is_ascii_alphabetic()) => word,
                _ => return Err(at(path, token.line).bad("expected a directive such as Shape")),
            };
            self.directive(&word, &mut Arguments::new(&mut tokens, path, token.line, &word), depth)?;
        }
    }

    /// The bytes of a file, inflated if it is gzipped.
    pub(super) fn bytes_of(&self, path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
        let bytes = self.folder.read(path, limit.min(MAX_FILE_BYTES), place)?;
        if !bytes.starts_with(&[0x1f, 0x8b]) {
            return Ok(bytes);
        }
        // DEFLATE makes at most 1032 bytes of one; twice, since a buffer that grows is copied
        let most = limit.min(self.folder.left());
        has_memory(most.min(1032 * bytes.len() as u64), 2, place)?;
        let mut inflated = Vec::new();
        let read = GzDecoder::new(bytes.as_slice()).take(most + 1).read_to_end(&mut inflated);
        read.map_err(|e| Place::file(path).bad(format!("the file cannot be inflated: {e}")))?;
        let length = inflated.len() as u64;
        Place::file(path).at_most("bytes, inflated", length, limit)?;
        self.folder.inflate(length, &Place::file(path))?;
        Ok(inflated)
    }

    /// The error that the renderer does not take something.
    pub(super) fn refused(place: &Place) -> impl Fn(SceneError) -> LoadError + use<> {
        let place = place.clone();
        move |cause| LoadError::Scene { place: place.clone(), cause }
    }

    pub(super) fn ignored(&mut self, place: &Place, what: impl std::fmt::Display) {
        self.warn(Warning::ignored(place.clone(), what));
    }

    pub(super) fn approximated(&mut self, place: &Place, what: impl std::fmt::Display) {
        self.warn(Warning::approximated(place.clone(), what));
    }

    fn warn(&mut self, warning: Warning) {
        let key = (warning.place.part.clone(), warning.what.clone());
        if self.warnings.len() < MAX_WARNINGS && self.said.insert(key) {
            self.warnings.push(warning);
        }
    }

    /// Warns of parameters that nobody asked for.
    pub(super) fn say_unused(&mut self, params: &Params, called: &str) {
        let unused: Vec<String> = params.unused().map(|p| p.name.clone()).collect();
        for name in unused {
            self.ignored(&params.place, format!("`{name}` of {called} is ignored"));
        }
    }

    /// Counts pixels that are kept, and refuses more than [`MAX_PIXELS`].
    pub(super) fn count_pixels(&mut self, place: &Place, count: usize) -> Result<(), LoadError> {
        self.pixels = self.pixels.saturating_add(count as u64);
        place.clone().at_most("pixels in all pictures so far", self.pixels, MAX_PIXELS)
    }

    /// The scene, after the last directive.
    pub(super) fn finish(self) -> Result<Loaded, LoadError> {
        let Self { view, mut builder, errors, warnings, path, max_depth, in_world, folder, .. } = self;
        errors.finish()?;
        let whole = Place::file(&path);
        if !in_world {
            return Err(whole.bad("the scene has no WorldBegin: it is a part of another file"));
        }
        let refused = Self::refused(&whole);
        builder.optics(view.optics()).map_err(&refused)?;
        let scene = builder.build().map_err(&refused)?;
        let scene = scene.with_camera(view.to_camera()).map_err(&refused)?.with_identity(folder.contents());
        Ok(Loaded { scene, size: Some(view.size()), max_depth: Some(max_depth), clamp: view.clamp, warnings })
    }
}

/// Whether a file has the directive `WorldEnd`, which version 4 has not: a comment may have the word.
fn has_world_end(text: &str) -> bool {
    let mut tokens = Tokens::new(text);
    text.contains("WorldEnd")
        && std::iter::from_fn(|| tokens.next().ok().flatten())
            .any(|token| matches!(token.kind, Kind::Word(word) if word == "WorldEnd"))
}
