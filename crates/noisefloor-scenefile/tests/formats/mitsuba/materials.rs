use crate::util::{
    Folder, SKY, assert_warns, bsdf, close, fails, float, nearest, of, ply, rgb, shape_at, value,
};

/// A 2 × 2 picture: red, green; grey, white; all transparent but one.
pub(crate) fn folder() -> Folder {
    Folder::new()
        .with_png("a.png", 2, &[[255, 0, 0, 0], [0, 255, 0, 255], [128, 128, 128, 0], [255, 255, 255, 0]])
        .with_exr("bright.exr", 1, &[[4.0, 2.0, -1.0]])
        .with_exr("turned.exr", 1, &[[0.9, 0.5, 0.8]])
        .with_exr("ramp.exr", 2, &[[0.0; 3], [1.0; 3]])
}

fn area(texture: &str) -> String {
    of("emitter", "area", &format!("<texture name=\"radiance\" {texture}</texture>"))
}

/// The rectangle from −1 to 1 shines with a texture, and the camera sees the middle of it, which is moved to
/// (u, v) of 0…1 from the lower left.
fn shine(folder: &Folder, texture: &str, u: f32, v: f32) -> [f32; 3] {
    folder.see(&shape_at("rectangle", 1.0 - 2.0 * u, 1.0 - 2.0 * v, &area(texture)))
}

const BITMAP: &str =
    r#"type="bitmap"><string name="filename" value="a.png"/><string name="filter_type" value="nearest"/>"#;
const RED: [f32; 3] = [1.0, 0.0, 0.0];
const GREEN: [f32; 3] = [0.0, 1.0, 0.0];
const GREY: [f32; 3] = [0.215_86; 3];
const WHITE: [f32; 3] = [1.0; 3];
const QUARTERS: [(f32, f32); 4] = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];

/// The four quarters, as Mitsuba 3.9.1 has them at u, v = ¼ and ¾: v runs down the picture.
#[test]
fn bitmaps_lie_as_in_mitsuba() {
    let folder = folder();
    let raw = value("boolean", "raw", true);
    let [clamp, mirror, repeat] =
        ["clamp", "mirror", "repeat"].map(|mode| value("string", "wrap_mode", mode));
    for (to_uv, more, want) in [
        ("", "", [RED, GREEN, GREY, WHITE]),
        ("", raw.as_str(), [RED, GREEN, [128.0 / 255.0; 3], WHITE]),
        (r#"<translate x="0.5"/>"#, "", [GREEN, RED, WHITE, GREY]),
        (r#"<translate y="0.5"/>"#, "", [GREY, WHITE, RED, GREEN]),
        (r#"<scale x="0.5"/>"#, "", [RED, RED, GREY, GREY]),
        (r#"<translate x="1"/>"#, &clamp, [GREEN, GREEN, WHITE, WHITE]),
        (r#"<translate x="1"/>"#, &mirror, [GREEN, RED, WHITE, GREY]),
        (r#"<rotate z="1" angle="90"/>"#, &repeat, [GREEN, WHITE, RED, GREY]),
    ] {
        let more = format!(r#"<transform name="to_uv">{to_uv}</transform>{more}"#);
        for ((u, v), want) in QUARTERS.into_iter().zip(want) {
            close(shine(&folder, &format!("{BITMAP}{more}"), u, v), want, 1e-3, &format!("{more} {u} {v}"));
        }
    }
    // Between pixels
    let bilinear = BITMAP.replace("nearest", "bilinear");
    let middle = shine(&folder, &bilinear, 0.5, 0.25);
    assert!(
        (middle[0] - 0.5).abs() < 0.01 && (middle[1] - 0.5).abs() < 0.01 && middle[2] < 0.01,
        "{middle:?}"
    );
}

#[test]
fn checkerboards_lie_as_in_mitsuba() {
    for ((u, v), want) in QUARTERS.into_iter().zip([0.4, 0.2, 0.2, 0.4]) {
        close(shine(&folder(), r#"type="checkerboard">"#, u, v), [want; 3], 1e-4, "checkerboard");
    }
    let twice = r#"type="checkerboard"><rgb name="color0" value="1, 0, 0"/><transform name="to_uv">
        <scale x="2" y="2"/></transform>"#;
    close(shine(&folder(), twice, 0.125, 0.125), [1.0, 0.0, 0.0], 1e-4, "checkerboard");
    close(shine(&folder(), twice, 0.375, 0.125), [0.2; 3], 1e-4, "checkerboard");
    close(shine(&folder(), twice, 0.625, 0.125), [1.0, 0.0, 0.0], 1e-4, "checkerboard");
    // Light may be above 1, as in Mitsuba 3.9.1
    for bright in [r#"<float name="color0" value="5"/>"#, r#"<spectrum name="color0" value="5"/>"#] {
        let bright = format!(r#"type="checkerboard">{bright}"#);
        for ((u, v), want) in QUARTERS.into_iter().zip([5.0, 0.2, 0.2, 5.0]) {
            close(shine(&folder(), &bright, u, v), [want; 3], 1e-4, &bright);
        }
    }
}

/// OBJ files have v run up the picture, PLY files as Mitsuba.
#[test]
fn mesh_files_have_their_own_ways_up() {
    let obj = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    let ply = ply("u v", &["-1 -1 0 0 0", "1 -1 0 1 0", "1 1 0 1 1", "-1 1 0 0 1"], &["3 0 1 2", "3 0 2 3"]);
    let folder = folder().with("a.obj", obj).with("a.ply", ply);
    let flip = |value| format!(r#"<boolean name="flip_tex_coords" value="{value}"/>"#);
    for (file, more, want) in [
        ("obj", String::new(), [GREY, WHITE, RED, GREEN]),
        ("obj", flip("false"), [RED, GREEN, GREY, WHITE]),
        ("ply", String::new(), [RED, GREEN, GREY, WHITE]),
        ("ply", flip("true"), [GREY, WHITE, RED, GREEN]),
    ] {
        for ((u, v), want) in QUARTERS.into_iter().zip(want) {
            let (x, y) = (1.0 - 2.0 * u, 1.0 - 2.0 * v);
            let name = value("string", "filename", format!("a.{file}"));
            let got = folder.see(&shape_at(file, x, y, &(name + &more + &area(BITMAP))));
            close(got, want, 1e-3, &format!("{file} {more} {u} {v}"));
        }
    }
    // Each side of a cube has the whole picture; on +z, u runs along y and v along x
    for ((u, v), want) in QUARTERS.into_iter().zip([RED, GREEN, GREY, WHITE]) {
        let (y, x) = (1.0 - 2.0 * u, 1.0 - 2.0 * v);
        close(folder.see(&shape_at("cube", x, y, &area(BITMAP))), want, 1e-3, "cube");
    }
}

#[test]
fn bright_pictures_shine_and_factors_are_clamped() {
    let folder = folder();
    let bright = BITMAP.replace("a.png", "bright.exr");
    close(shine(&folder, &bright, 0.5, 0.5), [4.0, 2.0, 0.0], 1e-3, "light");
    let body = format!(
        r#"<shape type="rectangle"><bsdf type="diffuse"><texture name="reflectance" {bright}</texture>
            </bsdf></shape>{SKY}"#
    );
    let outside = "line 2: 3 values of the picture are outside 0…1";
    assert_warns(&folder.body(&body).unwrap(), &[outside]);
    let body = r#"<shape type="rectangle"><bsdf type="conductor">
        <rgb name="specular_reflectance" value="1.5, 1, 0.5"/></bsdf></shape>"#;
    assert_warns(&folder.body(body).unwrap(), &["values above 1 become 1"]);
    close(folder.see(&format!("{body}{SKY}")), [1.0, 1.0, 0.5], 1e-4, body);
}

/// A picture of heights or of normals.
pub(super) fn picture(name: &str) -> String {
    let file = value("string", "filename", name) + &value("boolean", "raw", true);
    format!("<texture type=\"bitmap\" name=\"normalmap\">{file}</texture>")
}

/// What the camera sees of a rectangle in a white sky, from the front and from behind.
fn in_the_sky(folder: &Folder, bsdf: &str) -> [[f32; 3]; 2] {
    ["0", "180"].map(|angle| {
        folder.see(&format!(
            r#"<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="{angle}"/>
                </transform>{bsdf}</shape>{SKY}"#
        ))
    })
}

#[test]
fn surfaces_reflect_a_white_sky_as_they_should() {
    let folder = folder();
    let (black, white) = ([0.0; 3], [1.0; 3]);
    let metal = r#"<rgb name="eta" value="0.2, 0.9, 1.1"/><rgb name="k" value="3.9, 2.5, 2.1"/>"#;
    // Reflectance at normal incidence: ((η − 1)² + k²)/((η + 1)² + k²)
    let normal = |eta: f32, k: f32| ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
    let copper = [normal(0.2, 3.9), normal(0.9, 2.5), normal(1.1, 2.1)];
    let half = r#"<rgb name="reflectance" value="0.5, 0.25, 0"/>"#;
    let none = value("string", "material", "none");
    let black_base = bsdf("diffuse", &float("reflectance", 0.0));
    for (bsdf, front, behind) in [
        (String::new(), [0.5; 3], black),
        (bsdf("diffuse", ""), [0.5; 3], black),
        (bsdf("diffuse", half), [0.5, 0.25, 0.0], black),
        (bsdf("twosided", &bsdf("diffuse", half)), [0.5, 0.25, 0.0], [0.5, 0.25, 0.0]),
        (bsdf("diffuse", &value("srgb", "reflectance", "#ffff00")), [1.0, 1.0, 0.0], black),
        (bsdf("conductor", ""), white, black),
        (bsdf("conductor", &none), white, black),
        (bsdf("conductor", metal), copper, black),
        (bsdf("twosided", &bsdf("conductor", metal)), copper, copper),
        // F of bk7 in air, and η² fold: Mitsuba 3.9.1 has 0.467 and 2.20 with an index of 1.5
        (bsdf("dielectric", ""), [0.4646; 3], [2.211; 3]),
        (bsdf("thindielectric", &value("string", "int_ior", "diamond")), white, white),
        (bsdf("mask", &(float("opacity", 0.25) + &black_base)), [0.75; 3], [0.75; 3]),
        // A height that is the same everywhere
        (bsdf("bumpmap", &(picture("bright.exr") + &bsdf("diffuse", ""))), [0.5; 3], black),
        // Normals turned by 53° along u: (1 + 0.6)/2 of the sky is left
        (bsdf("normalmap", &(picture("turned.exr") + &bsdf("diffuse", ""))), [0.4; 3], black),
    ] {
        let [seen, seen_behind] = in_the_sky(&folder, &bsdf);
        // 4096 samples of values in 0…1 are within 0.03 of their mean but once in 10⁴
        close(seen, front, 0.06, &bsdf);
        close(seen_behind, behind, 0.06, &bsdf);
    }
    // What a white coat or a rough mirror reflects of a white sky, in Mitsuba 3.9.1; how far the renderer's
    // rough coat is from that is a matter of its own tests
    let ggx = value("string", "distribution", "ggx");
    let diffuse = rgb("diffuse_reflectance", 1);
    for (bsdf, want, tolerance) in [
        (bsdf("plastic", &diffuse), 1.0, 0.05),
        (bsdf("roughplastic", &(diffuse + &ggx + &value("boolean", "nonlinear", true))), 0.910, 0.1),
        (bsdf("roughconductor", &(float("alpha", 0.05) + &ggx)), 0.998, 0.05),
    ] {
        let [seen, behind] = in_the_sky(&folder, &bsdf);
        close(seen, [want; 3], tolerance, &bsdf);
        assert_eq!(behind, black, "{bsdf}");
        assert_eq!(folder.body(&format!(r#"<shape type="cube">{bsdf}</shape>"#)).unwrap().warnings, []);
    }
    // A name for a metal, and the list where there is none
    let named = |name: &str| bsdf("conductor", &value("string", "material", name));
    let gold = in_the_sky(&folder, &named("Au"))[0];
    close(gold, [normal(0.143, 3.983), normal(0.3753, 2.3856), normal(1.442, 1.6034)], 1e-3, "gold");
    fails(folder.body(&of("shape", "cube", &named("Xx"))), "the metal `Xx` (known: none, Ag, Al");
}

/// Roughness and metal may both vary. Red metal of α = 0.01 shows no green, red plastic shows it in its coat: 4 %
/// along the normal.
#[test]
fn principled_surfaces_vary() {
    let folder = folder().with_png("rough.png", 2, &[[25, 25, 25, 255]; 4]);
    let rough = nearest("roughness", "rough.png", true);
    let metal = format!(r#"<texture name="metallic" {BITMAP}</texture>"#);
    for (roughness, warnings) in [
        (rough.as_str(), 0),
        (r#"<float name="roughness" value="0.1"/>"#, 0),
        (&rough.replace("nearest", "bilinear"), 1),
    ] {
        let bsdf = format!(
            r#"<bsdf type="principled"><rgb name="base_color" value="0.5 0 0"/><float name="eta" value="1.5"/>
                {roughness}{metal}</bsdf>"#
        );
        let loaded = folder.body(&format!(r#"<shape type="cube">{bsdf}</shape>"#)).unwrap();
        assert_eq!(loaded.warnings.len(), warnings, "{:?}", loaded.warnings);
        // The picture's luminance is the share of metal
        for ((u, v), share) in QUARTERS.into_iter().zip([0.2126, 0.7152, 0.2159, 1.0]) {
            let (x, y) = (1.0 - 2.0 * u, 1.0 - 2.0 * v);
            let seen = folder.see(&(shape_at("rectangle", x, y, &bsdf) + SKY));
            let metal = if warnings == 1 { 0.5359 } else { share };
            assert!((seen[1] - 0.04 * (1.0 - metal)).abs() < 0.006, "{u} {v}: {seen:?}");
        }
    }
}

/// Opacity is luminance: 0.7152 where the picture is green, whatever its alpha.
#[test]
fn masks_take_the_luminance_of_pictures() {
    let folder = folder();
    for ((u, v), opacity) in QUARTERS.into_iter().zip([0.2126, 0.7152, 0.2159, 1.0]) {
        let (x, y) = (1.0 - 2.0 * u, 1.0 - 2.0 * v);
        let black = bsdf("twosided", &bsdf("diffuse", &float("reflectance", 0.0)));
        let mask = bsdf("mask", &format!("<texture name=\"opacity\" {BITMAP}</texture>{black}"));
        let seen = folder.see(&(shape_at("rectangle", x, y, &mask) + SKY));
        // Four standard deviations of 4096 samples
        assert!((seen[0] - (1.0 - opacity)).abs() < 0.03, "{u} {v}: {seen:?}");
    }
}

/// What is a number may be a colour: Mitsuba 3.9.1 takes the mean of its channels, 0.5 here.
#[test]
fn colours_in_place_of_numbers_are_their_mean() {
    let folder = folder();
    let [black, white] = [0.0, 1.0].map(|albedo| bsdf("diffuse", &float("reflectance", albedo)));
    let rgb = |name: &str| rgb(name, "0.2 0.5 0.8");
    for bsdf in [
        format!(r#"<bsdf type="mask">{}{black}</bsdf>"#, rgb("opacity")),
        format!(r#"<bsdf type="blendbsdf">{}{black}{white}</bsdf>"#, rgb("weight")),
    ] {
        let got = folder.see(&format!("<shape type=\"rectangle\">{bsdf}</shape>{SKY}"));
        // Four standard deviations of 4096 samples; the luminance is 0.458
        assert!((got[0] - 0.5).abs() < 0.03, "{bsdf}: {got:?}");
    }
    let names = ["spec_tint", "sheen", "sheen_tint", "clearcoat", "clearcoat_gloss", "flatness", "metallic"];
    for name in names.into_iter().chain(["anisotropic", "roughness"]) {
        let see = |number: &str| {
            let base = r#"<rgb name="base_color" value="0.5 0.1 0.1"/><float name="clearcoat" value="0.5"/>"#;
            let base = if name == "clearcoat" { "" } else { base };
            let bsdf = format!(r#"<bsdf type="principled">{base}{number}</bsdf>"#);
            folder.see(&format!("<shape type=\"rectangle\">{bsdf}</shape>{SKY}"))
        };
        let number = see(&format!(r#"<float name="{name}" value="0.5"/>"#));
        close(see(&rgb(name)), number, 1e-5, name);
    }
}

/// Surfaces that are replaced by others say so, and load.
#[test]
fn near_surfaces_are_warned_of() {
    let folder = folder();
    for (bsdf, what) in [
        (bsdf("roughdiffuse", ""), "fast approximation"),
        (bsdf("phong", &float("exponent", 50.0)), "Beckmann's microfacets"),
        (bsdf("ward", ""), "Beckmann's microfacets"),
        (bsdf("principledthin", ""), "what is seen from behind is left out"),
        (bsdf("principled", &float("sheen", 2.0)), "`sheen` is 2, and is brought into 0…1"),
        (bsdf("twosided", &bsdf("diffuse", "").repeat(2)), "the back of"),
        (bsdf("coating", &bsdf("conductor", "")), "the coat of <bsdf type=\"coating\"> is left out"),
        (
            bsdf("roughplastic", &(float("alpha_u", 0.1) + &float("alpha_v", 0.2))),
            "roughness that varies is replaced by its mean",
        ),
        (bsdf("conductor", &(rgb("eta", "-0.01 1 1") + &rgb("k", 3))), "brought into 0…100"),
    ] {
        assert_warns(&folder.body(&of("shape", "cube", &bsdf)).unwrap(), &[what]);
    }
    // Exact ones do not
    let null = format!(r#"<shape type="rectangle"><bsdf type="null"/></shape>{SKY}"#);
    close(folder.see(&null), [1.0; 3], 1e-4, &null);
    assert_eq!(folder.body(&null).unwrap().warnings, []);
    let scaled = r#"<shape type="rectangle"><emitter type="area"><texture type="scale" name="radiance">
        <float name="scale" value="3"/><texture type="checkerboard"/></texture></emitter></shape>"#;
    let shown = folder.see(scaled);
    // The camera sees where four squares meet
    assert!((shown[0] - 0.9).abs() < 0.05, "{shown:?}");
}

#[test]
fn reflectances_may_be_spectra() {
    let body = format!(
        r#"<shape type="rectangle"><bsdf type="diffuse"><spectrum name="reflectance"
            value="400:0.1, 500:0.2, 600:0.3, 700:0.4"/></bsdf></shape>{SKY}"#
    );
    close(folder().see(&body), [0.340_779, 0.242_912, 0.140_304], 2e-2, &body);
}

/// A textured sphere and disk, seen from +z: u and v as Mitsuba 3.9.1 has them. The picture is red, green;
/// grey, white.
#[test]
fn spheres_and_disks_have_the_coordinates_of_mitsuba() {
    let folder = folder();
    let see = |shape: &str, to_world: &str| {
        folder.see(&format!(
            r#"<shape type="{shape}"><transform name="to_world">{to_world}</transform><bsdf type="diffuse">
                <texture name="reflectance" {BITMAP}</texture></bsdf></shape>{SKY}"#
        ))
    };
    // Sphere, from its pole: u grows from +x over +y, v is near 0: the upper row of the picture
    for (x, y, want) in [(0.3, 0.3, RED), (-0.3, 0.3, RED), (-0.3, -0.3, GREEN), (0.3, -0.3, GREEN)] {
        let got = see("sphere", &format!(r#"<translate x="{}" y="{}"/>"#, -x, -y));
        close(got, want, 2e-2, &format!("sphere {x} {y}"));
    }
    // Turned so that −z looks up, the lower row: +x stays
    for (x, y, want) in [(0.3, 0.3, WHITE), (0.3, -0.3, GREY)] {
        let turn = r#"<rotate x="1" angle="180"/>"#;
        let got = see("sphere", &format!(r#"{turn}<translate x="{}" y="{}"/>"#, -x, -y));
        close(got, want, 2e-2, &format!("turned sphere {x} {y}"));
    }
    // Disk: u is the radius, v the angle from +x over +y
    for (x, y, want) in
        [(0.2, 0.2, RED), (0.5, 0.5, GREEN), (-0.5, 0.5, GREEN), (0.2, -0.2, GREY), (-0.5, -0.5, WHITE)]
    {
        let got = see("disk", &format!(r#"<translate x="{}" y="{}"/>"#, -x, -y));
        close(got, want, 2e-2, &format!("disk {x} {y}"));
    }
    // Seen on a mirrored disk, the angle runs the other way
    let mirrored = see("disk", r#"<scale y="-1"/><translate x="-0.5" y="-0.5"/>"#);
    close(mirrored, WHITE, 2e-2, "mirrored disk");
}

/// Blends of surfaces reflect the blend of their light.
#[test]
fn blends_and_mixtures_keep_their_shares() {
    let [black, white, grey] = [0.0, 1.0, 0.5].map(|albedo| bsdf("diffuse", &float("reflectance", albedo)));
    let mixture = r#"<bsdf type="mixturebsdf"><string name="weights" value="0.5, 0.2, 0.1"/>"#;
    for (bsdf, want) in [
        (format!(r#"<bsdf type="blendbsdf"><float name="weight" value="0.25"/>{black}{white}</bsdf>"#), 0.25),
        (format!("{mixture}{black}{white}{grey}</bsdf>"), 0.25),
        (r#"<bsdf type="phong"/>"#.to_owned(), 0.7),
    ] {
        let got = folder().see(&format!("<shape type=\"rectangle\">{bsdf}</shape>{SKY}"));
        // 4096 samples of values in 0…1: five standard errors
        assert!((got[0] - want).abs() < 0.04, "{bsdf}: {got:?}");
    }
}

/// A single rough boundary before a white sky shows what it does in Mitsuba 3.9.1: behind it, radiance is that of
/// the sky over 1.5².
#[test]
fn rough_glass_shows_the_sky_as_in_mitsuba() {
    let folder = folder();
    let glass = |ior: f32, alpha: f32| {
        folder.see(&format!(
            r#"<shape type="rectangle"><bsdf type="roughdielectric"><string name="distribution" value="ggx"/>
            <float name="int_ior" value="{ior}"/><float name="ext_ior" value="1"/>
            <float name="alpha" value="{alpha}"/></bsdf></shape>{SKY}"#
        ))[0]
    };
    for (alpha, mitsuba) in [(0.1, 0.466), (0.5, 0.447)] {
        assert!((glass(1.5, alpha) - mitsuba).abs() < 0.01, "{alpha}: {} {mitsuba}", glass(1.5, alpha));
    }
}
