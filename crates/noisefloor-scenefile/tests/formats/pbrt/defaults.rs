//! What pbrt takes where a parameter is not given: pbrt-v4 5f7a606 and pbrt-v3 13d871f, the `Create` of each thing.

use crate::util::{Folder, render};
use noisefloor::Rgb;
use noisefloor_ptwne::RenderOptions;
use noisefloor_scenefile::LoadOptions;

/// A view of the origin from aside, and lights from there and from all around.
const VIEW: &str = "LookAt 2 3 4  0 0 0  0 0 1 Camera 'perspective' 'float fov' 40\n";
const LIT: &str = "LightSource 'distant' 'point3 from' [1 3 2] 'point3 to' [0 0 0] 'rgb L' [3 2 1]\n\
    LightSource 'infinite' 'rgb L' [.3 .4 .5]\n";
const BALL: &str = "Shape 'sphere'\n";
/// A square from −1 to 1 whose front is +z, with texture coordinates from 0 to 2.
const SQUARE: &str = "Shape 'trianglemesh' 'integer indices' [0 1 2 0 2 3] \
    'point3 P' [-1 -1 0 1 -1 0 1 1 0 -1 1 0] 'point2 uv' [0 0 2 0 2 2 0 2]\n";

/// What a directive with `{}` shows, before and after it other ones.
fn sketch(folder: &Folder, text: &str) -> (Vec<Rgb>, Option<(usize, usize)>, Option<u32>) {
    let loaded = folder.load_with(text, &LoadOptions::default()).unwrap_or_else(|e| panic!("{text}: {e}"));
    let (size, max_depth) = (loaded.size, loaded.max_depth);
    let options = RenderOptions { clamp: loaded.clamp, max_depth: 4, ..RenderOptions::default() };
    (render(loaded, [12; 2], 16, options), size, max_depth)
}

/// In `text`, a parameter in place of `{}` that has its default changes nothing, and one that has another value does:
/// else the row would show nothing.
fn check(folder: &Folder, text: &str, parameter: &str, default: &str, other: &str) {
    let seen = |given: &str| sketch(folder, &text.replace("{}", given));
    let [default, other] = [default, other].map(|value| format!("'{parameter}' [{value}]"));
    let absent = seen("");
    assert!(absent == seen(&default), "{default} is not what is taken in {text}");
    assert!(absent != seen(&other), "{other} changes nothing in {text}");
}

/// Parameters of shapes, with their defaults and other values.
#[test]
fn shapes_have_the_defaults_of_pbrt() {
    let folder = Folder::new();
    let mesh = "'loopsubdiv' 'point3 P' [-1 -1 0 1 -1 0 1 1 1 -1 1 0] 'integer indices' [0 1 2 0 2 3]";
    for (shape, parameter, default, other) in [
        ("'sphere'", "float radius", "1", ".7"),
        ("'sphere'", "float zmin", "-1", "-.3"),
        ("'sphere'", "float zmax", "1", ".3"),
        ("'sphere'", "float phimax", "360", "200"),
        ("'sphere'", "float alpha", "1", ".5"),
        ("'cylinder'", "float radius", "1", ".7"),
        ("'cylinder'", "float zmin", "-1", "-.3"),
        ("'cylinder'", "float zmax", "1", ".3"),
        ("'cylinder'", "float phimax", "360", "200"),
        ("'disk'", "float height", "0", ".3"),
        ("'disk'", "float radius", "1", ".7"),
        ("'disk'", "float innerradius", "0", ".3"),
        ("'disk'", "float phimax", "360", "200"),
        ("'cone'", "float radius", "1", ".7"),
        ("'cone'", "float height", "1", ".3"),
        ("'cone'", "float phimax", "360", "200"),
        ("'paraboloid'", "float radius", "1", ".7"),
        ("'paraboloid'", "float zmin", "0", ".3"),
        ("'paraboloid'", "float zmax", "1", ".6"),
        ("'paraboloid'", "float phimax", "360", "200"),
        ("'hyperboloid'", "point p1", "0 0 0", ".5 0 0"),
        ("'hyperboloid'", "point p2", "1 1 1", "1 1 .5"),
        ("'hyperboloid'", "float phimax", "360", "200"),
        (mesh, "integer levels", "3", "1"),
        (mesh, "integer nlevels", "3", "1"),
        ("'trianglemesh' 'point3 P' [-1 -1 0 1 -1 0 1 1 1]", "integer indices", "0 1 2", "0 1 1"),
        ("'bilinearmesh' 'point3 P' [-1 -1 0 1 -1 0 -1 1 0 1 1 0]", "integer indices", "0 1 2 3", "0 1 2 1"),
    ] {
        let text = format!("{VIEW}WorldBegin {LIT}Shape {shape} {{}}");
        check(&folder, &text, parameter, default, other);
    }
}

/// Parameters of materials.
#[test]
fn materials_have_the_defaults_of_pbrt() {
    let folder = Folder::new();
    // Of each kind, with what is needed for parameters to matter
    for (material, parameter, default, other) in [
        ("'diffuse'", "rgb reflectance", ".5 .5 .5", ".5 .2 .5"),
        ("'matte'", "rgb Kd", ".5 .5 .5", ".5 .2 .5"),
        ("'matte'", "float sigma", "0", "30"),
        ("'coateddiffuse'", "rgb reflectance", ".5 .5 .5", ".5 .2 .5"),
        ("'coateddiffuse'", "float roughness", "0", ".3"),
        ("'coateddiffuse'", "float eta", "1.5", "1.2"),
        ("'plastic'", "rgb Kd", ".25 .25 .25", ".5 .2 .5"),
        ("'plastic'", "rgb Ks", ".25 .25 .25", ".5 .2 .5"),
        ("'plastic'", "float roughness", ".1", ".3"),
        ("'plastic'", "bool remaproughness", "true", "false"),
        ("'uber'", "rgb Kd", ".25 .25 .25", ".5 .2 .5"),
        ("'uber'", "rgb Ks", ".25 .25 .25", ".5 .2 .5"),
        ("'uber'", "rgb Kr", "0 0 0", ".5 .2 .5"),
        ("'uber'", "rgb opacity", "1 1 1", ".5 .5 .5"),
        ("'uber'", "float roughness", ".1", ".3"),
        ("'uber'", "float index", "1.5", "1.2"),
        ("'substrate'", "rgb Kd", ".5 .5 .5", ".5 .2 .5"),
        ("'substrate'", "rgb Ks", ".5 .5 .5", ".5 .2 .5"),
        ("'substrate'", "float uroughness", ".1", ".3"),
        ("'substrate'", "float vroughness", ".1", ".3"),
        ("'translucent'", "rgb Kd", ".25 .25 .25", ".5 .2 .5"),
        ("'translucent'", "rgb Ks", ".25 .25 .25", ".5 .2 .5"),
        ("'translucent'", "rgb reflect", ".5 .5 .5", ".5 .2 .5"),
        ("'translucent'", "rgb transmit", ".5 .5 .5", ".5 .2 .5"),
        ("'translucent'", "float roughness", ".1", ".3"),
        ("'metal'", "float roughness", ".01", ".3"),
        ("'metal'", "bool remaproughness", "true", "false"),
        ("'mirror'", "rgb Kr", ".9 .9 .9", ".5 .2 .5"),
        ("'glass'", "rgb Kt", "1 1 1", ".5 .2 .5"),
        ("'glass'", "float index", "1.5", "1.2"),
        ("'glass'", "float eta", "1.5", "1.2"),
        ("'glass'", "float uroughness", "0", ".3"),
        ("'dielectric'", "float eta", "1.5", "1.2"),
        ("'dielectric'", "float roughness", "0", ".3"),
        ("'thindielectric'", "float eta", "1.5", "1.2"),
        ("'conductor'", "spectrum eta", "'metal-Cu-eta'", "'metal-Au-eta'"),
        ("'conductor'", "spectrum k", "'metal-Cu-k'", "'metal-Au-k'"),
        ("'conductor'", "float roughness", "0", ".3"),
        ("'conductor' 'float roughness' .3 'float vroughness' 1", "bool remaproughness", "true", "false"),
        ("'coatedconductor'", "spectrum conductor.eta", "'metal-Cu-eta'", "'metal-Au-eta'"),
        ("'coatedconductor'", "spectrum conductor.k", "'metal-Cu-k'", "'metal-Au-k'"),
        ("'coatedconductor'", "float conductor.roughness", "0", ".3"),
        ("'diffusetransmission'", "rgb reflectance", ".25 .25 .25", ".5 .2 .5"),
        ("'diffusetransmission'", "rgb transmittance", ".25 .25 .25", ".5 .2 .5"),
        ("'diffusetransmission'", "float scale", "1", ".5"),
        ("'subsurface'", "float eta", "1.33", "1.5"),
        ("'subsurface'", "float roughness", "0", ".3"),
        ("'kdsubsurface'", "rgb Kd", ".5 .5 .5", ".5 .2 .5"),
        ("'kdsubsurface'", "float eta", "1.33", "1.5"),
        ("'disney'", "rgb color", ".5 .5 .5", ".5 .2 .5"),
        ("'disney'", "float metallic", "0", ".5"),
        ("'disney'", "float eta", "1.5", "1.2"),
        ("'disney'", "float roughness", ".5", ".3"),
        ("'disney'", "float anisotropic", "0", ".5"),
        ("'disney' 'rgb color' [.5 .2 .5] 'float sheen' 1", "float sheentint", ".5", "0"),
        ("'disney' 'rgb color' [.5 .2 .5] 'float metallic' .1", "float speculartint", "0", "1"),
        ("'disney'", "float sheen", "0", "1"),
        ("'disney'", "float clearcoat", "0", "1"),
        ("'disney' 'float clearcoat' 1", "float clearcoatgloss", "1", "0"),
        ("'disney'", "float spectrans", "0", "1"),
    ] {
        let text = format!("{VIEW}WorldBegin {LIT}Material {material} {{}}\n{BALL}");
        check(&folder, &text, parameter, default, other);
    }
    let parts = "MakeNamedMaterial 'a' 'string type' 'diffuse' 'rgb reflectance' [1 0 0]\n\
        MakeNamedMaterial 'b' 'string type' 'diffuse'\n";
    for names in ["'string materials' ['a' 'b']", "'string namedmaterial1' 'a' 'string namedmaterial2' 'b'"] {
        let text = format!("{VIEW}WorldBegin {LIT}{parts}Material 'mix' {names} {{}}\n{BALL}");
        check(&folder, &text, "float amount", ".5", ".3");
    }
}

/// Parameters of textures of colours and of numbers: the latter as an opacity.
#[test]
fn textures_have_the_defaults_of_pbrt() {
    let picture = image::RgbImage::from_fn(4, 4, |x, y| image::Rgb([60 * x as u8, 60 * y as u8, 30]));
    let folder = Folder::new();
    picture.save(folder.path().join("a.png")).unwrap();
    let file = "imagemap' 'string filename' 'a.png";
    for (class, parameter, default, other) in [
        ("constant", "value", "1", ".3"),
        ("scale", "tex", "1", ".3"),
        ("scale", "scale", "1", ".3"),
        ("scale", "tex1", "1", ".3"),
        ("scale", "tex2", "1", ".3"),
        ("checkerboard", "tex1", "1", ".3"),
        ("checkerboard", "tex2", "0", ".3"),
        // No other value of these two is read as pbrt does
        ("checkerboard", "integer dimension", "2", "2] 'float udelta' [.3"),
        ("checkerboard", "string mapping", "'uv'", "'uv'] 'float udelta' [.3"),
        ("checkerboard", "float uscale", "1", ".3"),
        ("checkerboard", "float vscale", "1", ".3"),
        ("checkerboard", "float udelta", "0", ".3"),
        ("checkerboard", "float vdelta", "0", ".3"),
        ("mix", "tex1", "0", ".3"),
        ("mix", "tex2", "1", ".3"),
        ("mix", "float amount", ".5", ".3"),
        ("directionmix", "tex1", "0", ".3"),
        ("directionmix", "tex2", "1", ".3"),
        (file, "float scale", "1", ".3"),
        (file, "float scale", "1", "3"),
        (file, "bool invert", "false", "true"),
        (file, "bool gamma", "true", "false"),
        (file, "string encoding", "'sRGB'", "'linear'"),
        (file, "string wrap", "'repeat'", "'clamp'"),
        (file, "string filter", "'bilinear'", "'point'"),
        (file, "float uscale", "1", ".3"),
    ] {
        for kind in ["float", "spectrum"] {
            // An operand is of the texture's kind, but for the factor of version 4
            let own = match (kind, parameter) {
                ("spectrum", "value" | "tex" | "tex1" | "tex2") => "rgb ",
                (_, "value" | "tex" | "tex1" | "tex2" | "scale") => "float ",
                _ => "",
            };
            let of_all = |value: &str| [value; 3][..if own == "rgb " { 3 } else { 1 }].join(" ");
            let surface = match kind {
                "float" => SQUARE.replace("'integer indices'", "'texture alpha' 't' 'integer indices'"),
                _ => format!("Material 'diffuse' 'texture reflectance' 't'\n{SQUARE}"),
            };
            let text = format!("{VIEW}WorldBegin {LIT}Texture 't' '{kind}' '{class}' {{}}\n{surface}");
            let [default, other] = [default, other].map(of_all);
            check(&folder, &text, &format!("{own}{parameter}"), &default, &other);
        }
    }
}

/// Parameters of lights.
#[test]
fn lights_have_the_defaults_of_pbrt() {
    let folder = Folder::new();
    let above = "'point3 from' [0 0 2] 'point3 to' [0 0 0]";
    for (light, parameter, default, other) in [
        ("LightSource 'point' 'point3 from' [0 0 2]", "rgb I", "1 1 1", "1 2 1"),
        ("LightSource 'point' 'point3 from' [0 0 2]", "float scale", "1", "2"),
        ("LightSource 'point' 'point3 from' [0 0 2]", "float power", "-1", "2"),
        ("Translate 0 0 2 LightSource 'point'", "point3 from", "0 0 0", "0 1 0"),
        (&format!("LightSource 'distant' {above}"), "rgb L", "1 1 1", "1 2 1"),
        (&format!("LightSource 'distant' {above}"), "float scale", "1", "2"),
        (&format!("LightSource 'distant' {above}"), "float illuminance", "-1", "2"),
        ("LightSource 'distant' 'point3 to' [0 0 -1]", "point3 from", "0 0 0", "0 1 0"),
        ("Rotate 180 1 0 0 LightSource 'distant'", "point3 to", "0 0 1", "0 1 1"),
        (&format!("LightSource 'spot' {above}"), "rgb I", "1 1 1", "1 2 1"),
        (&format!("LightSource 'spot' {above}"), "float scale", "1", "2"),
        (&format!("LightSource 'spot' {above}"), "float power", "-1", "2"),
        (&format!("LightSource 'spot' {above}"), "float coneangle", "30", "20"),
        (&format!("LightSource 'spot' {above}"), "float conedeltaangle", "5", "10"),
        ("Translate 0 0 2 LightSource 'spot' 'point3 to' [0 0 -1]", "point3 from", "0 0 0", "0 1 0"),
        ("Translate 0 0 2 Rotate 180 1 0 0 LightSource 'spot'", "point3 to", "0 0 1", "0 1 1"),
        ("LightSource 'infinite'", "rgb L", "1 1 1", "1 2 1"),
        ("LightSource 'infinite'", "float scale", "1", "2"),
        ("LightSource 'infinite'", "float illuminance", "-1", "2"),
        ("AreaLightSource 'diffuse'", "rgb L", "1 1 1", "1 2 1"),
        ("AreaLightSource 'diffuse'", "float scale", "1", "2"),
        ("AreaLightSource 'diffuse'", "float power", "-1", "2"),
        ("ReverseOrientation AreaLightSource 'diffuse'", "bool twosided", "false", "true"),
    ] {
        // An area light is a square of its own above the one that is seen, which is not in its way
        let [shape, below] = if light.contains("Area") { [SQUARE, "Translate 0 0 -1"] } else { ["", ""] };
        let text =
            format!("{VIEW}WorldBegin AttributeBegin {light} {{}}\n{shape}AttributeEnd {below} {SQUARE}");
        check(&folder, &text, parameter, default, other);
    }
}

/// Parameters of how the picture is taken.
#[test]
fn cameras_and_films_have_the_defaults_of_pbrt() {
    let folder = Folder::new();
    let look_at = "LookAt 2 3 4  0 0 0  0 0 1";
    let square = "Film 'rgb' 'integer yresolution' 1280";
    for (setup, parameter, default, other) in [
        ("Camera 'perspective' {}", "float fov", "90", "40"),
        ("Camera 'perspective' {}", "float lensradius", "0", "1"),
        ("Camera 'perspective' 'float lensradius' .1 {}", "float focaldistance", "1e6", "3"),
        (&format!("{square} Camera 'perspective' {{}}"), "float screenwindow", "-1 1 -1 1", "-2 2 -2 2"),
        (&format!("{square} Camera 'orthographic' {{}}"), "float screenwindow", "-1 1 -1 1", "-2 2 -2 2"),
        ("Film 'rgb' {} Camera 'perspective'", "integer xresolution", "1280", "400"),
        ("Film 'rgb' {} Camera 'perspective'", "integer yresolution", "720", "400"),
        ("Film 'rgb' {} Camera 'perspective'", "float iso", "100", "200"),
        ("Film 'rgb' {} Camera 'perspective'", "float exposuretime", "1", "2"),
        ("Film 'image' {} Camera 'perspective'", "float scale", "1", "2"),
        ("Film 'rgb' {} Camera 'perspective'", "float cropwindow", "0 1 0 1", "0 .5 0 .5"),
        ("Film 'rgb' {} Camera 'perspective'", "float maxcomponentvalue", "1e30", ".1"),
        ("Integrator 'volpath' {} Camera 'perspective'", "integer maxdepth", "5", "3"),
        ("Integrator 'path' {} Camera 'perspective'", "integer maxdepth", "5", "3"),
    ] {
        let text = format!("{look_at} {setup} WorldBegin {LIT}{BALL}");
        check(&folder, &text, parameter, default, other);
    }
    // Without an integrator pbrt has one of five bounces
    let (_, _, depth) = sketch(&folder, &format!("{VIEW}WorldBegin {LIT}{BALL}"));
    assert_eq!(depth, Some(6));
}
