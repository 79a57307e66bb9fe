//! What the readers of all parts of a scene share.

use super::attributes::Attribute;
use super::document::{Document, unset};
use super::raster::Raster;
use super::surface::Surface;
use super::xml::Element;
use crate::bounds::Bounds;
use crate::channels::Means;
use crate::error::{LoadError, Place, Warning};
use crate::options::LoadOptions;
use crate::options::NO_MEDIA;
use noisefloor_ptwne::{Facets, Material, SceneError, Texture};
use std::cell::{Cell, RefCell};
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::PathBuf;

/// Most warnings that are kept.
const MAX_WARNINGS: usize = 10_000;
/// Kinds of elements that Mitsuba 3.9 has and this reader has not.
const MITSUBAS_OWN: [(&str, &str); 17] = [
    ("bsdf", "circular"),
    ("bsdf", "hair"),
    ("bsdf", "measured"),
    ("bsdf", "measured_polarized"),
    ("bsdf", "polarizer"),
    ("bsdf", "retarder"),
    ("emitter", "directionalarea"),
    ("sensor", "batch"),
    ("sensor", "distant"),
    ("sensor", "irradiancemeter"),
    ("sensor", "radiancemeter"),
    ("shape", "bsplinecurve"),
    ("shape", "ellipsoids"),
    ("shape", "ellipsoidsmesh"),
    ("shape", "linearcurve"),
    ("shape", "sdfgrid"),
    ("texture", "volume"),
];
/// Most aliases in a row.
const MAX_ALIASES: usize = 16;
/// Most pixels that the pictures of a scene have together, where they are kept more than once counted as
/// often.
const MAX_PIXELS: u64 = 1 << 27;

/// A scene file that is being read.
#[derive(Debug)]
pub(super) struct Context<'d> {
    pub(super) document: &'d Document,
    pub(super) options: &'d LoadOptions,
    /// Pictures that have been read, by file and whether their codes are linear.
    pub(super) rasters: RefCell<HashMap<(PathBuf, bool), Raster>>,
    /// Surfaces that have been read, by the serial number of their element.
    pub(super) surfaces: RefCell<HashMap<usize, Surface>>,
    /// Textures that have been read, by the serial number of their element and whether they are light.
    pub(super) textures: RefCell<HashMap<(usize, bool), (f32, Texture)>>,
    /// The attributes of meshes that surfaces use, by the serial number of their element.
    pub(super) attributes: RefCell<HashMap<usize, Option<Attribute>>>,
    pub(super) means: Means,
    /// Of surfaces, textures and shapes, one in another.
    bounds: Bounds,
    pixels: Cell<u64>,
    identified: HashMap<&'d str, &'d Element>,
    aliases: HashMap<&'d str, &'d str>,
    warnings: RefCell<Vec<Warning>>,
    /// Warnings that there are already.
    said: RefCell<HashSet<(usize, String)>>,
}

impl<'d> Context<'d> {
    pub(super) fn new(document: &'d Document, options: &'d LoadOptions) -> Result<Self, LoadError> {
        let context = Self {
            document,
            options,
            rasters: RefCell::default(),
            surfaces: RefCell::default(),
            textures: RefCell::default(),
            attributes: RefCell::default(),
            means: Means::default(),
            bounds: Bounds::default(),
            pixels: Cell::new(0),
            identified: HashMap::new(),
            aliases: HashMap::new(),
            warnings: RefCell::default(),
            said: RefCell::default(),
        };
        let (mut found, mut identified) = (Vec::new(), HashMap::new());
        document.root.identified(&mut found);
        for (id, element) in found {
            if identified.insert(id, element).is_some() {
                return Err(context.bad(element, format!("the id `{id}` is taken already")));
            }
        }
        let aliases =
            document.root.all("alias").filter_map(|a| Some((a.attribute("as")?, a.attribute("id")?)));
        let aliases = aliases.collect();
        Ok(Self { identified, aliases, ..context })
    }

    /// Where `element` is.
    pub(super) fn place(&self, element: &Element) -> Place {
        self.document.place(element)
    }

    /// Something is wrong with `element`: above all, if a parameter in it has no value.
    pub(super) fn bad(&self, element: &Element, what: impl fmt::Display) -> LoadError {
        match &element.unset {
            Some(name) => self.place(element).bad(unset(name)),
            None => self.place(element).bad(what),
        }
    }

    pub(super) fn unsupported(&self, element: &Element, what: impl fmt::Display) -> LoadError {
        match &element.unset {
            Some(name) => self.place(element).bad(unset(name)),
            None => self.place(element).unsupported(what),
        }
    }

    /// The kind of `element` is not read here: whether Mitsuba has it, which is one word away.
    pub(super) fn unsupported_kind(&self, element: &Element) -> LoadError {
        let own = MITSUBAS_OWN.contains(&(element.tag.as_str(), element.kind()));
        let note = if own { " (`--source mitsuba` has it)" } else { "" };
        self.unsupported(element, element.species() + note)
    }

    /// The error that the renderer does not take what `element` asks for.
    pub(super) fn refused(&self, element: &Element) -> impl Fn(SceneError) -> LoadError {
        let place = self.place(element);
        move |cause| LoadError::Scene { place: place.clone(), cause }
    }

    /// Warns, once, that something is left out.
    pub(super) fn ignored(&self, element: &Element, what: impl fmt::Display) {
        self.warn(element, Warning::ignored(self.place(element), what));
    }

    /// Warns, once, that something is replaced by something that looks much the same.
    pub(super) fn approximated(&self, element: &Element, what: impl fmt::Display) {
        self.warn(element, Warning::approximated(self.place(element), what));
    }

    fn warn(&self, element: &Element, warning: Warning) {
        let mut warnings = self.warnings.borrow_mut();
        if warnings.len() > MAX_WARNINGS
            || !self.said.borrow_mut().insert((element.serial, warning.what.clone()))
        {
            return;
        }
        if warnings.len() < MAX_WARNINGS {
            warnings.push(warning);
        } else {
            let place = Place::file(self.document.path());
            warnings.push(Warning::ignored(place, "further warnings are left out"));
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
        let mut name = id;
        for _ in 0..MAX_ALIASES {
            name = self.aliases.get(name).copied().unwrap_or(name);
        }
        let found = self.identified.get(name).copied();
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

    /// Runs `read` for `element`, which may hold others of its kind.
    ///
    /// # Errors
    /// [`LoadError`] if the element holds itself, or if elements nest too deeply by reference.
    pub(super) fn nested_in<T>(
        &self,
        element: &'d Element,
        read: impl FnOnce() -> Result<T, LoadError>,
    ) -> Result<T, LoadError> {
        self.bounds.begin(element.serial, element.label(), &self.place(element))?;
        let result = read();
        self.bounds.end();
        result
    }

    /// Counts the tables of a material under a coat.
    pub(super) fn coat(
        &self,
        element: &Element,
        material: &Material,
        facets: (bool, Facets),
    ) -> Result<(), LoadError> {
        self.bounds.coat(material, facets, &self.place(element))
    }

    /// Counts work that is done for `element`.
    pub(super) fn spend(&self, element: &Element, work: usize) -> Result<(), LoadError> {
        self.bounds.spend(work, &self.place(element))
    }

    /// Refuses the participating media in `object`, or warns that they are left out.
    pub(super) fn no_media(&self, object: &'d Element) -> Result<(), LoadError> {
        for child in &object.children {
            // What is referred to, if it exists: other readers say if it does not
            let medium = if child.tag == "ref" { self.resolve(child).ok() } else { Some(child) };
            if medium.is_none_or(|medium| medium.tag != "medium") {
                continue;
            }
            child.read();
            if !self.options.ignore_volumes {
                let what = NO_MEDIA.replace(')', ", `--source mitsuba` renders them)");
                return Err(self.unsupported(child, what));
            }
            medium.into_iter().for_each(Element::irrelevant);
            self.ignored(child, "the participating medium is ignored");
        }
        Ok(())
    }

    /// Warns of everything that nobody has read.
    ///
    /// # Errors
    /// [`LoadError::Bad`] if something was read that has a parameter without a value.
    pub(super) fn finish(&self) -> Result<(), LoadError> {
        if let Some(element) = self.document.root.read_unset() {
            return Err(self.bad(element, "a parameter has no value"));
        }
        self.document.root.visit(&mut |element, read| {
            if read {
                for name in element.unread_attributes() {
                    self.ignored(element, format!("the attribute `{name}` of <{}> is ignored", element.tag));
                }
            } else if element.attribute("id").is_none() {
                // Definitions that nothing refers to change nothing
                self.ignored(element, format!("{} is ignored", element.species()));
            }
        });
        Ok(())
    }
}
