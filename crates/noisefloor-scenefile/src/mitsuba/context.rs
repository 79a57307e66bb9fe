//! What the readers of all parts of a scene share.

use super::raster::Raster;
use super::surface::Surface;
use super::xml::{Document, Element};
use crate::error::{LoadError, Place, Warning};
use crate::files::Folder;
use noisefloor_ptwne::SceneError;
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::fmt;
use std::path::PathBuf;

/// Most warnings that are kept.
const MAX_WARNINGS: usize = 1000;
/// Most pixels that the pictures of a scene have together, where they are kept more than once counted as
/// often.
const MAX_PIXELS: u64 = 1 << 27;

/// A scene file that is being read.
#[derive(Debug)]
pub(super) struct Context<'d> {
    pub(super) document: &'d Document,
    /// Where the files are that it names.
    pub(super) folder: Folder,
    /// Pictures that have been read, by file and whether their codes are linear.
    pub(super) rasters: RefCell<HashMap<(PathBuf, bool), Raster>>,
    /// Surfaces that have been read, by the serial number of their element.
    pub(super) surfaces: RefCell<HashMap<usize, Surface>>,
    /// Serial numbers of the surfaces that are being read, one in another.
    pub(super) open: RefCell<Vec<usize>>,
    pixels: Cell<u64>,
    identified: HashMap<&'d str, &'d Element>,
    warnings: RefCell<Vec<Warning>>,
}

impl<'d> Context<'d> {
    pub(super) fn new(document: &'d Document) -> Result<Self, LoadError> {
        let context = Self {
            document,
            folder: Folder::of(&document.path),
            rasters: RefCell::default(),
            surfaces: RefCell::default(),
            open: RefCell::default(),
            pixels: Cell::new(0),
            identified: HashMap::new(),
            warnings: RefCell::default(),
        };
        let (mut found, mut identified) = (Vec::new(), HashMap::new());
        document.root.identified(&mut found);
        for (id, element) in found {
            if identified.insert(id, element).is_some() {
                return Err(context.bad(element, format!("the id `{id}` is taken already")));
            }
        }
        Ok(Self { identified, ..context })
    }

    /// Where `element` is.
    pub(super) fn place(&self, element: &Element) -> Place {
        self.document.place(element)
    }

    pub(super) fn bad(&self, element: &Element, what: impl fmt::Display) -> LoadError {
        self.place(element).bad(what)
    }

    pub(super) fn unsupported(&self, element: &Element, what: impl fmt::Display) -> LoadError {
        self.place(element).unsupported(what)
    }

    /// Says that the renderer does not take what `element` asks for.
    pub(super) fn refused(&self, element: &Element) -> impl Fn(SceneError) -> LoadError {
        let place = self.place(element);
        move |cause| LoadError::Scene { place: place.clone(), cause }
    }

    /// Warns, once.
    pub(super) fn warn(&self, element: &Element, what: impl fmt::Display) {
        let warning = Warning { place: self.place(element), what: what.to_string() };
        let mut warnings = self.warnings.borrow_mut();
        if warnings.len() <= MAX_WARNINGS && !warnings.contains(&warning) {
            if warnings.len() < MAX_WARNINGS {
                warnings.push(warning);
            } else {
                let what = "further warnings are left out".to_owned();
                warnings.push(Warning { place: Place::file(&self.document.path), what });
            }
        }
    }

    /// All warnings, in the order in which they came up.
    pub(super) fn into_warnings(self) -> Vec<Warning> {
        self.warnings.into_inner()
    }

    /// Counts pixels that are kept, and refuses more than [`MAX_PIXELS`].
    pub(super) fn count_pixels(&self, element: &Element, count: usize) -> Result<(), LoadError> {
        self.pixels.set(self.pixels.get().saturating_add(count as u64));
        self.place(element).at_most("pixels in all pictures so far", self.pixels.get(), MAX_PIXELS)
    }

    /// The element itself, or, if it is a `ref`, what it refers to.
    pub(super) fn resolve(&self, element: &'d Element) -> Result<&'d Element, LoadError> {
        if element.tag != "ref" {
            return Ok(element);
        }
        let id = element.attribute("id").ok_or_else(|| self.bad(element, "a <ref> needs an id"))?;
        let found = self.identified.get(id).copied();
        found.ok_or_else(|| self.bad(element, format!("nothing has the id `{id}`")))
    }

    /// What is in `object` with the tag `tag`, itself or by reference; it is now read.
    pub(super) fn parts(&self, object: &'d Element, tag: &str) -> Result<Vec<&'d Element>, LoadError> {
        let mut parts = Vec::new();
        for child in &object.children {
            let part = self.resolve(child)?;
            if part.tag == tag {
                child.read();
                part.read();
                parts.push(part);
            }
        }
        Ok(parts)
    }

    /// Warns of everything that nobody has read.
    pub(super) fn warn_of_unread(&self) {
        let mut unread = Vec::new();
        self.document.root.unread(&mut unread);
        for element in unread {
            // Definitions that nothing refers to change nothing
            if element.attribute("id").is_none() {
                self.warn(element, format!("{} is ignored", element.label()));
            }
        }
    }
}
