//! Numbers, switches, names and points of an element.

use super::context::Context;
use super::xml::Element;
use crate::error::LoadError;
use glam::DVec3;

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
