//! Reads scenes from files for [`noisefloor_ptwne`]: glTF 2.0 (`.gltf`, `.glb`), the subset of Mitsuba's XML
//! (versions 0.5 to 3) that research scenes use, and pbrt (versions 3 and 4).
//!
//! Files are hostile until parsed: every length is checked before anything is allocated, every error says
//! which file and where, and what is not supported is named, with whether it was ignored or is fatal.

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

mod bounds;
mod channels;
mod colour;
mod error;
mod files;
mod gltf;
mod indices;
mod loaded;
mod mesh;
mod mitsuba;
mod options;
mod pbrt;
mod picture;
mod sky;

pub use error::{Finding, LoadError, Place, Treatment, Warning, group_warnings};
pub use loaded::Loaded;
pub use options::LoadOptions;

use std::path::Path;

/// Loads the scene in `path`; its extension says which format: `.gltf`, `.glb`, `.xml` or `.pbrt`.
///
/// # Errors
/// [`LoadError`] if a file cannot be read or parsed, or asks for something that cannot be left out.
pub fn load(path: &Path) -> Result<Loaded, LoadError> {
    load_with(path, &LoadOptions::default())
}

/// As [`load`], with what the file leaves open.
pub fn load_with(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let mut loaded = match extension.as_str() {
        "gltf" | "glb" => gltf::load(path, options.root.as_deref()),
        "pbrt" => pbrt::load(path, options),
        "xml" => mitsuba::load(path, options),
        _ => Err(LoadError::Format { path: path.to_owned() }),
    }?;
    if !loaded.scene.is_lit() {
        loaded.warnings.push(Warning::ignored(Place::file(path), "the scene has no light: it is black"));
    }
    Ok(loaded)
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
