//! Where a scene is seen from (glTF 2.0, §3.10).

use super::asset::Asset;
use super::nodes::Placed;
use super::parts::name;
use crate::{LoadError, Place};
use glam::DVec3;
use gltf::json::camera::Type;
use gltf::json::validation::Checked;
use noisefloor_ptwne::{Camera, Optics};

/// Vertical field of view in degrees where the file has no camera.
const DEFAULT_FOV: f64 = 40.0;

/// The first camera of the scene.
pub(super) fn first(asset: &Asset<'_>, placed: &[Placed<'_>]) -> Result<Option<(Camera, Optics)>, LoadError> {
    let mut cameras = placed.iter().filter_map(|p| p.node.camera.map(|camera| (p, camera)));
    let Some((at, index)) = cameras.next() else { return Ok(None) };
    for (other, _) in cameras {
        asset.load.ignored(&other.place, "its camera is ignored: the scene is seen from the first");
    }
    let source = asset.get(index, "camera", &at.place)?;
    let place = Place::part(asset.path, name("camera", index.value(), source.name.as_deref()));
    let (fov, parallel_height) = match (&source.type_, &source.perspective, &source.orthographic) {
        (Checked::Valid(Type::Perspective), Some(perspective), _) => {
            (f64::from(perspective.yfov).to_degrees(), None)
        }
        // Half the height that is seen; the width follows from the picture
        (Checked::Valid(Type::Orthographic), _, Some(seen)) => (DEFAULT_FOV, Some(2.0 * seen.ymag.abs())),
        _ => return Err(place.bad("it is no perspective or orthographic camera with its properties")),
    };
    asset.leave_out(&place, source.extensions.iter().flat_map(|e| e.others.keys()));
    let axes = at.to_world.matrix3;
    let [view, up] = [-axes.z_axis, axes.y_axis].map(DVec3::normalize_or_zero);
    let optics = Optics { parallel_height, ..Optics::default() };
    Ok(Some((camera(at.to_world.translation, view, up, fov), optics)))
}

/// A camera that sees the whole box from in front of it, above and to the right.
pub(super) fn framing([min, max]: [DVec3; 2]) -> Camera {
    let centre = (min + max) / 2.0;
    // A point is seen from nearby
    let radius = ((max - min).length() / 2.0).max(1e-3);
    let view = DVec3::new(-0.4, -0.3, -1.0).normalize();
    let distance = 1.05 * radius / (0.5 * DEFAULT_FOV).to_radians().sin();
    camera(centre - view * distance, view, DVec3::Y, DEFAULT_FOV)
}

fn camera(eye: DVec3, view: DVec3, up: DVec3, vertical_fov: f64) -> Camera {
    // The further from the origin, the coarser the target's numbers: it is as far away as they are large
    let target = eye + view * (1.0 + eye.length());
    let [eye, target, up] = [eye, target, up].map(|v| v.as_vec3().to_array());
    Camera { eye, target, up, vertical_fov: vertical_fov as f32 }
}
