use crate::util::{Folder, SKY, bsdf, float, nearest, shape_at, value};

/// α by a picture and by direction: what each place of a mirror shows is that of one with its own α.
#[test]
fn roughness_may_be_a_picture_and_differ_by_direction() {
    let folder = Folder::new().with_png("a.png", 2, &[[26, 26, 26, 255], [128, 128, 128, 255]]);
    let map = |name: &str| nearest(name, "a.png", true);
    let sun = r#"<emitter type="directional"><vector name="direction" x="-0.3" y="0.1" z="-1"/></emitter>"#;
    let at = |x: f32, alphas: &str| {
        let metal = bsdf("roughconductor", &(value("string", "distribution", "ggx") + alphas));
        folder.see(&(shape_at("rectangle", x, 0.0, &metal) + sun))[0]
    };
    let (left, right) = (26.0 / 255.0, 128.0 / 255.0);
    for (x, alpha) in [(0.5, left), (-0.5, right)] {
        for (mapped, plain) in [
            (map("alpha"), float("alpha", alpha)),
            (map("alpha_u") + &float("alpha_v", 0.3), float("alpha_u", alpha) + &float("alpha_v", 0.3)),
            (map("alpha_v") + &float("alpha_u", 0.3), float("alpha_v", alpha) + &float("alpha_u", 0.3)),
        ] {
            let (mapped, plain) = (at(x, &mapped), at(x, &plain));
            assert!((mapped / plain - 1.0).abs() < 1e-4, "{x}: {mapped} {plain}");
        }
    }
    // The light comes along u: a lobe that is wide there shows more of it
    let along = |u: f32, v: f32| at(0.5, &(float("alpha_u", u) + &float("alpha_v", v)));
    assert!(along(0.4, 0.1) > 2.0 * along(0.1, 0.4));
}

/// A transmission of ½ is half of a surface and half of glass: along the normal F = 0.04 is reflected by both, and of
/// a white sky √0.81/1.5² comes through the boundary. Mitsuba 3.9.1 has 0.629.
#[test]
fn principled_surfaces_transmit() {
    let folder = Folder::new();
    let bsdf = r#"<bsdf type="principled"><rgb name="base_color" value="0.81 0 0"/>
        <float name="eta" value="1.5"/>
        <float name="roughness" value="0"/><float name="spec_trans" value="0.5"/></bsdf>"#;
    let body = format!(r#"<shape type="rectangle">{bsdf}</shape>{SKY}"#);
    let seen = folder.see(&body);
    // Green is reflection alone; its standard error is that of a share of 4 % in 4096 samples
    assert!((seen[1] - 0.04).abs() < 0.013, "{seen:?}");
    // Burley's diffuse reflection of a smooth surface along the normal: ∫(1 − F_d/2)·cos/π with F_d = (1 − cos)⁵ is
    // 1 − 1/42
    let want = 0.04 + 0.5 * 0.81 * (1.0 - 1.0 / 42.0) + 0.5 * 0.96 * 0.9 / 2.25;
    assert!((seen[0] - want).abs() < 0.03, "{seen:?}, want {want}");
    assert_eq!(folder.body(&body).unwrap().warnings, []);
}
