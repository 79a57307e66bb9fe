//! Numbers, colours, points and transforms of an element.

use super::context::Context;
use super::xml::Element;
use crate::error::LoadError;
use glam::{DMat3, DMat4, DVec3};
use noisefloor::{Rgb, srgb_decode};

/// Linear Rec.709 colour of a spectrum that is 1 at all wavelengths: what Mitsuba 2 and 3 take an emitter's
/// `spectrum` for.
const EQUAL_ENERGY: Rgb = [1.2048, 0.9483, 0.9089];

/// What a colour is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// A factor, or an index of refraction.
    Factor,
    /// Light that is given off.
    Light,
}

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

    /// The value of an `rgb`, `srgb`, `spectrum` or `float`, linear.
    pub(super) fn colour(&self, object: &Element, name: &str, usage: Use) -> Result<Option<Rgb>, LoadError> {
        let tags = ["rgb", "srgb", "spectrum", "float", "integer"];
        let Some((element, value)) = self.value(object, name, &tags)? else { return Ok(None) };
        let colour = match element.tag.as_str() {
            "srgb" => self.srgb(element, value)?,
            "spectrum" => {
                let level = self.constant_spectrum(element, value)?;
                let white = match usage {
                    Use::Light if !self.document.old => EQUAL_ENERGY,
                    _ => [1.0; 3],
                };
                white.map(|white| white * level)
            }
            _ => match self.numbers(element, value)?.as_slice() {
                [grey] => [*grey as f32; 3],
                [r, g, b] => [*r as f32, *g as f32, *b as f32],
                other => {
                    return Err(self.bad(element, format!("{} numbers; a colour has 1 or 3", other.len())));
                }
            },
        };
        if colour.iter().any(|c| *c < 0.0 || !c.is_finite()) {
            return Err(self.bad(element, format!("the colour {colour:?} is negative or too large")));
        }
        Ok(Some(colour))
    }

    /// `#rrggbb`, or three numbers in 0…1, sRGB-encoded.
    fn srgb(&self, element: &Element, value: &str) -> Result<Rgb, LoadError> {
        let codes = match value.trim().strip_prefix('#').filter(|hex| hex.len() == 6 && hex.is_ascii()) {
            Some(hex) => [0, 2, 4]
                .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).ok().map(|c| f32::from(c) / 255.0)),
            None => match self.numbers(element, value)?.as_slice() {
                [r, g, b] => [*r, *g, *b].map(|c| Some(c as f32)),
                _ => [None; 3],
            },
        };
        match codes {
            [Some(r), Some(g), Some(b)] => Ok([r, g, b].map(srgb_decode)),
            _ => Err(self.bad(element, format!("`{value}` is neither #rrggbb nor three numbers"))),
        }
    }

    /// One number, or wavelengths that all have the same.
    fn constant_spectrum(&self, element: &Element, value: &str) -> Result<f32, LoadError> {
        let mut levels =
            value.split([',', ' ', '\t', '\n', '\r']).filter(|word| !word.is_empty()).map(|word| {
                let level = word.split_once(':').map_or(word, |(_, level)| level);
                self.number(element, level)
            });
        let first = levels.next().ok_or_else(|| self.bad(element, "the spectrum is empty"))??;
        for level in levels {
            if level? != first {
                return Err(self.unsupported(element, "a spectrum that is not the same at all wavelengths"));
            }
        }
        Ok(first as f32)
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

    /// One step of a transform.
    fn step(&self, step: &Element) -> Result<DMat4, LoadError> {
        match step.tag.as_str() {
            "translate" => Ok(DMat4::from_translation(self.triple(step, 0.0)?)),
            "scale" => Ok(DMat4::from_scale(self.triple(step, 1.0)?)),
            "rotate" => {
                let angle =
                    step.attribute("angle").ok_or_else(|| self.bad(step, "a rotation needs an angle"))?;
                let angle = self.number(step, angle)?;
                let axis = self.triple(step, 0.0)?.try_normalize();
                let axis = axis.ok_or_else(|| self.bad(step, "a rotation needs an axis that is not 0"))?;
                Ok(DMat4::from_axis_angle(axis, angle.to_radians()))
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

    /// Attributes `x`, `y` and `z`, of which those that are missing are `missing`, or one or three numbers in
    /// `value`.
    fn triple(&self, element: &Element, missing: f64) -> Result<DVec3, LoadError> {
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
    fn value<'e>(
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

    /// Numbers that spaces or commas part.
    fn numbers(&self, element: &Element, text: &str) -> Result<Vec<f64>, LoadError> {
        let words = text.split(|c: char| c == ',' || c.is_ascii_whitespace()).filter(|word| !word.is_empty());
        words.map(|word| self.number(element, word)).collect()
    }

    fn number(&self, element: &Element, text: &str) -> Result<f64, LoadError> {
        let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.bad(element, format!("`{text}` is not a finite number")))
    }
}
