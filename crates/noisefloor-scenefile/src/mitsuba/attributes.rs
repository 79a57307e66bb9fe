//! Attributes of meshes, which are colours at their corners or on their faces.

use super::context::Context;
use super::xml::Element;
use crate::error::LoadError;
use crate::mesh::{Triangles, ply};
use std::path::Path;

/// An attribute that a surface takes its colour from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Attribute {
    /// With `vertex_` or `face_` in front.
    pub(super) name: String,
    /// Factor on it.
    scale: f64,
}

impl<'d> Context<'d> {
    /// The attribute that the surfaces in an element use, if they use one.
    ///
    /// # Errors
    /// [`LoadError`] if they use several.
    pub(super) fn attribute_of(&self, element: &'d Element) -> Result<Option<Attribute>, LoadError> {
        if let Some(known) = self.attributes.borrow().get(&element.serial) {
            return Ok(known.clone());
        }
        self.spend(element, element.children.len())?;
        let mut found = None;
        for child in &element.children {
            let part = self.resolve(child)?;
            let attribute = match part.tag.as_str() {
                "texture" if part.kind() == "mesh_attribute" => {
                    let name = self.string(part, "name")?;
                    let name =
                        name.ok_or_else(|| self.bad(part, "a mesh attribute needs a `name`"))?.to_owned();
                    Some(Attribute { name, scale: self.float(part, "scale")?.unwrap_or(1.0) })
                }
                "bsdf" | "texture" => self.nested_in(part, || self.attribute_of(part))?,
                _ => None,
            };
            if found.is_some() && attribute.is_some() && found != attribute {
                return Err(self.unsupported(part, "a second attribute of one mesh"));
            }
            found = found.or(attribute);
        }
        self.attributes.borrow_mut().insert(element.serial, found.clone());
        Ok(found)
    }

    /// A PLY mesh with the colours of an attribute, brought into 0…1.
    pub(super) fn coloured(
        &self,
        shape: &Element,
        bytes: &[u8],
        path: &Path,
        attribute: &Attribute,
    ) -> Result<Triangles, LoadError> {
        let mut mesh = ply::parse_with(bytes, path, Some(&attribute.name))?;
        let mut outside = 0;
        for value in mesh.colours.iter_mut().chain(&mut mesh.face_colours).flatten() {
            *value *= attribute.scale as f32;
            if !(0.0..=1.0).contains(value) {
                outside += 1;
                *value = if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
            }
        }
        if outside > 0 {
            let what = format!("{outside} values of `{}` are outside 0…1 and are clamped", attribute.name);
            self.approximated(shape, what);
        }
        Ok(mesh)
    }
}
