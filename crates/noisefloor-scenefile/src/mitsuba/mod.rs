//! Mitsuba XML, versions 0.5 to 3.
//!
//! What is read: shapes `obj`, `ply`, `serialized`, `rectangle`, `cube`, `sphere`, `disk`; surfaces
//! `diffuse`, `plastic`, `roughplastic`, `conductor`, `roughconductor`, `dielectric`, `thindielectric`,
//! `twosided`, `mask`, and what is under a `bumpmap` or `normalmap`; textures `bitmap` and `checkerboard`;
//! emitters `area`, `constant`, `envmap`, `point`, `spot`, `directional`; the first sensor, if it is
//! `perspective` or `thinlens`; `default`, `ref`. Other shapes, surfaces, textures and emitters are errors,
//! as is `include`; all else that is not read is warned of.
//!
//! `xml` makes a tree of the file, `values` reads numbers, colours and transforms from it, and `context`
//! follows references, and notes what nobody has read: that is warned of. The rest is a module for each part
//! of a scene.

mod bsdfs;
mod context;
mod emitters;
mod raster;
mod sensor;
mod shapes;
mod surface;
mod textures;
mod values;
mod xml;

use crate::error::{LoadError, Place};
use crate::{Loaded, files};
use context::Context;
use noisefloor_ptwne::SceneBuilder;
use shapes::Materials;
use std::path::Path;
use xml::Document;

/// Loads the scene in `path`.
pub(crate) fn load(path: &Path) -> Result<Loaded, LoadError> {
    let bytes = files::read(path, xml::MAX_XML_BYTES, &Place::file(path))?;
    let document = Document::parse(&bytes, path)?;
    let context = Context::new(&document)?;
    let root = &document.root;
    root.read();
    if let Some(include) = root.all("include").next() {
        return Err(context.unsupported(include, "<include>"));
    }

    // What looks at the scene
    let sensors: Vec<_> = root.all("sensor").collect();
    let sensor = sensors.first().ok_or_else(|| Place::file(path).bad("the scene has no <sensor>"))?;
    for other in &sensors[1..] {
        other.irrelevant();
        context.warn(other, "only the first sensor is used");
    }
    let (camera, size) = context.camera(sensor)?;
    let max_depth = root.all("integrator").next().map_or(Ok(None), |element| context.max_depth(element))?;

    // What is in it
    let name = crate::title(path);
    let mut builder = SceneBuilder::new(name, camera).map_err(context.refused(sensor))?;
    let mut materials = Materials::new();
    for shape in root.all("shape") {
        context.shape(shape, &mut builder, &mut materials)?;
    }
    let mut surroundings = 0;
    for emitter in root.all("emitter") {
        surroundings += usize::from(context.emitter(emitter, &mut builder)?);
        if surroundings > 1 {
            return Err(context.bad(emitter, "a second emitter surrounds the scene; there can be only one"));
        }
    }

    let scene = builder.build().map_err(|cause| LoadError::Scene { place: Place::file(path), cause })?;
    context.warn_of_unread();
    Ok(Loaded { scene, size, max_depth, warnings: context.into_warnings() })
}
