//! Mitsuba XML, versions 0.5 to 3.
//!
//! `markup` splits text into tags, `document` makes a tree of the files, with includes and parameters
//! resolved; `context` follows references, reads numbers, points and transforms, and notes what nobody has
//! read, which becomes warnings. Each part of a scene has a module. The README lists what is read. Errors of
//! shapes and emitters are collected, so that one load names all.

mod bsdfs;
mod colours;
mod context;
mod document;
mod emitters;
mod markup;
mod parts;
mod sensor;
mod shapes;
mod textures;
mod xml;

use crate::error::{Errors, LoadError, Place};
use crate::loaded::{Loaded, title};
use crate::options::LoadOptions;
use context::Context;
use document::Document;
use noisefloor_ptwne::{Optics, SceneBuilder};
use sensor::View;
use shapes::Filling;
use std::path::Path;

pub(crate) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let document = Document::read(path, options)?;
    let context = Context::new(&document, options)?;
    let root = &document.root;
    root.read();

    // What looks at the scene
    let sensors: Vec<_> = root.all("sensor").collect();
    let sensor = sensors.first().ok_or_else(|| Place::file(path).bad("the scene has no <sensor>"))?;
    for other in &sensors[1..] {
        other.irrelevant();
        context.ignored(other, "only the first sensor is used");
    }
    let mut errors = Errors::default();
    let camera = errors.take(context.camera(sensor))?;
    let integrator = root.all("integrator").next();
    let max_depth = integrator.map_or(Ok(None), |element| context.max_depth(element))?;
    let hides_lights = integrator.map_or(Ok(false), |element| context.hides_emitters(element))?;

    // What is in it: without a camera, too, so that all errors are found
    let View { camera, optics, size } = camera.unwrap_or_default();
    let mut builder = SceneBuilder::new(title(path), camera).map_err(context.refused(sensor))?;
    builder.optics(Optics { hides_lights, ..optics }).map_err(context.refused(sensor))?;
    let mut filling = Filling::new(builder);
    for shape in root.all("shape") {
        errors.take(context.shape(shape, &mut filling))?;
    }
    let mut surrounded = false;
    for emitter in root.all("emitter") {
        // A sky takes long to make: a second one is refused before it is
        let surrounds = matches!(emitter.kind(), "constant" | "envmap" | "sky" | "sun" | "sunsky");
        if surrounds && std::mem::replace(&mut surrounded, true) {
            let what = "a second emitter surrounds the scene; there can be only one";
            errors.take(Err::<(), _>(context.bad(emitter, what)))?;
        } else {
            errors.take(context.emitter(emitter, &mut filling.builder))?;
        }
    }
    errors.take(context.finish())?;
    errors.finish()?;

    let scene = filling.builder.build().map_err(Place::file(path).refused())?;
    let scene = scene.with_identity(document.load.folder.contents());
    Ok(Loaded { scene, size, max_depth, clamp: None, warnings: document.load.into_warnings() })
}
