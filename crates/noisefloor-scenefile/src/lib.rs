//! Reads scenes from files for [`noisefloor_ptwne`]: glTF 2.0 (`.gltf`, `.glb`), the subset of Mitsuba's XML
//! (versions 0.5 to 3) that research scenes use, and pbrt (versions 3 and 4).
//!
//! Files are hostile until parsed: every length is checked before anything is allocated, every error says
//! which file and where, and what is not supported is named, with whether it was ignored or is fatal.
//!
//! All readers are behind the feature `formats`, on by default: a first build of the command has the types alone.

#![cfg_attr(not(feature = "formats"), allow(dead_code, reason = "what readers say, and nobody reads"))]
#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

#[cfg(feature = "formats")]
mod bounds;
#[cfg(feature = "formats")]
mod channels;
#[cfg(feature = "formats")]
mod colour;
mod error;
#[cfg(feature = "formats")]
mod files;
#[cfg(feature = "formats")]
mod gltf;
#[cfg(feature = "formats")]
mod indices;
#[cfg(feature = "formats")]
mod load;
mod loaded;
#[cfg(feature = "formats")]
mod mesh;
#[cfg(feature = "formats")]
mod mitsuba;
mod options;
#[cfg(feature = "formats")]
mod pbrt;
#[cfg(feature = "formats")]
mod picture;
#[cfg(feature = "formats")]
mod sky;

pub use error::{Finding, LoadError, LoadFault, Place, Treatment, Warning, group_warnings};
pub use loaded::Loaded;
pub use options::LoadOptions;

use std::path::Path;

/// Loads the scene in `path`; its extension says which format: `.gltf`, `.glb` (or `.vrm`, which is one), `.xml` or
/// `.pbrt`.
///
/// # Errors
/// [`LoadError`] if a file cannot be read or parsed, or asks for something that cannot be left out.
pub fn load(path: &Path) -> Result<Loaded, LoadError> {
    load_with(path, &LoadOptions::default())
}

/// As [`load`], with what the file leaves open.
pub fn load_with(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !matches!(extension.as_str(), "gltf" | "glb" | "vrm" | "pbrt" | "xml") {
        return Err(Place::file(path).error(LoadFault::Format));
    }
    let mut loaded = read(path, &extension, options)?;
    if !loaded.scene.is_lit() {
        loaded.warnings.push(Warning::ignored(Place::file(path), "the scene has no light: it is black"));
    }
    Ok(loaded)
}

#[cfg(feature = "formats")]
fn read(path: &Path, extension: &str, options: &LoadOptions) -> Result<Loaded, LoadError> {
    match extension {
        "pbrt" => pbrt::load(path, options),
        "xml" => mitsuba::load(path, options),
        _ => gltf::load(path, options.root.as_deref()),
    }
}

#[cfg(not(feature = "formats"))]
fn read(path: &Path, _: &str, _: &LoadOptions) -> Result<Loaded, LoadError> {
    Err(Place::file(path).error(LoadFault::LeftOut))
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
