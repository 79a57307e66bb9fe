use crate::util::{Folder, SKY, assert_warns, close, nearest, of, rgb, seen, to_world};
use std::f32::consts::FRAC_1_PI;

const FLOOR: &str = r#"<shape type="rectangle"><transform name="to_world"><scale value="100"/></transform>
    <bsdf type="diffuse"><float name="reflectance" value="0.8"/></bsdf></shape>"#;

#[test]
fn lights_without_size_light_a_floor() {
    let folder = Folder::new();
    let high = r#"<point name="position" x="0" y="0" z="2"/>"#;
    let slanting = r#"<vector name="direction" x="0" y="3" z="-4"/>"#;
    let from_above = |x: u32| to_world(&format!(r#"<lookat origin="0,0,2" target="{x},0,0" up="0,1,0"/>"#));
    for (kind, place, light, irradiance) in [
        ("point", high.to_owned(), rgb("intensity", "4, 8, 0"), [1.0, 2.0, 0.0]),
        ("point", to_world(r#"<translate z="4"/>"#), rgb("intensity", 16), [1.0; 3]),
        ("directional", slanting.to_owned(), rgb("irradiance", "5, 0, 0"), [4.0, 0.0, 0.0]),
        ("directional", to_world(r#"<rotate x="1" angle="180"/>"#), rgb("irradiance", 5), [5.0; 3]),
        ("directional", String::new(), rgb("irradiance", 5), [0.0; 3]),
        ("spot", from_above(0), rgb("intensity", 4), [1.0; 3]),
        ("spot", from_above(2), rgb("intensity", 4), [0.0; 3]),
    ] {
        let light = of("emitter", kind, &(place + &light));
        let want = irradiance.map(|e| e * 0.8 * FRAC_1_PI);
        close(folder.see(&format!("{FLOOR}{light}")), want, 1e-3, &light);
    }
    assert_eq!(folder.body(r#"<emitter type="spot"/>"#).unwrap().warnings, []);
}

/// Spots fade by the angle, and project a picture over their cone; a projector's picture is irradiance over π, one
/// unit away, the right way up as seen from where it is.
#[test]
fn pictures_are_projected_as_in_mitsuba() {
    let pixels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]];
    let folder = Folder::new().with_png("four.png", 2, &pixels);
    let at =
        |x: f32, y: f32| to_world(&format!(r#"<lookat origin="{x},{y},2" target="{x},{y},0" up="0,1,0"/>"#));
    let picture = |name: &str| nearest(name, "four.png", false);
    let aslant =
        r#"<transform name="to_world"><lookat origin="0,0,2" target="0.630598,0,0" up="0,1,0"/></transform>"#;
    let projector = |x: f32, y: f32, light: &str| {
        format!(r#"<emitter type="projector"><float name="fov" value="90"/>{}{light}</emitter>"#, at(x, y))
    };
    let spot = |x: f32, y: f32| {
        let [place, picture] = [at(x, y), picture("texture")];
        format!(
            r#"<emitter type="spot"><float name="cutoff_angle" value="45"/><float name="beam_width"
                value="44"/><rgb name="intensity" value="4"/>{place}{picture}</emitter>"#
        )
    };
    // Without the cosine and the distance, which are those of a point for a spot, and of the plane for a projector
    let slant = |x: f32, y: f32| (4.0 / (4.0 + x * x + y * y)).powf(1.5);
    let pi = std::f32::consts::PI;
    for (light, irradiance) in [
        (format!(r#"<emitter type="spot"><rgb name="intensity" value="4"/>{aslant}</emitter>"#), [0.5; 3]),
        (projector(0.5, 0.0, r#"<rgb name="irradiance" value="3"/>"#), [3.0 * pi / 4.0; 3]),
        (projector(2.1, 0.0, r#"<rgb name="irradiance" value="3"/>"#), [0.0; 3]),
        // What is seen lies to the left of and below the middle
        (projector(0.5, 0.5, &picture("irradiance")), [0.0, 0.0, pi / 4.0]),
        (projector(-0.5, -0.5, &picture("irradiance")), [0.0, pi / 4.0, 0.0]),
        (spot(0.5, 0.6), [0.0, slant(0.5, 0.6), 0.0]),
        (spot(-0.5, -0.6), [0.0, 0.0, slant(0.5, 0.6)]),
    ] {
        let want = irradiance.map(|e| e * 0.8 * FRAC_1_PI);
        close(folder.see(&format!("{FLOOR}{light}")), want, 2e-3, &light);
    }
}

/// Suns of version 0.6 stand over +y, and are as bright whatever their size; a scale of their own replaces that of
/// both.
#[test]
fn suns_of_version_0_6_are_those_of_its_source() {
    let folder = Folder::new();
    let floor = |more: &str| {
        let text = format!(
            r#"<scene version="0.6.0"><sensor type="perspective"><float name="fov" value="0.1"/><transform
                name="toWorld"><lookat origin="0,5,0" target="0,0,0" up="0,0,1"/></transform></sensor>
            <shape type="rectangle"><transform name="toWorld"><rotate x="1" angle="-90"/></transform></shape>
            <emitter type="sun"><vector name="sunDirection" x="0" y="0.8" z="0.6"/>{more}</emitter></scene>"#
        );
        seen(folder.load(&text).unwrap_or_else(|e| panic!("{more}: {e}")))
    };
    let plain = floor("");
    assert!(plain[0] > plain[2] && plain[2] > 0.1, "{plain:?}");
    // A floor that a small sun in a map lights has a noise of 1.5 % after 4096 samples
    close(floor(r#"<float name="sunRadiusScale" value="8"/>"#), plain, 6e-2, "its size");
    let scaled = r#"<float name="scale" value="3"/><float name="sunScale" value="2"/>"#;
    close(floor(scaled), plain.map(|c| 2.0 * c), 1e-3, "its scale");
}

#[test]
fn surroundings_are_seen() {
    let folder = Folder::new();
    let constant = r#"<emitter type="constant"><rgb name="radiance" value="0.25, 0.5, 1"/></emitter>"#;
    close(folder.see(constant), [0.25, 0.5, 1.0], 1e-5, constant);
}

/// The camera looks along −z of the scene, so sees the map where u is 0 between the last column and the
/// first; turned by +90° about y, the map's +x comes to be there, at u = ¼.
#[test]
fn maps_lie_as_in_mitsuba() {
    let columns: Vec<[f32; 3]> = (0..2 * 8).map(|i| [(i % 8) as f32, 0.0, 1.0]).collect();
    let folder = Folder::new().with_exr("sky.exr", 8, &columns).with_png("sky.png", 1, &[[255, 188, 0, 255]]);
    for (more, want) in [
        (String::new(), [3.5, 0.0, 1.0]),
        (r#"<float name="scale" value="2"/>"#.to_owned(), [7.0, 0.0, 2.0]),
        (to_world(r#"<rotate y="1" angle="90"/>"#), [1.5, 0.0, 1.0]),
        (to_world(r#"<rotate y="1" angle="-90"/>"#), [5.5, 0.0, 1.0]),
        // Mirrored after it is turned
        (to_world(r#"<rotate y="1" angle="90"/><scale x="-1"/>"#), [1.5, 0.0, 1.0]),
        (to_world(r#"<scale x="-1"/><rotate y="1" angle="90"/>"#), [5.5, 0.0, 1.0]),
        (to_world(r#"<scale z="-3" x="3" y="3"/>"#), [3.5, 0.0, 1.0]),
    ] {
        let body =
            format!(r#"<emitter type="envmap"><string name="filename" value="sky.exr"/>{more}</emitter>"#);
        close(folder.see(&body), want, 2e-3, &more);
    }
    // Codes are decoded
    let body = r#"<emitter type="envmap"><string name="filename" value="sky.png"/></emitter>"#;
    close(folder.see(body), [1.0, 0.5029, 0.0], 1e-3, body);
}

/// What a rectangle shows that emits a spectrum, as Mitsuba 3.9.1 has it in its RGB mode; black bodies as its
/// spectral mode.
#[test]
fn emitted_spectra_are_colours() {
    let folder = Folder::new();
    for (radiance, want) in [
        (r#"<spectrum name="radiance" value="16"/>"#, [19.2767, 15.1727, 14.5427]),
        (r#"<spectrum name="radiance" value="400:1, 500:2, 600:3, 700:4"/>"#, [4.020_61, 2.313_68, 1.244_53]),
        (r#"<spectrum name="radiance" type="d65"><float name="scale" value="2"/></spectrum>"#, [2.0; 3]),
        (r#"<spectrum name="radiance" type="uniform"><float name="value" value="2"/></spectrum>"#, [2.0; 3]),
        (r##"<rgb name="radiance" value="#ff8000"/>"##, [1.0, 0.215_86, 0.0]),
        (r#"<spectrum name="radiance" value="0.5, 0.25, 0"/>"#, [0.5, 0.25, 0.0]),
    ] {
        let body = format!(r#"<shape type="rectangle"><emitter type="area">{radiance}</emitter></shape>"#);
        close(folder.see(&body), want, 3e-3, radiance);
    }
    let black_body = |temperature: &str| {
        folder.see(&format!(
            r#"<shape type="rectangle"><emitter type="area"><blackbody name="radiance"
                temperature="{temperature}" scale="0.001"/></emitter></shape>"#
        ))
    };
    // Planck's law at 555 nm: exp(hc/λkT) − 1 is 316.6 and 74.2
    let (warm, cold) = (black_body("4500"), black_body("6000K"));
    assert!(warm[0] > warm[1] && warm[1] > warm[2], "{warm:?}");
    assert!((cold[1] / warm[1] - 316.6 / 74.2).abs() < 0.3, "{warm:?} {cold:?}");
}

/// A lamp of nothing, as Blender writes them: seen before what lies behind it, in front of other lights
/// without hiding them, and dark from behind.
#[test]
fn lamps_of_nothing_shine() {
    let folder = Folder::new();
    let lamp = |more: &str| {
        format!(
            r#"<shape type="rectangle">{more}<bsdf type="null"/>
            <emitter type="area"><rgb name="radiance" value="0.5 0.25 0"/></emitter></shape>"#
        )
    };
    let front = lamp("") + SKY;
    close(folder.see(&front), [1.5, 1.25, 1.0], 1e-4, &front);
    let back = lamp(r#"<boolean name="flip_normals" value="true"/>"#) + SKY;
    close(folder.see(&back), [1.0; 3], 1e-4, &back);

    // A floor lit by a small lamp, and by the sky through it: ρ/π·(A·L/h² + π) where it looks straight up
    let up = r#"<transform name="to_world"><scale value="0.05"/>
        <rotate y="1" angle="180"/><translate z="2"/></transform>"#;
    let floor = r#"<shape type="rectangle"><transform name="to_world"><scale value="9"/></transform>
        <bsdf type="diffuse"><float name="reflectance" value="0.5"/></bsdf></shape>"#;
    let small = lamp(up).replace("0.5 0.25 0", "500 250 0") + floor + SKY;
    let light = |radiance: f32| 0.5 / std::f32::consts::PI * 0.01 / 4.0 * radiance + 0.5;
    // One lobe and one sky: 4096 samples have a standard error of 1 %
    close(folder.see(&small), [light(500.0), light(250.0), light(0.0)], 0.04, &small);
}

/// An emitter of another kind in a shape shines as it would by itself.
#[test]
fn spots_in_shapes_shine() {
    let folder = Folder::new();
    let floor =
        r#"<shape type="rectangle"><transform name="to_world"><scale value="9"/></transform></shape>"#;
    let spot = r#"<emitter type="point"><point name="position" x="0" y="0" z="2"/>
        <rgb name="intensity" value="8 4 2"/></emitter>"#;
    let inside = format!(
        r#"{floor}<shape type="sphere"><point name="center" x="90" y="0" z="0"/>
        <float name="radius" value="0.1"/>        {spot}</shape>"#
    );
    let want = [8.0, 4.0, 2.0].map(|i| 0.5 / std::f32::consts::PI * i / 4.0);
    close(folder.see(&inside), want, 1e-3, &inside);
    let beam = format!(r#"{floor}<emitter type="collimated"/>"#);
    assert_warns(&folder.body(&beam).unwrap(), &["the beam is ignored"]);
}

/// A Radiance picture begins with `#?` and any word (Ward 1991). Codes 128 with an exponent of 129 are
/// 128·2^(129 − 136) = 1; 64 are 0.5.
#[test]
fn radiance_pictures_begin_with_any_word() {
    for word in ["RADIANCE", "RGBE", "rtrace 5.4 -vp 0 0 1", ""] {
        let text = format!("#?{word}\n# made by hand\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n");
        let sky = [text.as_bytes(), &[128, 64, 0, 129, 128, 64, 0, 129]].concat();
        let folder = Folder::new().with("sky.hdr", sky);
        let body = r#"<emitter type="envmap"><string name="filename" value="sky.hdr"/></emitter>"#;
        close(folder.see(body), [1.0, 0.5, 0.0], 1e-4, word);
    }
}
