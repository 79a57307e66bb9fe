use crate::util::{Folder, PINHOLE, assert_warns, close, fails, look, ply, render, seen};
use noisefloor_ptwne::{FovAxis, RenderOptions};
use noisefloor_scenefile::LoadOptions;
use std::f32::consts::PI;

/// A square from −1 to 1 whose front is +z.
const SQUARE: &str =
    "Shape 'trianglemesh' 'integer indices' [0 1 2 0 2 3] 'point3 P' [-1 -1 0 1 -1 0 1 1 0 -1 1 0]\n";
/// The same with texture coordinates from 0 to 1.
const MAPPED: &str = "Shape 'trianglemesh' 'integer indices' [0 1 2 0 2 3] \
    'point3 P' [-1 -1 0 1 -1 0 1 1 0 -1 1 0] 'point2 uv' [0 0 1 0 1 1 0 1]\n";
const LIGHT: &str = "AreaLightSource 'diffuse' 'rgb L' [1 2 3]\n";
const SKY: &str = "LightSource 'infinite' 'rgb L' [1 1 1]\n";

/// Fronts, as the source of pbrt has them: by corners in the shape's own coordinates, by normals where there
/// are any.
#[test]
fn lights_shine_from_their_front() {
    let normals = SQUARE.replace("'point3 P'", "'normal N' [0 0 -1 0 0 -1 0 0 -1 0 0 -1] 'point3 P'");
    for (before, shape, shines) in [
        ("", SQUARE, true),
        ("Rotate 180 0 1 0\n", SQUARE, false),
        ("Scale -1 1 1\n", SQUARE, true),
        ("Scale 1 1 -1\n", SQUARE, false),
        ("ReverseOrientation\n", SQUARE, false),
        ("ReverseOrientation Rotate 180 0 1 0\n", SQUARE, true),
        ("", &normals, false),
        ("ReverseOrientation\n", &normals, true),
        ("", "Shape 'disk' 'float radius' 2\n", true),
        ("ReverseOrientation\n", "Shape 'disk'\n", false),
        ("", "Shape 'sphere' 'float radius' 0.5\n", true),
        ("ReverseOrientation\n", "Shape 'sphere' 'float radius' 0.5\n", false),
    ] {
        let want = if shines { [1.0, 2.0, 3.0] } else { [0.0; 3] };
        close(Folder::new().see(&format!("{before}{LIGHT}{shape}")), want, 1e-4, &format!("{before}{shape}"));
    }
}

/// pbrt's pictures have +x of the camera on the right: with `LookAt` from +z, +x of the world is on the left
/// of them.
#[test]
fn pictures_are_not_mirrored() {
    let world = format!("WorldBegin {LIGHT} Translate 1 0 0 {SQUARE}");
    for (scale, lit) in [("", [true, false]), ("Scale -1 1 1 ", [false, true])] {
        let text = format!("{scale}LookAt 0 0 5 0 0 0 0 1 0 Camera 'perspective' 'float fov' 40 {world}");
        let loaded = Folder::new().load_with(&text, &LoadOptions::default()).unwrap();
        assert_eq!(loaded.scene.optics().fov_axis, FovAxis::Smaller);
        let pixels = look(loaded, 2);
        for (side, lit) in [0, 1].into_iter().zip(lit) {
            assert_eq!(pixels[side][0] > 0.05, lit, "{scale}{side}: {pixels:?}");
        }
    }
}

/// Bumps, normal maps and subdivided meshes.
#[test]
fn relief_and_subdivision_shape_what_is_lit() {
    let exr = |pixels: &[[f32; 3]]| Folder::new().with_exr("a.exr", pixels.len(), pixels);
    // From +x +z onto the square, whose u runs along +x over 2 units
    let sun = "LightSource 'distant' 'rgb L' [3 3 3] 'point3 from' [1 0 1] 'point3 to' [0 0 0]\n";
    let lambert = |[x, z]: [f32; 2]| [0.5 / PI * 3.0 * (x + z) / (2.0 * (x * x + z * z)).sqrt(); 3];
    // A picture of two pixels rises by 1 between their middles, 1 unit apart; times −0.1·4
    let ramp = exr(&[[0.0; 3], [1.0; 3]]);
    let texture = "Texture 't' 'float' 'imagemap' 'string filename' 'a.exr' 'float scale' 4\n\
        Texture 's' 'float' 'scale' 'texture tex' 't' 'float scale' -0.1\n";
    for material in
        ["Material 'diffuse' 'texture displacement' 's'\n", "Material 'matte' 'texture bumpmap' 's'\n"]
    {
        let world = format!("{sun}{texture}{material}{MAPPED}");
        close(ramp.see(&world), lambert([0.4, 1.0]), 5e-3, material);
    }
    let turned = exr(&[[0.8, 0.5, 0.9]]);
    let material = "Material 'diffuse' 'string normalmap' 'a.exr'\n";
    close(turned.see(&format!("{sun}{material}{MAPPED}")), lambert([0.6, 0.8]), 5e-3, material);

    // A flat square of four: subdivided, its middle stays where it is. Levels beyond memory are refused
    let grid = "Shape 'loopsubdiv' 'integer indices' [0 1 4 0 4 3 1 2 5 1 5 4 3 4 7 3 7 6 4 5 8 4 8 7] \
        'point3 P' [-1 -1 0 0 -1 0 1 -1 0 -1 0 0 0 0 0 1 0 0 -1 1 0 0 1 0 1 1 0] 'integer levels' ";
    let loaded = ramp.world(&format!("{sun}{grid}2")).unwrap();
    assert_eq!((loaded.scene.surfaces(), loaded.warnings.len()), (8 * 16, 0));
    close(ramp.see(&format!("{sun}{grid}2")), lambert([0.0, 1.0]), 5e-3, grid);
    for levels in ["11", "77", "1e30"] {
        fails(ramp.world(&format!("{grid}{levels}")), "triangles of a subdivision, more than 209");
    }
}

#[test]
fn materials_of_both_versions_reflect_the_sky() {
    let folder = Folder::new();
    for (material, want, tolerance) in [
        ("Material 'diffuse' 'rgb reflectance' [0.5 0.25 0]", [0.5, 0.25, 0.0], 1e-3),
        ("Material 'matte' 'color Kd' [0.5 0.25 0]", [0.5, 0.25, 0.0], 1e-3),
        ("MakeNamedMaterial 'm' 'string type' 'diffuse' NamedMaterial 'm'", [0.5; 3], 1e-3),
        ("Material 'mirror' 'rgb Kr' [0.5 0.25 0]", [0.5, 0.25, 0.0], 1e-3),
        // A single boundary: 4 % of the sky, and 96 % over 1.5². One of 25 samples is reflected
        ("Material 'dielectric'", [0.04 + 0.96 / 2.25; 3], 2e-2),
        ("Material 'glass'", [0.04 + 0.96 / 2.25; 3], 2e-2),
        ("Material 'thindielectric'", [1.0; 3], 1e-3),
        ("Material 'interface'", [1.0; 3], 1e-3),
        (
            "Material 'conductor' 'spectrum eta' 'metal-Ag-eta' 'spectrum k' 'metal-Ag-k'",
            [0.97, 0.96, 0.90],
            0.05,
        ),
        ("Material 'conductor' 'rgb reflectance' [0.5 0.25 0]", [0.5, 0.25, 0.0], 2e-2),
        ("Material 'plastic' 'rgb Kd' [0.5 0.25 0] 'rgb Ks' [0 0 0]", [0.5, 0.25, 0.0], 1e-3),
        // Seen along the normal, Oren's and Nayar's A of 20°: 1 − σ²/(2(σ² + 0.33)) = 0.8652
        ("Material 'matte' 'rgb Kd' [0.5 0.25 0] 'float sigma' 20", [0.4326, 0.2163, 0.0], 2e-2),
        // 4 % of a mirror. One of ten samples takes the facets: four standard deviations
        (
            "Material 'uber' 'rgb Kd' [0 0.2 0] 'rgb Ks' [0.5 0.5 0.5] 'rgb Kr' [0 0 1] \
             'float roughness' 0.001 'bool remaproughness' false",
            [0.02, 0.22, 0.06],
            0.19,
        ),
        (
            "Material 'uber' 'rgb Kd' [0.5 0.25 0] 'rgb Ks' [0 0 0] 'rgb opacity' [0.5 0.5 0.5]",
            [0.75, 0.625, 0.5],
            6e-2,
        ),
        (
            "Material 'translucent' 'rgb Kd' [1 0.5 0] 'rgb Ks' [0 0 0] 'rgb reflect' [0.5 0.5 0.5] \
             'rgb transmit' [0.25 0.25 0.25]",
            [0.75, 0.375, 0.0],
            1e-3,
        ),
        (
            "Material 'diffusetransmission' 'rgb reflectance' [0.2 0 0] 'rgb transmittance' [0 0.8 0] \
             'float scale' 0.5",
            [0.1, 0.4, 0.0],
            5e-2,
        ),
        (
            "MakeNamedMaterial 'a' 'string type' 'diffuse' 'rgb reflectance' [1 1 1] \
             MakeNamedMaterial 'b' 'string type' 'diffuse' 'rgb reflectance' [0 0 0] \
             Material 'mix' 'string materials' ['a' 'b'] 'float amount' 0.25",
            [0.75; 3],
            0.06,
        ),
    ] {
        close(folder.see(&format!("{SKY}{material}\n{SQUARE}")), want, tolerance, material);
    }
}

/// Half a degree and more off the mirrored direction a mirror is black. Version 3 takes a roughness below 0.001 for
/// that, which is an α of 0.047, except for glass.
#[test]
fn only_glass_is_smooth_in_version_3() {
    let sun = "LightSource 'distant' 'rgb L' [1 1 1] 'point3 from' [0.05 0 1] 'point3 to' [0 0 0]\n";
    for (material, shines) in [
        ("'metal' 'float roughness' 0", true),
        ("'plastic' 'rgb Kd' [0 0 0] 'float roughness' 0", true),
        ("'metal' 'float roughness' 0 'bool remaproughness' false", false),
        ("'glass' 'float uroughness' 0 'float vroughness' 0", false),
    ] {
        let seen = Folder::new().see(&format!("{sun}Material {material}\n{SQUARE}"))[1];
        assert_eq!(seen > 0.01, shines, "{material}: {seen}");
    }
}

/// A colour of opacity counts as its mean, which is said.
#[test]
fn coloured_opacity_is_warned_of() {
    for (colour, warnings) in [("0.5 0.5 0.5", 0), ("0.9 0.5 0.1", 1)] {
        let world = format!("Material 'uber' 'rgb opacity' [{colour}]\n{SQUARE}{SKY}");
        let loaded = Folder::new().world(&world).unwrap();
        assert_eq!(loaded.warnings.len(), warnings, "{:?}", loaded.warnings);
    }
}

#[test]
fn lights_have_the_units_of_pbrt() {
    let folder = Folder::new();
    let floor = format!("Material 'diffuse' 'rgb reflectance' [0.8 0.8 0.8] Scale 100 100 1 {SQUARE}");
    for (light, irradiance) in [
        ("LightSource 'point' 'rgb I' [4 8 0] 'point3 from' [0 0 2]", [1.0, 2.0, 0.0]),
        ("LightSource 'point' 'rgb I' [1 1 1] 'float scale' 4 'point3 from' [0 0 2]", [1.0; 3]),
        ("LightSource 'distant' 'rgb L' [5 0 0] 'point3 from' [0 -3 4] 'point3 to' [0 0 0]", [4.0, 0.0, 0.0]),
        ("LightSource 'spot' 'rgb I' [4 4 4] 'point3 from' [0 0 2] 'point3 to' [0 0 0]", [1.0; 3]),
        // Halfway between 25° and 30° by the cosine, 27.6046°
        ("LightSource 'spot' 'rgb I' [4 4 4] 'point3 from' [0 0 2] 'point3 to' [1.045778 0 0]", [0.5; 3]),
    ] {
        let want = irradiance.map(|e| e * 0.8 / PI);
        close(folder.see(&format!("{light}\n{floor}")), want, 1e-3, light);
    }
    // A black body has a luminance of 1 in pbrt 4
    let lamp = format!("AreaLightSource 'diffuse' 'blackbody L' 3000 'float scale' 2 {SQUARE}");
    let [r, g, b] = folder.see(&lamp);
    assert!((0.2126 * r + 0.7152 * g + 0.0722 * b - 2.0).abs() < 1e-3 && r > g && g > b, "{r} {g} {b}");
    // The film's exposure counts for all
    let text = format!(
        "{PINHOLE}Film 'rgb' 'float iso' 200 'integer xresolution' 4 'integer yresolution' 3 WorldBegin {LIGHT}{SQUARE}"
    );
    let loaded = folder.load_with(&text, &LoadOptions::default()).unwrap();
    assert_eq!(loaded.size, Some((4, 3)));
    close(seen(loaded), [2.0, 4.0, 6.0], 1e-3, "iso");
}

#[test]
fn objects_are_where_their_instances_are() {
    let folder = Folder::new();
    let object = format!("ObjectBegin 'o' {LIGHT}{SQUARE} ObjectEnd\n");
    close(folder.see(&object), [0.0; 3], 1e-4, "object alone");
    close(folder.see(&format!("{object}ObjectInstance 'o'")), [1.0, 2.0, 3.0], 1e-4, "instance");
    let aside = format!("{object}AttributeBegin Translate 5 0 0 ObjectInstance 'o' AttributeEnd");
    close(folder.see(&aside), [0.0; 3], 1e-4, "aside");
}

/// Instances share their object but for its lamps, and a sphere stays one, round or not.
#[test]
fn instances_share_their_object() {
    let folder = Folder::new();
    let object = "ObjectBegin 'o' Shape 'sphere' Shape 'cylinder' AttributeBegin Translate 0 3 0 \
        AreaLightSource 'diffuse' 'rgb L' [1 2 3] Shape 'sphere' AttributeEnd ObjectEnd\n";
    // An object that is never shown is not in the scene
    assert_eq!(folder.world(object).unwrap().scene.surfaces(), 0);
    let scene = folder.world(&format!("{object}{}", "ObjectInstance 'o'\n".repeat(4000))).unwrap().scene;
    assert_eq!((scene.surfaces(), scene.instances(), scene.lights()), (1 + 256 + 4000, 4000, 4000));
    // Bytes: the object's 257 surfaces, and a lamp and a matrix for each instance
    assert!(scene.geometry_bytes() < 257 * 150 + 4000 * 1000, "{}", scene.geometry_bytes());

    // The lamp shines where the instance is, stretched or not; only then it is triangles
    let seen = |scale: &str| format!("{object}Scale {scale} Translate 0 -3 0 ObjectInstance 'o'");
    close(folder.see(&seen("1 1 1")), [1.0, 2.0, 3.0], 1e-4, "round");
    close(folder.see(&seen("0.5 1 2")), [1.0, 2.0, 3.0], 1e-4, "stretched");
    let many = format!("{object}Scale 1 1 2{}", " ObjectInstance 'o'".repeat(600));
    fails(folder.world(&many), "surfaces so far, more than 2");

    let flat =
        format!("{object}AttributeBegin Scale 1 0 1 ObjectInstance 'o' AttributeEnd ObjectInstance 'o'");
    let loaded = folder.world(&flat).unwrap();
    assert_eq!(loaded.scene.instances(), 1);
    assert_warns(&loaded, &["an instance is left out: its transform is singular"]);
}

/// Files that the scene names: includes, gzipped meshes.
#[test]
fn other_files_are_read() {
    use std::io::Write;
    let ply = ply("", &["-9 -9 0", "9 -9 0", "0 9 0"], &["3 0 1 2"]);
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gz.write_all(ply.as_bytes()).unwrap();
    let folder = Folder::new()
        .with("a.ply.gz", gz.finish().unwrap())
        .with("lamp.pbrt", format!("{LIGHT}Shape 'plymesh' 'string filename' 'a.ply.gz'"))
        .with("round.pbrt", "Include 'round.pbrt'");
    close(folder.see("Include 'lamp.pbrt'"), [1.0, 2.0, 3.0], 1e-4, "include");
    fails(folder.world("Include 'round.pbrt'"), "65 levels of included files, more than 64");
}

/// A map of the surroundings, in both layouts: the top row is +z, and the first column of pbrt 3 begins at
/// +x.
#[test]
fn maps_lie_as_in_pbrt() {
    let columns: Vec<[f32; 3]> = (0..8 * 4).map(|i| [(i % 8) as f32, (i / 8) as f32, 1.0]).collect();
    let folder = Folder::new().with_exr("sky.exr", 8, &columns);
    let sky = |more: &str| format!("{more} LightSource 'infinite' 'string filename' 'sky.exr'");
    // The camera looks along −z: the bottom row
    let down = folder.see(&sky(""));
    assert!((down[1] - 3.0).abs() < 0.3, "{down:?}");
    // Turned so that −z sees what was along +x, where the first column meets the last: their mean
    let aside = folder.see(&sky("Rotate 90 0 1 0"));
    assert!((aside[0] - 3.5).abs() < 0.2 && (aside[1] - 1.5).abs() < 0.1, "{aside:?}");
    // And along +y, a quarter of the way round
    let quarter = folder.see(&sky("Rotate -90 1 0 0"));
    assert!((quarter[0] - 1.5).abs() < 0.2 && (quarter[1] - 1.5).abs() < 0.1, "{quarter:?}");
}

/// A part of the picture shows what the whole shows there: a ball right of the middle.
#[test]
fn windows_are_parts_of_the_picture() {
    let folder = Folder::new();
    let picture = |film: &str| {
        let text = format!(
            "LookAt 0 0 5 0 0 0 0 1 0 Camera 'perspective' 'float fov' 40
            Film 'image' 'integer xresolution' 40 'integer yresolution' 30 {film} WorldBegin
            AreaLightSource 'diffuse' Translate -0.9 0.5 0 Shape 'sphere' 'float radius' 0.4"
        );
        folder.load_with(&text, &LoadOptions::default()).unwrap()
    };
    let lit = |film: &str| {
        let loaded = picture(film);
        let (width, height) = loaded.size.unwrap();
        let mean = render(loaded, [width, height], 64, RenderOptions::default());
        (width, height, mean.iter().map(|p| p[0]).collect::<Vec<f32>>())
    };
    let (_, _, whole) = lit("");
    assert!(whole.iter().any(|p| *p > 0.9));
    for film in ["'float cropwindow' [0.5 0.9 0.1 0.6]", "'integer pixelbounds' [20 36 3 18]"] {
        let (width, height, part) = lit(film);
        assert_eq!((width, height), (16, 15), "{film}");
        for (i, p) in part.iter().enumerate() {
            let q = whole[(3 + i / 16) * 40 + 20 + i % 16];
            // At the rim by the shares of 64 samples: five standard deviations
            assert!((p - q).abs() < 5.0 * (2.0 * 0.25 / 64f32).sqrt(), "{film} {i}: {p} {q}");
        }
    }
}

/// A surface of nothing shines before what lies behind it, and hides nothing.
#[test]
fn lamps_of_nothing_shine() {
    let folder = Folder::new();
    let lamp = "AttributeBegin AreaLightSource 'diffuse' 'rgb L' [0.5 0.25 0] Material 'interface'
        Shape 'disk' 'float radius' 1 AttributeEnd LightSource 'infinite' 'rgb L' [1 1 1]";
    close(folder.see(lamp), [1.5, 1.25, 1.0], 1e-4, lamp);
}

/// The metal of `disney` and its roughness by a picture: a lobe that is narrow on the left and wide on the
/// right.
#[test]
fn roughness_may_be_a_picture() {
    let folder = Folder::new().with_png("r.png", 2, &[[26, 26, 26, 255], [204, 204, 204, 255]]);
    let map = "Texture 'r' 'float' 'imagemap' 'string filename' 'r.png' 'string filter' 'point'
        'string encoding' 'linear'";
    let sun = "LightSource 'distant' 'point3 from' [0 0.4 1] 'point3 to' [0 0 0] 'rgb L' [1 1 1]";
    for kind in [
        "'conductor' 'rgb reflectance' [1 1 1] 'bool remaproughness' false",
        "'disney' 'rgb color' [1 1 1] 'float metallic' 1",
    ] {
        let at = |x: f32, roughness: &str| {
            folder.see(&format!("{map}\n{sun}\nTranslate {x} 0 0 Material {kind} {roughness} {MAPPED}"))[0]
        };
        for (x, value) in [(0.5, 26.0 / 255.0), (-0.5, 204.0 / 255.0)] {
            let plain = at(x, &format!("'float roughness' {value}"));
            let mapped = at(x, "'texture roughness' 'r'");
            assert!((mapped / plain - 1.0).abs() < 1e-4, "{kind} {x}: {mapped} {plain}");
        }
        assert!((at(0.5, "'texture roughness' 'r'") / at(-0.5, "'texture roughness' 'r'") - 1.0).abs() > 0.5);
    }
}

/// Without coordinates, the corners of a triangle have (0, 0), (1, 0) and (1, 1), as in pbrt.
#[test]
fn triangles_without_coordinates_are_mapped_by_their_corners() {
    // White is left and below
    let (black, white) = ([0, 0, 0, 255], [255; 4]);
    let folder = Folder::new().with_png("a.png", 2, &[black, black, white, black]);
    let seen = |x: f32, y: f32| {
        folder.see(&format!(
            "Texture 'a' 'spectrum' 'imagemap' 'string filename' 'a.png' 'string filter' 'point'
            {SKY} Material 'matte' 'texture Kd' 'a' Translate {} {} 0
            Shape 'trianglemesh' 'point3 P' [0 0 0 4 0 0 0 4 0] 'integer indices' [0 1 2]",
            -x, -y
        ))[0]
    };
    // u = (x + y)/4 and v = y/4
    close([seen(1.0, 0.5); 3], [1.0; 3], 0.03, "below and left");
    for (x, y) in [(2.5, 0.5), (1.0, 2.2)] {
        assert!(seen(x, y) < 1e-3, "{x} {y}");
    }
}

/// pbrt 3 takes spectra as they are: XYZ is the integral of the matching functions over that of ȳ, so that a
/// flat one of 2 is XYZ (2, 2, 2). Of (1, 1, 1), Rec.709 has [1.2048 0.9483 0.9089], the sums of the rows of
/// its matrix. pbrt 4 brings it to a luminance of 1, which it nearly has.
#[test]
fn spectra_of_lights_are_those_of_their_version() {
    let folder = Folder::new().with("flat.spd", "# nm, value\r300 2\r800 2\r");
    let equal = [1.2048f32, 0.9483, 0.9089];
    let flat = "'spectrum L' [300 2 800 2]";
    let third = equal.map(|c| 2.0 * c);
    for (light, want) in [
        (flat, third),
        ("'spectrum L' 'flat.spd'", third),
        ("'xyz L' [2 2 2]", third),
        // Its ends stand for all beyond, in any order
        ("'spectrum L' [600 2 500 2]", third),
        (&format!("{flat} 'rgb scale' [0.5 1 2]"), [0.5 * third[0], third[1], 2.0 * third[2]]),
        ("'rgb L' [2 2 2]", [2.0; 3]),
    ] {
        let sky = format!("LightSource 'infinite' {light}\n");
        close(folder.see(&format!("{sky}WorldEnd")), want, 1e-3, light);
        let area = format!("AreaLightSource 'diffuse' {light}\n{SQUARE}WorldEnd");
        close(folder.see(&area), want, 1e-3, light);
        let distant = format!("LightSource 'distant' {light} 'point from' [0 0 1] 'point to' [0 0 0]");
        let reflected = want.map(|c| c * 0.5 / PI);
        close(folder.see(&format!("{distant}\n{SQUARE}WorldEnd")), reflected, 2e-3, light);
        let point = distant.replace("distant", "point").replace("L'", "I'");
        close(folder.see(&format!("{point}\n{SQUARE}WorldEnd")), reflected, 2e-3, light);
    }
    // Version 4 has no WorldEnd, but comments and names may
    let luminance = noisefloor::display::luminance(equal);
    for text in ["# WorldEnd\n", "Texture 'WorldEnd' 'float' 'constant'\n"] {
        let sky = format!("{text}LightSource 'infinite' {flat}");
        close(folder.see(&sky), equal.map(|c| c / luminance), 1e-3, text);
    }
    // So are factors: seen under a white of 1, and of version 4 under D65
    let kd = format!("{SKY}Material 'matte' 'spectrum Kd' [300 0.5 800 0.5]\n{SQUARE}");
    close(folder.see(&format!("{kd}WorldEnd")), equal.map(|c| 0.5 * c), 5e-3, "matte");
    let albedo = kd.replace("matte", "diffuse").replace("Kd", "reflectance");
    close(folder.see(&albedo), [0.5; 3], 5e-3, "diffuse");
}

/// Rec.709 of their chromaticities (CIE 15:2004) at a luminance of 1: [X Y Z] = [x/y 1 (1 − x − y)/y].
#[test]
fn illuminants_have_their_colours() {
    let folder = Folder::new();
    for (name, want) in [
        ("stdillum-A", [1.845, 0.826, 0.233]),
        ("stdillum-D50", [1.176, 0.976, 0.722]),
        ("stdillum-D65", [1.0, 1.0, 1.0]),
        ("stdillum-F1", [0.9543, 1.0193, 0.9437]),
        ("stdillum-F2", [1.3401, 0.9430, 0.5629]),
        ("stdillum-F3", [1.5764, 0.8911, 0.3809]),
        ("stdillum-F4", [1.8063, 0.8342, 0.2671]),
        ("stdillum-F5", [0.9154, 1.0362, 0.8903]),
        ("stdillum-F6", [1.3161, 0.9578, 0.4865]),
        ("stdillum-F7", [1.0003, 1.0002, 0.9974]),
        ("stdillum-F8", [1.1767, 0.9757, 0.7201]),
        ("stdillum-F9", [1.3768, 0.9314, 0.5694]),
        ("stdillum-F10", [1.1776, 0.9756, 0.7184]),
        ("stdillum-F11", [1.4121, 0.9247, 0.5316]),
        ("stdillum-F12", [1.7684, 0.8451, 0.2708]),
        ("illum-acesD60", [1.0469, 0.9946, 0.9156]),
    ] {
        let light = format!("'spectrum L' '{name}' 'float scale' 2");
        let want = want.map(|c| 2.0 * c);
        close(folder.see(&format!("LightSource 'infinite' {light}")), want, 2e-3, name);
        close(folder.see(&format!("AreaLightSource 'diffuse' {light}\n{SQUARE}")), want, 2e-3, name);
        // pbrt's own table has another D50 than the CIE
        let said = folder.world(&format!("LightSource 'infinite' {light}")).unwrap().warnings;
        assert_eq!(said.len(), usize::from(name == "stdillum-D50"), "{said:?}");
    }
    // Names that pbrt does not know, and what cannot be what it is said to be
    let light = "LightSource 'infinite' 'spectrum L'";
    let factor = "Material 'diffuse' 'spectrum reflectance'";
    for (parameter, name, want) in [
        (light, "stdillum-G", "there is no spectrum `stdillum-G`: it is none of pbrt's names"),
        (light, "illum-A", "there is no spectrum `illum-A`"),
        (light, "stdillum-acesD60", "there is no spectrum `stdillum-acesD60`"),
        (light, "metal-Ag-eta", "`metal-Ag-eta` as a light is not supported"),
        (light, "glass-BK7", "`glass-BK7` as a light is not supported"),
        (light, "nikon_d850_g", "`nikon_d850_g` as a spectrum: it is what a camera's sensor responds to"),
        (factor, "stdillum-A", "`stdillum-A` as a factor is not supported"),
        (factor, "glass-SF10", "there is no spectrum `glass-SF10`"),
        (factor, "metal-Hg-eta", "there is no spectrum `metal-Hg-eta`"),
        (factor, "metal-Cu-n", "there is no spectrum `metal-Cu-n`"),
    ] {
        fails(folder.world(&format!("{parameter} '{name}' Shape 'sphere'")), want);
    }
}

/// Seen along the normal in a white sky. What the metals' spectra reflect, and the indices of the glasses at 587.6 nm,
/// were computed from the tables of pbrt-v4 5f7a606 with numpy: ∫F(λ)·D65(λ)·x̄(λ), in Rec.709 over that of F = 1; what
/// is above 1, as gold's red is, no three numbers show.
#[test]
fn metals_and_glasses_are_those_that_pbrt_names() {
    let folder = Folder::new();
    for (name, want) in [
        ("Ag", [0.9715, 0.9599, 0.9153]),
        ("Al", [0.9132, 0.9215, 0.9245]),
        ("Au", [1.0, 0.7825, 0.3434]),
        ("Cu", [0.9553, 0.6376, 0.5382]),
        ("CuZn", [0.9096, 0.7783, 0.4228]),
        ("MgO", [0.0720, 0.0731, 0.0749]),
        ("TiO2", [0.2322, 0.2446, 0.2727]),
    ] {
        let material = format!("'conductor' 'spectrum eta' 'metal-{name}-eta' 'spectrum k' 'metal-{name}-k'");
        let seen = folder.see(&format!("{SKY}Material {material}\n{SQUARE}"));
        let off = seen.iter().zip(want).map(|(seen, want)| (seen - want).abs()).fold(0.0, f32::max);
        assert!(off < 0.03, "{name}: {seen:?}, want {want:?}");
    }
    for (name, index) in [
        ("BK7", 1.5168f32),
        ("BAF10", 1.6700),
        ("FK51A", 1.4866),
        ("LASF9", 1.8503),
        ("F5", 1.6727),
        ("F10", 1.7283),
        ("F11", 1.7847),
    ] {
        // A boundary reflects F of the sky, and lets through the rest over η²
        let reflected = ((index - 1.0) / (index + 1.0)).powi(2);
        let want = reflected + (1.0 - reflected) / (index * index);
        let material = format!("Material 'dielectric' 'spectrum eta' 'glass-{name}'");
        close(folder.see(&format!("{SKY}{material}\n{SQUARE}")), [want; 3], 1e-3, name);
    }
}

/// Every sample is scaled down to its largest component.
#[test]
fn samples_are_bounded_as_the_film_says() {
    let film = "Film 'rgb' 'float maxcomponentvalue' 2\n";
    let light = "AreaLightSource 'diffuse' 'rgb L' [8 1 1]\n";
    let text = |film: &str| format!("{PINHOLE}{film}WorldBegin {light}{SQUARE}");
    let load = |film: &str| Folder::new().load_with(&text(film), &LoadOptions::default());
    let loaded = load(film).unwrap();
    assert_eq!((loaded.clamp, loaded.warnings.len()), (Some(2.0), 1));
    close(seen(loaded), [2.0, 0.25, 0.25], 1e-4, film);
    close(seen(load("").unwrap()), [8.0, 1.0, 1.0], 1e-4, "no film");
    fails(load("Film 'rgb' 'float maxcomponentvalue' 0\n"), "`maxcomponentvalue` must be above 0");
}

/// Files as old programs, Windows and clones write them.
#[test]
fn files_are_read_in_any_text_or_named() {
    let world = format!("# a lamp\n{LIGHT}# its shape\n{SQUARE}");
    let folder = Folder::new();
    close(folder.see(&world.replace('\n', "\r")), [1.0, 2.0, 3.0], 1e-4, "CR");
    close(folder.see(&world.replace('\n', "\r\n")), [1.0, 2.0, 3.0], 1e-4, "CRLF");
    let wide: Vec<u8> =
        "\u{feff}".encode_utf16().chain(world.encode_utf16()).flat_map(u16::to_be_bytes).collect();
    let folder = Folder::new()
        .with("wide.pbrt", wide)
        .with("latin.pbrt", [b"# caf\xe9\n".as_slice(), world.as_bytes()].concat())
        .with("pointer.pbrt", "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
        .with(
            "points.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
            property float z\nend_header\n0 0 0\n",
        );
    for name in ["wide", "latin"] {
        close(folder.see(&format!("Include '{name}.pbrt'")), [1.0, 2.0, 3.0], 1e-4, name);
    }
    for (world, want) in [
        ("Include 'pointer.pbrt'", "pointer.pbrt: this is a Git LFS pointer"),
        ("Shape 'plymesh' 'string filename' 'points.ply'", "points.ply: the PLY file has no faces"),
    ] {
        let error = folder.world(world).unwrap_err();
        assert!(error.contains(want), "{world}: {error}");
    }
}

/// What [`SQUARE`] is of, with an albedo of ½.
const GREY: &str = "Material 'diffuse' 'rgb reflectance' [.5 .5 .5]\n";

/// The formulas of pbrt-v4's lights.cpp (k_e and E_v of each `Create`): light of luminance 1 times what is asked for.
#[test]
fn lights_have_the_power_that_is_asked_for() {
    let folder = Folder::new();
    let diffuse = |irradiance: f32| 0.5 / PI * irradiance;
    let [inner, outer] = [25f32, 30.0].map(|angle| angle.to_radians().cos());
    let cone = 2.0 * PI * ((1.0 - inner) + (inner - outer) / 2.0);
    for (light, end, want) in [
        ("'distant' 'float illuminance' 2", "", diffuse(2.0)),
        ("'distant' 'float illuminance' 2 'float scale' 3", "", diffuse(6.0)),
        ("'distant' 'float illuminance' -1", "", diffuse(1.0)),
        ("'point' 'float power' 100", "", diffuse(100.0 / (4.0 * PI))),
        ("'spot' 'float power' 100", "", diffuse(100.0 / cone)),
        ("'infinite' 'float illuminance' 3", "", diffuse(3.0)),
        // Version 3 knows neither
        ("'point' 'float power' 100", "WorldEnd", diffuse(1.0)),
    ] {
        let above = "'point3 from' [0 0 1] 'point3 to' [0 0 0]";
        let got = folder.see(&format!("LightSource {light} {above}\n{GREY}{SQUARE}{end}"));
        close(got, [want; 3], 0.02, light);
    }

    // Shapes that shine: π times area times radiance
    let patch = "Shape 'bilinearmesh' 'point3 P' [-1 -1 0 1 -1 0 -1 1 0 1 1 0]";
    for (shape, sides, area) in [
        (SQUARE, 1.0, 4.0),
        (SQUARE, 2.0, 4.0),
        (patch, 1.0, 4.0),
        ("Scale 2 2 2 Shape 'disk' 'float radius' 1", 1.0, 4.0 * PI),
        ("Shape 'sphere' 'float radius' 2", 1.0, 16.0 * PI),
        ("Scale 2 2 2 Shape 'sphere'", 1.0, 16.0 * PI),
    ] {
        let light = format!("AreaLightSource 'diffuse' 'float power' 10 'bool twosided' {}\n", sides > 1.0);
        let loaded = folder.world(&format!("{light}{shape}")).unwrap();
        let said = loaded.warnings.iter().any(|w| w.what.contains("where pbrt gives it to each"));
        assert_eq!(said, shape == SQUARE, "{shape}: {:?}", loaded.warnings);
        close(seen(loaded), [10.0 / (PI * area * sides); 3], 0.01, shape);
    }
}

/// Light that is a picture on a shape: its codes are sRGB, its first row is at v = 1, and its mean has the power.
#[test]
fn area_lights_show_pictures() {
    let folder = Folder::new().with_png("a.png", 1, &[[255; 4], [188, 0, 0, 255]]);
    let red = ((188.0f32 / 255.0 + 0.055) / 1.055).powf(2.4);
    // The camera looks at the middle: the upper half of the picture above it, and the lower below
    let at = |y: f32, more: &str| {
        let light = format!("AreaLightSource 'diffuse' 'string filename' 'a.png' {more}\n");
        folder.see(&format!("{light}Translate 0 {y} 0 {MAPPED}"))
    };
    close(at(-0.5, ""), [1.0; 3], 1e-3, "top");
    close(at(0.5, ""), [red, 0.0, 0.0], 1e-3, "bottom");
    close(at(-0.5, "'float scale' 5"), [5.0; 3], 1e-3, "scaled");
    let mean = (1.0 + 0.2126 * red) / 2.0;
    close(at(-0.5, "'float power' 10"), [10.0 / (PI * 4.0 * mean); 3], 2e-3, "power");
}

/// A map has the illuminance that pbrt gives it, which takes 2π for the sphere of 4π.
#[test]
fn maps_have_the_illuminance_that_is_asked_for() {
    let folder = Folder::new().with_exr("sky.exr", 64, &[[3.0; 3]; 64 * 64]);
    let world =
        format!("LightSource 'infinite' 'string filename' 'sky.exr' 'float illuminance' 7\n{GREY}{SQUARE}");
    // A sky of 1 makes ½ there: the cosine over half of the pixels has the mean ½
    close(folder.see(&world), [7.0 / (2.0 * PI * 0.25) * 0.5; 3], 0.02, "map");
}

/// `ColorSpace` says what the numbers of colours are, of lights and of surfaces, in its block.
#[test]
fn colours_are_of_their_space() {
    let folder = Folder::new();
    // ITU-R BT.2087, table 2
    let mixed = [0.5183, 0.5022, 0.2206];
    let light = "AreaLightSource 'diffuse' 'rgb L' [.5 .5 .25]\n";
    close(folder.see(&format!("ColorSpace 'rec2020' {light}{SQUARE}")), mixed, 2e-3, "light");
    close(
        folder.see(&format!("AttributeBegin ColorSpace 'rec2020' AttributeEnd {light}{SQUARE}")),
        [0.5, 0.5, 0.25],
        1e-3,
        "outside",
    );
    let surface = "ColorSpace 'rec2020' Material 'diffuse' 'rgb reflectance' [.5 .5 .25]\n";
    close(folder.see(&format!("{SKY}{surface}{SQUARE}")), mixed, 2e-3, "surface");
}

/// Half of the picture is seen by each square: pbrt's own values (textures.cpp 219-265, 542-551, 927-933).
#[test]
fn textures_are_made_of_their_operands() {
    let folder = Folder::new();
    // A sky of 1 on what covers the picture; squares of 1/8 of it
    let mapped = SQUARE.replace("'point3 P'", "'point2 uv' [0 0 8 0 8 8 0 8] 'point3 P'");
    let seen = |before: &str, texture: &str| {
        let text = format!(
            "LookAt 0 0 5 0 0 0 0 1 0 Camera 'orthographic' 'float screenwindow' [-1 1 -1 1]
            Film 'rgb' 'integer xresolution' 8 'integer yresolution' 8 WorldBegin {SKY}{before}
            Texture 't' 'spectrum' {texture} Material 'diffuse' 'texture reflectance' 't' {mapped}"
        );
        let loaded =
            folder.load_with(&text, &LoadOptions::default()).unwrap_or_else(|e| panic!("{texture}: {e}"));
        let warnings = loaded.warnings.len();
        let pixels = look(loaded, 8);
        let mean: [f32; 3] = std::array::from_fn(|c| pixels.iter().map(|p| p[c]).sum::<f32>() / 64.0);
        (mean, warnings)
    };
    let share = "Texture 'a' 'float' 'constant' 'float value' .25\n";
    let four = "Texture 'f' 'float' 'constant' 'float value' 4\n";
    let two = "Texture 'a' 'spectrum' 'checkerboard' 'rgb tex1' [.8 .8 .8]\n";
    let bright = &format!("{two}Texture 'b' 'spectrum' 'scale' 'texture tex' 'a' 'float scale' 4\n");
    let colours = &format!(
        "{share}Texture 'a' 'spectrum' 'constant' 'rgb value' [.9 .9 .9]
        Texture 'c' 'spectrum' 'constant' 'rgb value' [.8 .8 .8]\n"
    );
    for (before, texture, want) in [
        ("", "'checkerboard'", [0.5; 3]),
        ("", "'checkerboard' 'rgb tex1' [.4 .4 .4]", [0.2; 3]),
        ("", "'checkerboard' 'rgb tex2' [.4 .4 .4]", [0.7; 3]),
        ("", "'mix' 'rgb tex2' [.4 .4 .4]", [0.2; 3]),
        ("", "'mix' 'rgb tex1' [.4 .4 .4]", [0.7; 3]),
        (share, "'mix' 'texture amount' 'a' 'rgb tex1' [1 0 0] 'rgb tex2' [0 1 0]", [0.75, 0.25, 0.0]),
        // By a picture: half of the squares are of one, half of the other
        (
            "Texture 'a' 'float' 'checkerboard'\n",
            "'mix' 'texture amount' 'a' 'rgb tex1' [1 0 0] 'rgb tex2' [0 .5 0]",
            [0.5, 0.25, 0.0],
        ),
        // The factor is a float texture, also where a colour is called so
        (colours, "'scale' 'texture tex' 'c' 'texture scale' 'a'", [0.2; 3]),
        ("", "'scale' 'float scale' .3", [0.3; 3]),
        // Values above 1 are cut off where they reflect, not before
        (four, "'scale' 'rgb tex' [.2 .1 .5] 'texture scale' 'f'", [0.8, 0.4, 1.0]),
        (bright, "'scale' 'texture tex' 'b' 'float scale' .25", [0.4; 3]),
        (two, "'scale' 'texture tex' 'a' 'float scale' 4", [0.5; 3]),
    ] {
        let (got, warnings) = seen(before, texture);
        close(got, want, 1e-3, texture);
        assert_eq!(warnings, 0, "{texture}");
    }
    fails(
        folder.world("Texture 't' 'number' 'constant'"),
        "line 3: a texture is of `float` or `spectrum`, not of `number`",
    );
    // Cut-outs: a float checkerboard lets half of the sky pass before a black square
    let text = format!(
        "{SKY}Texture 't' 'float' 'checkerboard' Material 'diffuse' 'rgb reflectance' [0 0 0] {}",
        SQUARE.replace(
            "'point3 P'",
            "'texture alpha' 't' 'point2 uv' [.5 .5 2.5 .5 2.5 2.5 .5 2.5] 'point3 P'"
        )
    );
    // The middle is at (1.5, 1.5), in a square like that at (0.5, 0.5), which is of tex1
    close(folder.see(&text), [0.0; 3], 1e-3, "a square of tex1");
    close(
        folder.see(&text.replace("[.5 .5 2.5 .5 2.5 2.5 .5 2.5]", "[1.5 .5 3.5 .5 3.5 2.5 1.5 2.5]")),
        [1.0; 3],
        1e-3,
        "of tex2",
    );
}

/// `Attribute` gives parameters to all that come (scene.cpp 185-200 and 247-734 of pbrt-v4), which their own outdo.
#[test]
fn attributes_are_for_all_that_comes() {
    let folder = Folder::new().with_png("w.png", 1, &[[255; 4]]);
    let grey = "Attribute 'material' 'rgb reflectance' [.2 .2 .2]\n";
    for (world, want) in [
        (format!("{SKY}{grey}Material 'diffuse' {SQUARE}"), 0.2),
        (format!("{SKY}{grey}Material 'diffuse' 'rgb reflectance' [.3 .3 .3] {SQUARE}"), 0.3),
        (format!("{SKY}AttributeBegin {grey}AttributeEnd Material 'diffuse' {SQUARE}"), 0.5),
        (format!("{SKY}{grey}MakeNamedMaterial 'm' 'string type' 'diffuse' NamedMaterial 'm' {SQUARE}"), 0.2),
        (
            format!(
                "{SKY}Texture 'c' 'spectrum' 'constant' 'rgb value' [.2 .2 .2]
                Attribute 'material' 'texture reflectance' 'c' Material 'diffuse' {SQUARE}"
            ),
            0.2,
        ),
        (
            format!("Attribute 'light' 'float scale' [.25] AreaLightSource 'diffuse' 'rgb L' [2 2 2] {SQUARE}"),
            0.5,
        ),
        ("Attribute 'light' 'float scale' [.25] LightSource 'infinite' 'rgb L' [2 2 2]".to_owned(), 0.5),
        (
            format!(
                "{SKY}Attribute 'texture' 'float scale' [.5] Texture 't' 'spectrum' 'imagemap' 'string filename' 'w.png'
                Material 'diffuse' 'texture reflectance' 't' {SQUARE}"
            ),
            0.5,
        ),
        (format!("{SKY}Attribute 'shape' 'float alpha' 0 Material 'diffuse' {SQUARE}"), 1.0),
    ] {
        let loaded = folder.world(&world).unwrap_or_else(|e| panic!("{world}: {e}"));
        assert_eq!(loaded.warnings, [], "{world}");
        close(seen(loaded), [want; 3], 2e-3, &world);
    }
    fails(
        folder.world("Attribute 'materials' 'rgb reflectance' [.2 .2 .2]"),
        "line 3: Attribute \"materials\": it is for shape, light, material, medium, texture",
    );
    let odd =
        folder.world(&format!("{SKY}Attribute 'material' 'float wobble' 1 Material 'diffuse' {SQUARE}"));
    assert_eq!(odd.unwrap().warnings[0].what, "`wobble` of the material `diffuse` is ignored");
}
