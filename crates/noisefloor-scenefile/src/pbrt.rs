//! pbrt, versions 3 and 4.
//!
//! `tokens` splits the text, `params` reads what follows a directive, and `reader` executes directives one by
//! one, as pbrt does, over a stack of states. Each kind of thing has a module: `camera`, `colours`, `lights`,
//! `materials`, `shapes`, `textures`. Errors of shapes and lights are collected, so that one load names all.
//!
//! Read here and not by a crate: pbrt4 0.2.0 reads version 4 only, and its errors name neither file nor line.

mod arguments;
mod camera;
mod colours;
mod directives;
mod environment;
mod gloss;
mod lights;
mod materials;
mod moves;
mod objects;
mod params;
mod reader;
mod shapes;
mod state;
mod textures;
mod tokens;

use crate::error::LoadError;
use crate::loaded::Loaded;
use crate::options::LoadOptions;
use std::path::Path;

pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let mut reader = reader::Reader::new(path, options)?;
    reader.file(path, 0)?;
    reader.finish()
}
