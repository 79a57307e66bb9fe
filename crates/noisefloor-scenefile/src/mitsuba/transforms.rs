//! Transforms.

use super::context::Context;
use super::xml::Element;
use crate::error::LoadError;
use glam::{DMat3, DMat4, DVec3};

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

    /// One step of a transform.
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
