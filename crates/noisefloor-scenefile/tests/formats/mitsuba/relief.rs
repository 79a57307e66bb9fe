use super::materials::{folder, picture};
use crate::util::{bsdf, close, float};

/// A ramp that rises by 1 over a quarter turn of u: where its slope lies, and which way green points, are those of
/// Mitsuba 3.9.1. The rectangle is 2 units wide, of which a ramp of 2 pixels rises over half: a slope of `scale`
/// along +x between the middles of the pixels. Lit along −z +x.
#[test]
fn reliefs_turn_normals_as_in_mitsuba() {
    let folder = folder();
    let lit = |relief: &str| {
        folder.see(&format!(
            r#"<shape type="rectangle">{relief}</shape><emitter type="directional">
            <vector name="direction" x="-1" y="-0.5" z="-1"/><rgb name="irradiance" value="3"/></emitter>"#
        ))
    };
    let light = glam::Vec3::new(1.0, 0.5, 1.0).normalize();
    let lambert =
        |n: [f32; 3]| [0.5 / std::f32::consts::PI * 3.0 * glam::Vec3::from(n).normalize().dot(light); 3];
    let bump =
        |scale: f32| bsdf("bumpmap", &(picture("ramp.exr") + &float("scale", scale) + &bsdf("diffuse", "")));
    for scale in [0.25, 0.5, -0.5] {
        close(lit(&bump(scale)), lambert([-scale, 0.0, 1.0]), 2e-3, &format!("bumps of {scale}"));
    }
    let turned = bsdf("normalmap", &(picture("turned.exr") + &bsdf("diffuse", "")));
    close(lit(&turned), lambert([0.8, 0.0, 0.6]), 2e-3, "normals");
}
