//! Lights without size, over a floor that is almost Lambertian.

use super::kit::{Maker, render};
use crate::util::assert_warns;
use std::f32::consts::PI;

pub(crate) const ALBEDO: f32 = 0.6;

/// A floor of y = 0 seen from above at the origin, with a light on the node `node`.
pub(crate) fn floor(light: &str, node: &str) -> Maker {
    let mut maker = Maker::empty();
    maker.push("cameras", r#"{"type": "perspective", "perspective": {"yfov": 0.0001, "znear": 0.1}}"#);
    maker.node(r#"{"camera": 0, "translation": [0, 3, 0], "rotation": [-0.70710678, 0, 0, 0.70710678]}"#);
    // An index of refraction of 1 leaves (1 − cos)⁵ of the angle with the half vector: at most 1e-3 below 60°
    let floor = maker.rectangle(
        [-9.0, 9.0],
        [-9.0, 9.0],
        0.0,
        &format!(
            r#"{{"pbrMetallicRoughness": {{"baseColorFactor": [{ALBEDO}, {ALBEDO}, {ALBEDO}, 1], "metallicFactor": 0}},
                "extensions": {{"KHR_materials_ior": {{"ior": 1}}}}}}"#
        ),
    );
    maker.node(&format!(r#"{{"mesh": {floor}, "rotation": [-0.70710678, 0, 0, 0.70710678]}}"#));
    maker.root["extensions"]["KHR_lights_punctual"]["lights"] = super::kit::json(&format!("[{light}]"));
    maker.node(&format!(r#"{{{node}, "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}"#));
    maker
}

/// Direct light has no noise: tolerance is for the Fresnel term and for f32.
fn check(maker: &Maker, expected: [f32; 3]) {
    let pixels = render(maker.load().unwrap(), 2, 16, 2);
    for p in pixels {
        let close = p.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 2e-3 * b + 1e-6);
        assert!(close, "{p:?}, expected {expected:?}");
    }
}

#[test]
fn points_light_by_the_inverse_square() {
    // The node is scaled: that changes no light
    let node = r#""translation": [0, 2.5, 0], "scale": [3, 3, 3]"#;
    let point = r#"{"type": "point", "intensity": 10, "color": [1, 0.5, 0.25]}"#;
    check(&floor(point, node), [1.0, 0.5, 0.25].map(|c| ALBEDO / PI * 10.0 * c / (2.5 * 2.5)));
}

#[test]
fn directions_light_by_the_cosine() {
    // −z turned by −60° about x points down by 60° from the horizon
    let node = r#""rotation": [-0.5, 0, 0, 0.8660254]"#;
    let sun = r#"{"type": "directional", "intensity": 3}"#;
    check(&floor(sun, node), [ALBEDO / PI * 3.0 * 60f32.to_radians().sin(); 3]);
}

#[test]
fn spots_light_within_their_cone() {
    let spot = r#"{"type": "spot", "intensity": 10, "range": 5, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}}"#;
    // −z turned by −90° about x points straight down; then by so much more towards +x about z
    let aimed = |angle: f32| {
        let (s, c) = (angle / 2.0).sin_cos();
        let h = std::f32::consts::FRAC_1_SQRT_2;
        // The quaternion product of (0, 0, s, c) and (−h, 0, 0, h)
        floor(
            spot,
            &format!(
                r#""translation": [0, 2, 0], "rotation": [{}, {}, {}, {}]"#,
                -h * c,
                -h * s,
                h * s,
                h * c
            ),
        )
    };
    let full = ALBEDO / PI * 10.0 / 4.0;
    check(&aimed(0.0), [full; 3]);
    check(&aimed(0.19), [full; 3]);
    // Between the cones the square of what the specification interpolates by cosines
    let fade = (0.3f32.cos() - 0.4f32.cos()) / (0.2f32.cos() - 0.4f32.cos());
    check(&aimed(0.3), [full * fade * fade; 3]);
    // Beyond them is nothing, and so the scene is lit
    assert_warns(&aimed(0.41).load().unwrap(), &["its own lights show next to nothing", "a grey sky"]);
    // A hard edge
    let mut hard = aimed(0.39);
    hard.root["extensions"]["KHR_lights_punctual"]["lights"][0]["spot"]["innerConeAngle"] = 0.4.into();
    check(&hard, [full; 3]);
    assert_warns(&aimed(0.0).load().unwrap(), &["light 0", "range"]);
}
