//! What surfaces look like: radiance in closed form.

use crate::kit::{Maker, assert_warns, json, render};
use noisefloor::Rgb;

const NEAREST: &str = r#"{"magFilter": 9728}"#;
/// All but a mirror of that colour, seen head on; facets of α = 10⁻³ and samples of the surroundings leave 2·10⁻⁴.
const POLISHED: &str = r#""metallicFactor": 1, "roughnessFactor": 0"#;

/// A rectangle that fills the image, at z = −1, in surroundings of radiance 1.
fn wall(material: &str) -> Maker {
    let mut maker = Maker::new();
    let mesh = maker.rectangle([-1.0, 1.0], [-1.0, 1.0], -1.0, material);
    maker.node(&format!(r#"{{"mesh": {mesh}}}"#));
    maker.surroundings();
    maker
}

/// The wall through a field of view of half a degree: head on.
fn near(mut maker: Maker) -> Maker {
    maker.root["cameras"][0]["perspective"]["yfov"] = json("0.01");
    maker
}

fn mean(maker: &Maker, samples: u64, max_depth: u32) -> Rgb {
    let pixels = render(maker.load().unwrap(), 8, samples, max_depth);
    std::array::from_fn(|c| pixels.iter().map(|p| p[c]).sum::<f32>() / 64.0)
}

fn assert_close(found: Rgb, expected: Rgb, tolerance: f32) {
    let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= tolerance);
    assert!(close, "{found:?}, expected {expected:?} within {tolerance}");
}

/// sRGB decoded (IEC 61966-2-1).
fn linear(code: u8) -> f32 {
    ((f32::from(code) / 255.0 + 0.055) / 1.055).powf(2.4)
}

/// In surroundings of radiance 1, a lossless wall has that, too.
#[test]
fn white_walls_in_white_surroundings_cannot_be_seen() {
    for metallic in [0, 1] {
        let material =
            format!(r#"{{"pbrMetallicRoughness": {{"metallicFactor": {metallic}, "roughnessFactor": 0}}}}"#);
        let maker = wall(&material);
        assert_warns(&maker.load().unwrap(), &["no light", "a grey sky"]);
        // All but without noise: roulette, and light that is lost after 65 segments
        assert_close(mean(&maker, 4096, 65), [1.0; 3], 2e-3);
    }
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
    // polished coat on the colour: head on, that reflects ((1.5 − 1)/(1.5 + 1))² = 0.04, and nothing comes
    // from a black base. A standard error of √(0.02·0.98/64/4096) = 2.7e-4
    let black = r#"{"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0.5}}"#;
    let mut half = near(wall(black));
    let texture = half.texture(1, &[[255, 0, 255, 255]], "{}");
    half.root["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"] = texture.into();
    assert_close(mean(&half, 4096, 9), [0.02; 3], 1.4e-3);
    // The index of refraction makes the coat: ((2 − 1)/(2 + 1))²
    half.root["materials"][0]["extensions"] = json(r#"{"KHR_materials_ior": {"ior": 2}}"#);
    assert_close(mean(&half, 4096, 9), [0.5 / 9.0; 3], 2e-3);
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
        let uvs = maker.floats(&[[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        maker.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = uvs.into();
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

    // Another texture with another set cannot be shown
    let mut maker = wall(
        r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "texCoord": 1},
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}"#,
    );
    maker.texture(2, &FOUR, NEAREST);
    let loaded = maker.load().unwrap();
    assert_warns(&loaded, &["material 0", "texture 0 is ignored", "set 1"]);
    assert_warns(&loaded, &["no light"]);

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
    let behind = maker.rectangle([-9.0, 9.0], [-9.0, 9.0], -2.0, r#"{"emissiveFactor": [3, 3, 3]}"#);
    maker.node(&format!(r#"{{"mesh": {behind}}}"#));
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

#[test]
fn backs_are_black_unless_double_sided() {
    for (double, expected) in [(false, 0.0), (true, 1.0)] {
        let mut maker =
            wall(&format!(r#"{{"doubleSided": {double}, "pbrMetallicRoughness": {{{POLISHED}}}}}"#));
        maker.root["nodes"][1] = json(r#"{"mesh": 0, "rotation": [0, 1, 0, 0], "translation": [0, 0, -2]}"#);
        assert_close(mean(&maker, 16, 9), [expected; 3], 1e-4);
        maker.root["materials"][0]["emissiveFactor"] = json("[0.5, 0.5, 0.5]");
        assert_close(mean(&maker, 16, 1), [expected * 0.5; 3], 1e-4);
    }
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
        assert_eq!(clear.load().unwrap().warnings.len(), 1, "that there is no light");
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
    // Head on, R is reflected and the rest tinted; a standard error of √(8/81/64/4096) = 6e-4
    let r = 1.0 / 9.0;
    let expected = [r + 0.5 * (1.0 - r), 1.0, r];
    let solid = glass(1.0, 0.0, r#", "KHR_materials_volume": {"thicknessFactor": 0.1}"#);
    assert_close(mean(&solid, 4096, 9), expected, 5e-3);
    assert_eq!(solid.load().unwrap().warnings.len(), 1, "that there is no light");
    // Seen from within as well
    assert_close(mean(&turned(solid), 4096, 9), expected, 5e-3);
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
        [r#"material 0 "Oak""#, "the texture of its coat's roughness"],
        [r#"material 0 "Oak""#, "EXT_info"],
        ["texture 0", "EXT_texture"],
        ["scene.gltf", "no light"],
    ] {
        assert_warns(&loaded, &parts);
    }
    assert_eq!(loaded.warnings.len(), 7, "{:#?}", loaded.warnings);
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
}

/// A distant light along −z: what a wall of normal n reflects of it is Lambert's cosine.
fn sunlit(material: &str) -> Maker {
    let mut maker = wall(material);
    // Without its white surroundings
    maker.root["scenes"][0]["nodes"] = json("[0, 1, 3]");
    maker.root["extensions"]["KHR_lights_punctual"]["lights"] =
        json(r#"[{"type": "directional", "intensity": 3}]"#);
    // −z turned by 45° about −y comes from +x +z
    let node = r#"{"rotation": [0, 0.38268343, 0, 0.92387953], "extensions": {"KHR_lights_punctual": {"light": 0}}}"#;
    maker.push("nodes", node);
    maker
}

/// A diffuse surface: a coat of index 1.001 reflects nothing.
const CHALK: &str =
    r#""pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {"KHR_materials_ior": {"ior": 1.001}}"#;

#[test]
fn normal_maps_turn_the_normal() {
    let lambert = |n: [f32; 3]| {
        let length = n.iter().map(|x| x * x).sum::<f32>().sqrt();
        3.0 / std::f32::consts::PI * ((n[0] + n[2]) / (2f32.sqrt() * length)).max(0.0)
    };
    // Codes of 8 bits: (204, 128, 230) is (0.6, 0.004, 0.804)
    let n = [204u8, 128, 230].map(|c| f32::from(c) / 255.0 * 2.0 - 1.0);
    for (scale, mirrored) in [(1.0, false), (0.5, false), (1.0, true)] {
        let material = format!(r#"{{"normalTexture": {{"index": 0, "scale": {scale}}}, {CHALK}}}"#);
        let mut maker = sunlit(&material);
        maker.texture(1, &[[204, 128, 230, 255]], "{}");
        if mirrored {
            // u runs the other way, and red with it
            let mirrored = maker.floats(&[[1.0f32, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
            maker.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = mirrored.into();
        }
        let side = if mirrored { -1.0 } else { 1.0 };
        let expected = lambert([side * scale * n[0], scale * n[1], n[2]]);
        assert_close(mean(&near(maker), 16, 9), [expected; 3], 5e-3 * expected + 1e-4);
    }
    // Green points up in the picture, also where u is mirrored: lit from above instead
    for mirrored in [false, true] {
        let mut maker = sunlit(&format!(r#"{{"normalTexture": {{"index": 0}}, {CHALK}}}"#));
        maker.texture(1, &[[128, 204, 230, 255]], "{}");
        if mirrored {
            let mirrored = maker.floats(&[[1.0f32, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
            maker.root["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = mirrored.into();
        }
        maker.root["nodes"][3]["rotation"] = json("[-0.38268343, 0, 0, 0.92387953]");
        let expected = lambert([n[0], 0.0, n[2]]);
        assert_close(mean(&near(maker), 16, 9), [expected; 3], 5e-3 * expected);
    }
}

/// Head on, a coat reflects 0.04 of the surroundings, and the rest comes from a black base.
#[test]
fn clear_coats_reflect() {
    let black = r#""pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 1}"#;
    for (factor, texture, share) in [(1.0, None, 1.0), (0.5, None, 0.5), (1.0, Some(51u8), 0.2)] {
        let more = if texture.is_some() { r#", "clearcoatTexture": {"index": 0}"# } else { "" };
        let coat = format!(r#""KHR_materials_clearcoat": {{"clearcoatFactor": {factor}{more}}}"#);
        let mut maker = near(wall(&format!(r#"{{{black}, "extensions": {{{coat}}}}}"#)));
        if let Some(red) = texture {
            maker.texture(1, &[[red, 255, 0, 255]], "{}");
        }
        // A standard error of √(0.04·0.96/64/8192) = 2.7e-4
        assert_close(mean(&maker, 8192, 9), [0.04 * share; 3], 1.4e-3);
    }
    let broken = wall(r#"{"extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": "much"}}}"#);
    let error = broken.load().unwrap_err().to_string();
    assert!(error.contains("material 0: its clearcoatFactor is no number of 0…1"), "{error}");
}

#[test]
fn unlit_surfaces_show_their_colour() {
    let unlit = r#"{"extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0.25, 1], "baseColorTexture": {"index": 0}}}"#;
    let mut maker = sunlit(unlit);
    maker.texture(1, &[[188, 188, 188, 255]], "{}");
    let seen = linear(188);
    assert_close(mean(&maker, 16, 9), [0.5 * seen, seen, 0.25 * seen], 1e-4);
}

#[test]
fn colours_of_vertices_multiply() {
    let chalk =
        CHALK.replace(r#"{"metallicFactor""#, r#"{"baseColorFactor": [0.5, 1, 1, 1], "metallicFactor""#);
    let mut maker = sunlit(&format!("{{{chalk}}}"));
    let colours = maker.floats(&[[1.0f32, 0.5, 0.25]; 4]);
    maker.root["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colours.into();
    let lit = 3.0 / std::f32::consts::PI * 0.5f32.sqrt();
    assert_close(mean(&maker, 64, 9), [0.5 * lit, 0.5 * lit, 0.25 * lit], 3e-3);
}

#[test]
fn specular_and_glossy_become_metal_and_rough() {
    // A mirror of that colour, and a dielectric
    let gold = r#"{"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 0, 0, 1],
        "specularFactor": [0.9, 0.7, 0.3], "glossinessFactor": 1}}}"#;
    assert_close(mean(&near(wall(gold)), 64, 9), [0.9, 0.7, 0.3], 5e-3);
    let mut textured = near(wall(
        r#"{"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 0, 0, 1],
        "specularGlossinessTexture": {"index": 0}}}}"#,
    ));
    textured.texture(1, &[[188, 255, 150, 255]], "{}");
    assert_close(mean(&textured, 64, 9), [linear(188), 1.0, linear(150)], 6e-3);
}

/// A glow does not count as light, a lamp does; and a white ball in daylight is seen by its shades.
#[test]
fn what_glows_a_little_does_not_light_the_scene() {
    let warns = |material: &str| {
        let mut maker = Maker::new();
        let mesh = maker.rectangle([-1.0, 1.0], [-1.0, 1.0], -1.0, material);
        maker.node(&format!(r#"{{"mesh": {mesh}}}"#));
        maker.load().unwrap().warnings.iter().any(|w| w.what.contains("a grey sky"))
    };
    assert!(warns("{}"));
    assert!(warns(r#"{"emissiveFactor": [0.001, 0.001, 0.001]}"#));
    assert!(!warns(r#"{"emissiveFactor": [1, 1, 1]}"#));
    assert!(!warns(
        r#"{"emissiveFactor": [0.1, 0.1, 0.1],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 20}}}"#
    ));
    assert!(!warns(r#"{"extensions": {"KHR_materials_unlit": {}}}"#));

    // A roof: two white sides that face left and right
    let mut maker = Maker::new();
    let mesh =
        maker.rectangle([-1.0, 1.0], [-1.0, 1.0], 0.0, "{\"pbrMetallicRoughness\": {\"metallicFactor\": 0}}");
    maker.node(&format!(
        r#"{{"mesh": {mesh}, "rotation": [0, 0.38268343, 0, 0.92387953], "translation": [0.7, 0, -2]}}"#
    ));
    maker.node(&format!(
        r#"{{"mesh": {mesh}, "rotation": [0, -0.38268343, 0, 0.92387953], "translation": [-0.7, 0, -2]}}"#
    ));
    let pixels = render(maker.load().unwrap(), 8, 1024, 9);
    let [left, right, sky] = [pixels[8 * 4 + 2][1], pixels[8 * 4 + 5][1], pixels[0][1]];
    assert!(left > 1.5 * right && left > 1.3 * sky, "{left} {right} {sky}");
}
