//! What surfaces look like: radiance in closed form.

use super::kit::{Maker, json, render};
use crate::util::assert_warns;
use noisefloor::Rgb;

const NEAREST: &str = r#"{"magFilter": 9728}"#;
/// All but a mirror of that colour, seen head on; facets of α = 10⁻³ and samples of the surroundings leave 2·10⁻⁴.
const POLISHED: &str = r#""metallicFactor": 1, "roughnessFactor": 0"#;

/// A rectangle that fills the image, at z = −1, in surroundings of radiance 1.
pub(crate) fn wall(material: &str) -> Maker {
    let mut maker = Maker::wall(material);
    maker.surroundings();
    maker
}

/// The wall through a field of view of half a degree: head on.
pub(crate) fn near(mut maker: Maker) -> Maker {
    maker.root["cameras"][0]["perspective"]["yfov"] = json("0.01");
    maker
}

pub(crate) fn mean(maker: &Maker, samples: u64, max_depth: u32) -> Rgb {
    let pixels = render(maker.load().unwrap(), 8, samples, max_depth);
    std::array::from_fn(|c| pixels.iter().map(|p| p[c]).sum::<f32>() / 64.0)
}

pub(crate) fn assert_close(found: Rgb, expected: Rgb, tolerance: f32) {
    let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= tolerance);
    assert!(close, "{found:?}, expected {expected:?} within {tolerance}");
}

/// sRGB decoded (IEC 61966-2-1).
pub(crate) fn linear(code: u8) -> f32 {
    ((f32::from(code) / 255.0 + 0.055) / 1.055).powf(2.4)
}

/// In surroundings of radiance 1, a lossless wall has that, too; and it is lit by them.
#[test]
fn white_walls_in_white_surroundings_cannot_be_seen() {
    let maker = wall(&format!(r#"{{"pbrMetallicRoughness": {{{POLISHED}}}}}"#));
    assert_eq!(maker.load().unwrap().warnings, []);
    // All but without noise: roulette, and light that is lost after 65 segments
    assert_close(mean(&maker, 4096, 65), [1.0; 3], 2e-3);
}

/// Head on, Schlick's metal has its base colour.
#[test]
fn colours_are_texture_times_factor() {
    let factor =
        format!(r#"{{"pbrMetallicRoughness": {{"baseColorFactor": [0.8, 0.5, 0.1, 1], {POLISHED}}}}}"#);
    assert_close(mean(&near(wall(&factor)), 16, 9), [0.8, 0.5, 0.1], 2e-4);

    let mut textured = near(wall(&factor));
    let texture = textured.texture(1, &[[188, 255, 100, 255]], "{}");
    textured.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = texture.into();
    let expected = [0.8 * linear(188), 0.5, 0.1 * linear(100)];
    assert_close(mean(&textured, 16, 9), expected, 2e-4);

    // Metal is blue and roughness green, both linear: red changes nothing. Half metal is half a metal, half a
    // polished surface of the colour: head on, that reflects ((1.5 − 1)/(1.5 + 1))² = 0.04, and nothing comes
    // from a black base. A standard error of √(0.02·0.98/64/4096) = 2.7e-4
    let black = r#"{"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0.5}}"#;
    let mut half = near(wall(black));
    let texture = half.texture(1, &[[255, 0, 255, 255]], "{}");
    half.root["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"] = texture.into();
    assert_close(mean(&half, 4096, 9), [0.02; 3], 1.4e-3);
    // The index of refraction says how much: ((2 − 1)/(2 + 1))²
    half.root["materials"][0]["extensions"] = json(r#"{"KHR_materials_ior": {"ior": 2}}"#);
    assert_close(mean(&half, 4096, 9), [0.5 / 9.0; 3], 2e-3);
    // And KHR_materials_specular: a factor on it, head on; its colour counts as grey
    let specular = r#"{"KHR_materials_specular": {"specularFactor": 0.5}, "KHR_materials_ior": {"ior": 2}}"#;
    half.root["materials"][0]["extensions"] = json(specular);
    assert_close(mean(&half, 4096, 9), [0.25 / 9.0; 3], 1.5e-3);
    assert_warns(&half.load().unwrap(), &["material 0", "KHR_materials_specular is replaced by an index"]);
    // Of factors of 1 there is nothing to say
    half.root["materials"][0]["extensions"] = json(r#"{"KHR_materials_specular": {"specularFactor": 1}}"#);
    assert_eq!(half.load().unwrap().warnings, []);
}

#[test]
fn factors_out_of_range_are_clamped_with_a_warning() {
    let maker = near(wall(&format!(
        r#"{{"pbrMetallicRoughness": {{"baseColorFactor": [1.5, -1, 0.5, 1], {POLISHED}}}}}"#
    )));
    let loaded = maker.load().unwrap();
    assert_warns(&loaded, &["material 0", "baseColorFactor is 1.5, taken for 1"]);
    assert_warns(&loaded, &["material 0", "baseColorFactor is -1, taken for 0"]);
    assert_close(mean(&maker, 16, 9), [1.0, 0.0, 0.5], 2e-4);
}

/// Red and green above blue and white.
const FOUR: [[u8; 4]; 4] = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]];

/// A lamp with the four colours, seen as a drawing of `size`×`size` letters.
fn four(size: usize, sampler: &str, edit: impl FnOnce(&mut Maker)) -> Vec<String> {
    let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}"#);
    maker.texture(2, &FOUR, sampler);
    edit(&mut maker);
    let pixels = render(maker.load().unwrap(), size, 16, 1);
    let letter = |p: &Rgb| match p.map(|x| x > 0.5) {
        [true, false, false] => 'r',
        [false, true, false] => 'g',
        [false, false, true] => 'b',
        [true, true, true] => 'w',
        _ => '?',
    };
    pixels.chunks(size).map(|row| row.iter().map(letter).collect()).collect()
}

/// Gives the texture a transform.
fn transform(extension: &'static str) -> impl Fn(&mut Maker) {
    move |maker| {
        let texture = &mut maker.root["materials"][0]["emissiveTexture"];
        texture["extensions"]["KHR_texture_transform"] = json(extension);
    }
}

#[test]
fn textures_are_the_right_way_up() {
    assert_eq!(four(2, NEAREST, |_| ()), ["rg", "bw"]);
    let offset = transform(r#"{"offset": [0.5, 0]}"#);
    assert_eq!(four(2, NEAREST, offset), ["gr", "wb"]);
    assert_eq!(four(2, NEAREST, transform(r#"{"offset": [0, 0.5]}"#)), ["bw", "rg"]);
    // The top left quarter of the image alone
    assert_eq!(four(2, NEAREST, transform(r#"{"scale": [0.5, 0.5]}"#)), ["rr", "rr"]);
    assert_eq!(four(2, NEAREST, transform(r#"{"scale": [0.5, 0.5], "offset": [0.5, 0]}"#)), ["gg", "gg"]);
    // Coordinates turn counter-clockwise about the top left, the image clockwise: what was at its bottom left
    // is at its top left, but one image further up
    assert_eq!(four(2, NEAREST, transform(r#"{"rotation": 1.5707963}"#)), ["br", "wg"]);
}

#[test]
fn textures_wrap_as_their_sampler_says() {
    let twice = || transform(r#"{"scale": [2, 2]}"#);
    assert_eq!(four(4, NEAREST, twice()), ["rgrg", "bwbw", "rgrg", "bwbw"]);
    let mirrored = r#"{"magFilter": 9728, "wrapS": 33648, "wrapT": 33648}"#;
    assert_eq!(four(4, mirrored, twice()), ["rggr", "bwwb", "bwwb", "rggr"]);
    let clamped = r#"{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}"#;
    assert_eq!(four(4, clamped, twice()), ["rggg", "bwww", "bwww", "rggg"]);
}

/// Between the centres of two texels there is something of both, unless the filter is nearest.
#[test]
fn textures_are_interpolated_unless_nearest() {
    for (sampler, middle) in
        [("{}", [0.25, 0.75]), (r#"{"magFilter": 9729}"#, [0.25, 0.75]), (NEAREST, [0.0, 1.0])]
    {
        let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}"#);
        maker.texture(2, &[[0, 0, 0, 255], [255; 4]], sampler);
        let pixels = render(maker.load().unwrap(), 4, 4096, 1);
        // Means over a quarter of the image on either side of the middle: from u = ¼ to ½, 0 to ½ linearly
        for (x, expected) in [(1, middle[0]), (2, middle[1])] {
            assert!((pixels[4 + x][0] - expected).abs() < 0.02, "{sampler}: {} at {x}", pixels[4 + x][0]);
        }
    }
}

#[test]
fn the_set_of_texture_coordinates_is_the_materials() {
    // Set 1 is upside down
    let second = |maker: &mut Maker| {
        maker.attribute("TEXCOORD_1", &[[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    };
    let drawn = four(2, NEAREST, |maker| {
        second(maker);
        maker.root["materials"][0]["emissiveTexture"]["texCoord"] = 1.into();
    });
    assert_eq!(drawn, ["bw", "rg"]);
    let drawn = four(2, NEAREST, |maker| {
        second(maker);
        transform(r#"{"texCoord": 1}"#)(maker);
    });
    assert_eq!(drawn, ["bw", "rg"]);

    // Each texture takes its own set: the picture is upside down, and the hole of the mask on the left
    let mut maker = wall(
        r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "texCoord": 1}, "alphaMode": "MASK",
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}"#,
    );
    maker.texture(2, &FOUR, NEAREST);
    maker.texture(2, &[[0; 4], [0, 0, 0, 255]], NEAREST);
    second(&mut maker);
    assert_eq!(maker.load().unwrap().warnings, []);
    let pixels = render(maker.load().unwrap(), 2, 16, 1);
    assert_eq!(pixels, [[1.0; 3], [1.0; 3], [1.0; 3], [0.0, 1.0, 0.0]]);

    // A third set cannot be shown
    maker.root["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] =
        json(r#"{"index": 0, "texCoord": 2}"#);
    assert_warns(
        &maker.load().unwrap(),
        &["material 0", "texture 0 is ignored", "set 1", "the sets 0 and 2"],
    );

    // Nor one without coordinates
    let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "texCoord": 7}}"#);
    maker.texture(2, &FOUR, NEAREST);
    assert_warns(&maker.load().unwrap(), &["mesh 0, primitive 0", "no set 7"]);
}

#[test]
fn emission_has_strength() {
    let maker = wall(
        r#"{"emissiveFactor": [1, 0.5, 0.1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 20}}}"#,
    );
    assert_close(mean(&maker, 1, 1), [20.0, 10.0, 2.0], 1e-5);
}

/// A wall that gives off 1 in front of one that gives off 3.
fn veil(material: &str) -> Maker {
    let mut maker = wall(material);
    maker.show([-9.0, 9.0], [-9.0, 9.0], -2.0, r#"{"emissiveFactor": [3, 3, 3]}"#);
    maker
}

#[test]
fn blended_surfaces_cover_by_alpha() {
    let material = |alpha: f32, mode: &str| {
        format!(
            r#"{{"emissiveFactor": [1, 1, 1], "alphaMode": "{mode}",
                "pbrMetallicRoughness": {{"baseColorFactor": [0, 0, 0, {alpha}]}}}}"#
        )
    };
    // A standard error of 2·√(0.25·0.75/64/4096) = 1.7e-3; direct light alone, so that a ray that goes on is
    // of length 2
    for (alpha, mode, expected) in [
        (0.25, "OPAQUE", 1.0),
        (0.25, "BLEND", 2.5),
        (1.0, "BLEND", 1.0),
        (0.49, "MASK", 3.0),
        (0.5, "MASK", 1.0),
    ] {
        assert_close(mean(&veil(&material(alpha, mode)), 4096, 1), [expected; 3], 9e-3);
    }

    // Alpha of the texture times that of the factor: 102/255·0.5 = 0.2
    let mut maker = veil(&material(0.5, "BLEND"));
    let texture = maker.texture(1, &[[255, 255, 255, 102]], NEAREST);
    maker.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = texture.into();
    assert_close(mean(&maker, 4096, 1), [0.2 + 0.8 * 3.0; 3], 9e-3);
}

/// COLOR_0 multiplies the alpha, too (glTF 2.0, §3.9.4), in all its types.
#[test]
fn alphas_of_corners_multiply() {
    let material = |mode: &str| {
        format!(
            r#"{{"emissiveFactor": [1, 1, 1], "alphaMode": "{mode}",
                "pbrMetallicRoughness": {{"baseColorFactor": [0, 0, 0, 0.5]}}}}"#
        )
    };
    let with = |mode: &str, colours: &dyn Fn(&mut Maker) -> usize| {
        let mut maker = veil(&material(mode));
        let colours = colours(&mut maker);
        maker.root["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colours.into();
        maker
    };
    let quarter = |maker: &mut Maker| maker.floats(&[[1.0f32, 1.0, 1.0, 0.25]; 4]);
    let bytes = |maker: &mut Maker| {
        maker.accessor(5121, "VEC4", 4, &[255, 255, 255, 51].repeat(4), r#", "normalized": true"#)
    };
    let words = |maker: &mut Maker| {
        let row: Vec<u8> = [65535u16, 65535, 65535, 13107].iter().flat_map(|w| w.to_le_bytes()).collect();
        maker.accessor(5123, "VEC4", 4, &row.repeat(4), r#", "normalized": true"#)
    };
    // 0.5·0.25 and 0.5·51/255 of 1, the rest of 3; a standard error of 2·√(0.125·0.875/64/4096) = 1.3e-3
    for (colours, alpha) in [(&quarter as &dyn Fn(&mut Maker) -> usize, 0.125), (&bytes, 0.1), (&words, 0.1)]
    {
        let maker = with("BLEND", colours);
        assert_close(mean(&maker, 4096, 1), [3.0 - 2.0 * alpha; 3], 7e-3);
        assert_eq!(maker.load().unwrap().warnings, []);
        assert_close(mean(&with("OPAQUE", colours), 16, 1), [1.0; 3], 1e-5);
        assert_close(mean(&with("MASK", colours), 16, 1), [3.0; 3], 1e-5);
    }
    // From 0 on the left to 1 on the right: half of it reaches a cutoff of 0.25
    let mut maker = with("MASK", &|maker| {
        let [left, right] = [0.0f32, 1.0].map(|alpha| [1.0, 1.0, 1.0, alpha]);
        maker.floats(&[left, right, right, left])
    });
    maker.root["materials"][0]["alphaCutoff"] = json("0.25");
    let pixels = render(maker.load().unwrap(), 2, 64, 1);
    assert_eq!(pixels.iter().map(|p| p[0]).collect::<Vec<_>>(), [3.0, 1.0, 3.0, 1.0]);
}

#[test]
fn masks_are_sharp() {
    // Alpha 0.4 and 0.8, times 0.5: against a cutoff of 0.3, a hole on the left
    let mut maker = veil(
        r#"{"emissiveFactor": [1, 1, 1], "alphaMode": "MASK", "alphaCutoff": 0.3,
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 0.5], "baseColorTexture": {"index": 0}}}"#,
    );
    maker.texture(2, &[[9, 9, 9, 102], [9, 9, 9, 204]], NEAREST);
    let pixels = render(maker.load().unwrap(), 2, 64, 1);
    assert_eq!(pixels.iter().map(|p| p[0]).collect::<Vec<_>>(), [3.0, 1.0, 3.0, 1.0]);
    // A cutoff that nothing reaches
    maker.root["materials"][0]["alphaCutoff"] = json("0.6");
    let pixels = render(maker.load().unwrap(), 2, 64, 1);
    assert_eq!(pixels.iter().map(|p| p[0]).collect::<Vec<_>>(), [3.0; 4]);
}

/// From behind, a single-sided wall is not there, for shadow rays neither.
#[test]
fn backs_are_culled_unless_double_sided() {
    for (double, reflected, emitted) in [(false, 1.0, 1.0), (true, 0.5, 0.25)] {
        let metal = format!(r#"{{"baseColorFactor": [0.5, 0.5, 0.5, 1], {POLISHED}}}"#);
        let mut maker = wall(&format!(r#"{{"doubleSided": {double}, "pbrMetallicRoughness": {metal}}}"#));
        maker.root["cameras"][0]["perspective"]["yfov"] = json("0.01");
        let front = maker.root["nodes"][1].clone();
        maker.root["nodes"][1] = json(r#"{"mesh": 0, "rotation": [0, 1, 0, 0], "translation": [0, 0, -2]}"#);
        assert_close(mean(&maker, 16, 9), [reflected; 3], 3e-4);
        maker.root["materials"][0]["emissiveFactor"] = json("[0.25, 0.25, 0.25]");
        assert_close(mean(&maker, 16, 1), [emitted; 3], 1e-4);
        maker.root["nodes"][1] = front;
        assert_close(mean(&maker, 16, 1), [0.25; 3], 1e-4);
    }
    // A floor below a roof that faces up: seen from below it is not there, and the sun shines through
    let sun = r#"{"type": "directional", "intensity": 3.1415927}"#;
    let mut maker = super::lights::floor(sun, r#""rotation": [-0.70710678, 0, 0, 0.70710678]"#);
    let mesh = maker.rectangle([-9.0, 9.0], [-9.0, 9.0], 0.0, "{}");
    let up = r#""rotation": [-0.70710678, 0, 0, 0.70710678], "translation": [0, 4, 0]"#;
    maker.node(&format!(r#"{{"mesh": {mesh}, {up}}}"#));
    let pixels = render(maker.load().unwrap(), 2, 16, 2);
    assert_close(pixels[0], [super::lights::ALBEDO; 3], 2e-3);
}

/// A wall of glass of index 2, with more extensions.
fn glass(factor: f32, roughness: f32, more: &str) -> Maker {
    near(wall(&format!(
        r#"{{"extensions": {{"KHR_materials_transmission": {{"transmissionFactor": {factor}}},
                             "KHR_materials_ior": {{"ior": 2}}{more}}},
            "pbrMetallicRoughness": {{"baseColorFactor": [0.5, 1, 0, 1], "roughnessFactor": {roughness}}}}}"#
    )))
}

/// The wall's back, seen from as far.
fn turned(mut maker: Maker) -> Maker {
    maker.root["nodes"][1] = json(r#"{"mesh": 0, "rotation": [0, 1, 0, 0], "translation": [0, 0, -2]}"#);
    maker
}

#[test]
fn transmission_without_a_volume_is_a_pane() {
    // Head on, R = ((2 − 1)/(2 + 1))² is reflected at each side, 2R/(1 + R) by both together, and the rest
    // tinted once; a standard error of √(0.2·0.8/64/4096) = 8e-4
    let r = 0.2;
    let expected = [r + 0.5 * (1.0 - r), 1.0, r];
    let thin = ["", r#", "KHR_materials_volume": {"thicknessFactor": 0, "attenuationDistance": 1}"#];
    for clear in thin.map(|more| glass(1.0, 0.0, more)) {
        assert_close(mean(&clear, 4096, 9), expected, 5e-3);
        assert_eq!(clear.load().unwrap().warnings, []);
    }
    let frosted = glass(0.75, 0.5, "");
    assert_close(mean(&frosted, 4096, 9), expected, 5e-3);
    let loaded = frosted.load().unwrap();
    assert_warns(&loaded, &["material 0", "roughness of 0.5"]);
    assert_warns(&loaded, &["material 0", "transmissionFactor of 0.75", "all glass"]);
    // Seen from behind as well, though glTF's materials are one-sided unless they say otherwise
    assert_close(mean(&turned(glass(1.0, 0.0, "")), 4096, 9), expected, 5e-3);
    let opaque = glass(0.25, 0.0, "").load().unwrap();
    assert_warns(&opaque, &["material 0", "transmissionFactor of 0.25", "opaque"]);
}

#[test]
fn transmission_into_a_volume_is_solid_glass() {
    // Head on, R is reflected and the rest tinted, as radiance of the sky over η² = 2² behind the boundary; standard
    // errors of √(8/81/64/4096) = 6e-4, and 4 times that
    let r = 1.0 / 9.0;
    let expected = |eta2: f32| [r + 0.5 * (1.0 - r) / eta2, r + (1.0 - r) / eta2, r];
    let solid = glass(1.0, 0.0, r#", "KHR_materials_volume": {"thicknessFactor": 0.1}"#);
    assert_close(mean(&solid, 4096, 9), expected(4.0), 5e-3);
    assert_eq!(solid.load().unwrap().warnings, []);
    // Seen from within as well
    assert_close(mean(&turned(solid), 4096, 9), expected(0.25), 1.2e-2);
    // Rough, it scatters what goes through, and nearly all light still leaves in front or behind
    let frosted = glass(1.0, 0.5, r#", "KHR_materials_volume": {"thicknessFactor": 0.1}"#);
    assert_eq!(frosted.load().unwrap().warnings, []);
    let [_, green, blue] = mean(&frosted, 4096, 9);
    let all = blue + 4.0 * (green - blue);
    assert!(all > 0.95 && all <= 1.0 + 5e-3 && (blue - r).abs() < 0.03, "{green} {blue}");
    let volume = r#""thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0, 0]"#;
    let tinted = glass(1.0, 0.0, &format!(r#", "KHR_materials_volume": {{{volume}}}"#)).load().unwrap();
    assert_warns(&tinted, &["material 0", "attenuation in its volume is ignored"]);
}

#[test]
fn what_is_ignored_is_named() {
    let mut maker = wall(
        r#"{"name": "Oak", "normalTexture": {"index": 0}, "occlusionTexture": {"index": 0},
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {"EXT_info": {}}}},
            "extensions": {"KHR_materials_sheen": {}, "KHR_materials_clearcoat": {"clearcoatFactor": 1,
                "clearcoatNormalTexture": {"index": 0}, "clearcoatRoughnessTexture": {"index": 0}}}}"#,
    );
    maker.texture(1, &[[9; 4]], r#"{}"#);
    maker.root["textures"][0]["extensions"] = json(r#"{"EXT_texture": {}}"#);
    maker.root["extensionsUsed"] = json(r#"["KHR_materials_sheen", "KHR_materials_clearcoat"]"#);
    maker.root["extensionsRequired"] = json(r#"["KHR_materials_clearcoat"]"#);
    let loaded = maker.load().unwrap();
    for parts in [
        [r#"material 0 "Oak""#, "an occlusion map"],
        [r#"material 0 "Oak""#, "KHR_materials_sheen"],
        [r#"material 0 "Oak""#, "the normal map of its coat"],
        [r#"material 0 "Oak""#, "EXT_info"],
        ["texture 0", "EXT_texture"],
    ] {
        assert_warns(&loaded, &parts);
    }
    assert_eq!(loaded.warnings.len(), 5, "{:#?}", loaded.warnings);
}

#[test]
fn images_come_from_views_and_files_too() {
    let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}"#);
    let mut jpeg = std::io::Cursor::new(vec![]);
    let grey = image::RgbImage::from_pixel(8, 8, image::Rgb([188; 3]));
    grey.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    let view = maker.view(jpeg.get_ref(), "");
    maker.push("images", &format!(r#"{{"bufferView": {view}, "mimeType": "image/jpeg"}}"#));
    maker.push("textures", r#"{"source": 0}"#);
    // JPEG is good to a code or two
    assert_close(mean(&maker, 4, 1), [linear(188); 3], 0.02);

    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    grey.save_with_format(folder.path().join("maps/grey map.png"), image::ImageFormat::Png).unwrap();
    maker.root["images"][0] = json(r#"{"uri": "maps/grey%20map.png"}"#);
    maker.root["buffers"] = json(&format!(r#"[{{"uri": "all.bin", "byteLength": {}}}]"#, maker.bytes.len()));
    std::fs::write(folder.path().join("all.bin"), &maker.bytes).unwrap();
    std::fs::write(folder.path().join("a.gltf"), maker.gltf()).unwrap();
    let loaded = noisefloor_scenefile::load(&folder.path().join("a.gltf")).unwrap();
    let pixels = render(loaded, 2, 1, 1);
    assert!(pixels.iter().all(|p| (p[0] - linear(188)).abs() < 1e-5), "{pixels:?}");

    // Spaces around a name are part of it, unless there is no such file
    std::fs::copy(folder.path().join("maps/grey map.png"), folder.path().join(" a.png ")).unwrap();
    let black = image::RgbImage::new(8, 8);
    black.save_with_format(folder.path().join("a.png"), image::ImageFormat::Png).unwrap();
    for (uri, grey) in
        [("%20a.png%20", linear(188)), (" a.png ", linear(188)), ("a.png", 0.0), ("a.png ", 0.0)]
    {
        maker.root["images"][0] = json(&format!(r#"{{"uri": "{uri}"}}"#));
        std::fs::write(folder.path().join("a.gltf"), maker.gltf()).unwrap();
        let loaded = noisefloor_scenefile::load(&folder.path().join("a.gltf")).unwrap();
        let pixels = render(loaded, 2, 1, 1);
        assert!(pixels.iter().all(|p| (p[0] - grey).abs() < 1e-5), "{uri:?}: {pixels:?}");
    }
}

/// A file that requires variants shows its materials without one.
#[test]
fn variants_are_left_at_their_default() {
    let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1]}"#);
    maker.push("materials", r#"{"emissiveFactor": [0, 0, 0]}"#);
    let mapping = r#"{"KHR_materials_variants": {"mappings": [{"material": 1, "variants": [0]}]}}"#;
    maker.root["meshes"][0]["primitives"][0]["extensions"] = json(mapping);
    maker.root["extensions"] = json(r#"{"KHR_materials_variants": {"variants": [{"name": "Night"}]}}"#);
    maker.root["extensionsUsed"] = json(r#"["KHR_materials_variants"]"#);
    maker.root["extensionsRequired"] = json(r#"["KHR_materials_variants"]"#);
    assert_close(mean(&maker, 4, 1), [1.0; 3], 1e-5);
    assert_warns(&maker.load().unwrap(), &["KHR_materials_variants is ignored"]);
}
