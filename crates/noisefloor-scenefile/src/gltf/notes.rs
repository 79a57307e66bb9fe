//! What a load does without.

use super::asset::Asset;
use crate::{LoadError, Place, Warning};
use std::collections::{BTreeSet, HashSet};
use std::fmt;

/// Extensions that a file may require. `KHR_mesh_quantization` is but a wider choice of accessors, all of which are
/// read; of `KHR_materials_variants` the material without a variant is shown, as its specification has it.
const KNOWN: &[&str] = &[
    super::parts::DRACO,
    super::parts::INSTANCES,
    super::parts::VISIBILITY,
    super::parts::WEBP,
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

#[derive(Debug, Default)]
pub(super) struct Notes {
    warnings: Vec<Warning>,
    /// What has been said already, with its place.
    said: HashSet<String>,
    /// Extensions that some warning names.
    extensions: BTreeSet<String>,
}

impl Notes {
    /// Something is ignored or replaced.
    pub(super) fn warn(&mut self, place: &Place, what: impl fmt::Display) {
        self.push(Warning::ignored(place.clone(), what));
    }

    /// Something is replaced by what looks much the same.
    pub(super) fn near(&mut self, place: &Place, what: impl fmt::Display) {
        self.push(Warning::approximated(place.clone(), what));
    }

    fn push(&mut self, warning: Warning) {
        if self.said.insert(warning.to_string()) {
            self.warnings.push(warning);
        }
    }

    /// An element has these extensions, which are ignored.
    pub(super) fn extensions<'n>(&mut self, place: &Place, names: impl IntoIterator<Item = &'n String>) {
        for name in names {
            self.warn(place, format_args!("the extension {name} is ignored"));
            self.extensions.insert(name.clone());
        }
    }

    /// All warnings, with those for the extensions that the file uses but no element that was read.
    pub(super) fn finish(mut self, asset: &Asset<'_>) -> Vec<Warning> {
        for (place, property) in &asset.unread {
            self.warn(&Place::part(asset.path, place), format_args!("the property `{property}` is ignored"));
        }
        let place = Place::part(asset.path, "extensionsUsed");
        for name in &asset.root.extensions_used {
            if !KNOWN.contains(&name.as_str()) && !self.extensions.contains(name) {
                self.warn(&place, format_args!("the extension {name} is ignored"));
            }
        }
        self.warnings
    }
}

/// Checks that the file requires no extension that would be missed.
pub(super) fn check_required(asset: &Asset<'_>) -> Result<(), LoadError> {
    let required = asset.root.extensions_required.iter();
    let missing: Vec<&str> = required.map(String::as_str).filter(|name| !KNOWN.contains(name)).collect();
    let (named, place) = (missing.join(", "), Place::part(asset.path, "extensionsRequired"));
    match missing.len() {
        0 => Ok(()),
        1 => Err(place.unsupported(format_args!("the extension {named}, which the file requires,"))),
        _ => Err(place.unsupported(format_args!("each of the extensions {named}, which the file requires,"))),
    }
}
