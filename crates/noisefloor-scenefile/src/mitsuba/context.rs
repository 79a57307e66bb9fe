//! What the readers of all parts of a scene share: references, warnings, limits, and the leaves: numbers,
//! names, points and transforms.

use super::document::{Document, unset};
use super::parts::{Attribute, Surface};
use super::xml::Element;
use crate::error::{LoadError, Place};
use crate::load::Load;
use crate::options::{LoadOptions, NO_MEDIA};
use glam::{DMat3, DMat4, DVec3};
use noisefloor_ptwne::{Facets, ImageTexture, Material, SceneError, Texture};
use std::cell::RefCell;
use std::collections::HashMap;
use std::fmt;
use std::path::PathBuf;

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

/// A scene file that is being read.
#[derive(Debug)]
pub(super) struct Context<'d> {
    pub(super) document: &'d Document,
    pub(super) load: &'d Load,
    pub(super) options: &'d LoadOptions,
    /// Pictures that have been read, by file and whether their codes are linear.
    pub(super) rasters: RefCell<HashMap<(PathBuf, bool), ImageTexture>>,
    /// Surfaces that have been read, by the serial number of their element.
    pub(super) surfaces: RefCell<HashMap<usize, Surface>>,
    /// Textures that have been read, by the serial number of their element and whether they are light.
    pub(super) textures: RefCell<HashMap<(usize, bool), (f32, Texture)>>,
    /// The attributes of meshes that surfaces use, by the serial number of their element.
    pub(super) attributes: RefCell<HashMap<usize, Option<Attribute>>>,
    identified: HashMap<&'d str, &'d Element>,
    aliases: HashMap<&'d str, &'d str>,
}

impl<'d> Context<'d> {
    pub(super) fn new(document: &'d Document, options: &'d LoadOptions) -> Result<Self, LoadError> {
        let context = Self {
            document,
            load: &document.load,
            options,
            rasters: RefCell::default(),
            surfaces: RefCell::default(),
            textures: RefCell::default(),
            attributes: RefCell::default(),
            identified: HashMap::new(),
            aliases: HashMap::new(),
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
    pub(super) fn refused(&self, element: &Element) -> impl Fn(SceneError) -> LoadError + use<> {
        self.place(element).refused()
    }

    /// Warns, once, that something is left out.
    pub(super) fn ignored(&self, element: &Element, what: impl fmt::Display) {
        self.load.ignored(&self.place(element), what);
    }

    /// Warns, once, that something is replaced by something that looks much the same.
    pub(super) fn approximated(&self, element: &Element, what: impl fmt::Display) {
        self.load.approximated(&self.place(element), what);
    }

    /// Counts pixels that are kept, and refuses too many.
    pub(super) fn count_pixels(&self, element: &Element, count: usize) -> Result<(), LoadError> {
        self.load.count_pixels(&self.place(element), count)
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
    pub(super) fn nested_in<T>(
        &self,
        element: &'d Element,
        read: impl FnOnce() -> Result<T, LoadError>,
    ) -> Result<T, LoadError> {
        self.load.bounds.begin(element.serial, element.label(), &self.place(element))?;
        let result = read();
        self.load.bounds.end();
        result
    }

    /// Counts the tables of a material under a coat.
    pub(super) fn coat(
        &self,
        element: &Element,
        material: &Material,
        facets: (bool, Facets),
    ) -> Result<(), LoadError> {
        self.load.bounds.coat(material, facets, &self.place(element))
    }

    /// Counts work that is done for `element`.
    pub(super) fn spend(&self, element: &Element, work: usize) -> Result<(), LoadError> {
        self.load.bounds.spend(work, &self.place(element))
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

// Numbers, switches, names and points of an element.

impl Context<'_> {
    /// The value of a `float` or `integer`.
    pub(super) fn float(&self, object: &Element, name: &str) -> Result<Option<f64>, LoadError> {
        self.value(object, name, &["float", "integer"])?.map(|(e, value)| self.number(e, value)).transpose()
    }

    /// The value of an `integer`.
    pub(super) fn integer(&self, object: &Element, name: &str) -> Result<Option<i64>, LoadError> {
        let Some((element, value)) = self.value(object, name, &["integer"])? else { return Ok(None) };
        let number = value.trim().parse().ok();
        number.map(Some).ok_or_else(|| self.bad(element, format!("`{value}` is not an integer")))
    }

    /// The value of a `boolean`, or else `default`.
    pub(super) fn boolean(&self, object: &Element, name: &str, default: bool) -> Result<bool, LoadError> {
        match self.value(object, name, &["boolean"])? {
            None => Ok(default),
            Some((element, value)) => match value.trim().to_ascii_lowercase().as_str() {
                "true" => Ok(true),
                "false" => Ok(false),
                _ => Err(self.bad(element, format!("`{value}` is neither true nor false"))),
            },
        }
    }

    /// The value of a `string`.
    pub(super) fn string<'e>(&self, object: &'e Element, name: &str) -> Result<Option<&'e str>, LoadError> {
        Ok(self.value(object, name, &["string"])?.map(|(_, value)| value))
    }

    /// The value of a `point` or `vector`.
    pub(super) fn point(&self, object: &Element, name: &str) -> Result<Option<DVec3>, LoadError> {
        let Some(element) = object.get(name) else { return Ok(None) };
        if element.tag != "point" && element.tag != "vector" {
            return Err(
                self.bad(element, format!("`{name}` is a <{}>; expected a point or vector", element.tag))
            );
        }
        self.triple(element, 0.0).map(Some)
    }

    /// Attributes `x`, `y` and `z`, of which those that are missing are `missing`, or one or three numbers in
    /// `value`.
    pub(super) fn triple(&self, element: &Element, missing: f64) -> Result<DVec3, LoadError> {
        if let Some(value) = element.attribute("value") {
            return match self.numbers(element, value)?.as_slice() {
                [all] => Ok(DVec3::splat(*all)),
                [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
                other => Err(self.bad(element, format!("{} numbers; expected 1 or 3", other.len()))),
            };
        }
        let axis = |name| element.attribute(name).map_or(Ok(missing), |value| self.number(element, value));
        Ok(DVec3::new(axis("x")?, axis("y")?, axis("z")?))
    }

    /// The element called `name`, which must have one of the `tags`, and its value.
    pub(super) fn value<'e>(
        &self,
        object: &'e Element,
        name: &str,
        tags: &[&str],
    ) -> Result<Option<(&'e Element, &'e str)>, LoadError> {
        let Some(element) = object.get(name) else { return Ok(None) };
        if !tags.contains(&element.tag.as_str()) {
            let what = format!("`{name}` is a <{}>; expected <{}>", element.tag, tags.join(">, <"));
            return Err(self.bad(element, what));
        }
        match element.attribute("value") {
            Some(value) => Ok(Some((element, value))),
            None => Err(self.bad(element, format!("`{name}` has no value"))),
        }
    }

    /// Numbers separated by spaces or commas.
    pub(super) fn numbers(&self, element: &Element, text: &str) -> Result<Vec<f64>, LoadError> {
        let words = text.split(|c: char| c == ',' || c.is_ascii_whitespace()).filter(|word| !word.is_empty());
        words.map(|word| self.number(element, word)).collect()
    }

    pub(super) fn number(&self, element: &Element, text: &str) -> Result<f64, LoadError> {
        let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.bad(element, format!("`{text}` is not a finite number")))
    }
}

// Transforms.

impl Context<'_> {
    /// The value of a `transform`, or else the identity.
    pub(super) fn transform(&self, object: &Element, name: &str) -> Result<DMat4, LoadError> {
        let Some(element) = object.get(name) else { return Ok(DMat4::IDENTITY) };
        if element.tag != "transform" {
            return Err(self.bad(element, format!("`{name}` is a <{}>; expected a transform", element.tag)));
        }
        let mut result = DMat4::IDENTITY;
        for step in &element.children {
            step.read();
            // What comes later in the file is done later
            result = self.step(step)? * result;
        }
        if result.is_finite() { Ok(result) } else { Err(self.bad(element, "the transform is too large")) }
    }

    fn step(&self, step: &Element) -> Result<DMat4, LoadError> {
        match step.tag.as_str() {
            "translate" => Ok(DMat4::from_translation(self.triple(step, 0.0)?)),
            "scale" => Ok(DMat4::from_scale(self.triple(step, 1.0)?)),
            "rotate" => {
                let angle =
                    step.attribute("angle").ok_or_else(|| self.bad(step, "a rotation needs an angle"))?;
                let angle = self.number(step, angle)?;
                let given = self.triple(step, 0.0)?;
                let axis = given.try_normalize();
                let axis = axis.ok_or_else(|| self.bad(step, "a rotation needs an axis that is not 0"))?;
                let length = given.length();
                if self.document.old || (length - 1.0).abs() < 1e-3 {
                    return Ok(DMat4::from_axis_angle(axis, angle.to_radians()));
                }
                let what = format!("an axis of length {length:.3} stretches what it turns, as in Mitsuba 3");
                self.approximated(step, what);
                Ok(DMat4::from_mat3(stretched(given, angle.to_radians())))
            }
            "matrix" => self.matrix(step),
            "lookat" | "lookAt" => self.look_at(step),
            _ => Err(self.unsupported(step, format!("{} in a transform", step.label()))),
        }
    }

    /// Row-major: 16 numbers, or 9 without translation.
    fn matrix(&self, step: &Element) -> Result<DMat4, LoadError> {
        let numbers = self.numbers(step, step.attribute("value").unwrap_or_default())?;
        if let Ok(rows) = <&[f64; 16]>::try_from(numbers.as_slice()) {
            if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
                return Err(self.unsupported(step, "a matrix whose last row is not 0 0 0 1"));
            }
            return Ok(DMat4::from_cols_array(rows).transpose());
        }
        match <&[f64; 9]>::try_from(numbers.as_slice()) {
            Ok(rows) => Ok(DMat4::from_mat3(DMat3::from_cols_array(rows).transpose())),
            Err(_) => Err(self.bad(step, format!("{} numbers; a matrix has 9 or 16", numbers.len()))),
        }
    }

    /// +z looks from `origin` to `target`, +y is up, and so +x is to the left.
    fn look_at(&self, step: &Element) -> Result<DMat4, LoadError> {
        let point = |name: &str| match step.attribute(name).map(|value| self.numbers(step, value)) {
            Some(numbers) => match numbers?.as_slice() {
                [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
                _ => Err(self.bad(step, format!("`{name}` is not three numbers"))),
            },
            None if name == "up" => Ok(DVec3::Y),
            None => Err(self.bad(step, format!("`{name}` is missing"))),
        };
        let (origin, target, up) = (point("origin")?, point("target")?, point("up")?);
        let view = (target - origin).try_normalize();
        let left = view.and_then(|view| up.cross(view).try_normalize().map(|left| (view, left)));
        let (view, left) = left
            .ok_or_else(|| self.bad(step, "origin and target are the same, or `up` points along the view"))?;
        let up = view.cross(left);
        Ok(DMat4::from_cols(left.extend(0.0), up.extend(0.0), view.extend(0.0), origin.extend(1.0)))
    }
}

/// Rodrigues' formula for an axis of any length, which Mitsuba 3 does not bring to 1 (version 0.6 did): cos
/// θ·I + (1 − cos θ)·a·aᵀ + sin θ·[a]×.
fn stretched(a: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = angle.sin_cos();
    let outer = DMat3::from_cols(a * a.x, a * a.y, a * a.z);
    let cross = DMat3::from_cols(a.cross(DVec3::X), a.cross(DVec3::Y), a.cross(DVec3::Z));
    // a × e is the column of [a]× for e
    DMat3::IDENTITY * cos + outer * (1.0 - cos) + cross * sin
}
