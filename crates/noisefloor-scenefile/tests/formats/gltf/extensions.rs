//! Extensions, normal maps and colours of vertices, in closed form; and daylight.

use super::kit::{Maker, json, render};
use super::materials::{assert_close, linear, mean, near, wall};
use crate::util::{assert_warns, fails};
use noisefloor_scenefile::Loaded;

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

/// What a wall of the normal `n` reflects of that light.
fn lambert(n: [f32; 3]) -> f32 {
    let length = n.iter().map(|x| x * x).sum::<f32>().sqrt();
    3.0 / std::f32::consts::PI * ((n[0] + n[2]) / (2f32.sqrt() * length)).max(0.0)
}

/// What codes of 8 bits stand for in a normal map.
fn normal(codes: [u8; 3]) -> [f32; 3] {
    codes.map(|c| f32::from(c) / 255.0 * 2.0 - 1.0)
}

#[test]
fn normal_maps_turn_the_normal() {
    // (0.6, 0.004, 0.804)
    let n = normal([204, 128, 230]);
    for (scale, mirrored) in [(1.0, false), (0.5, false), (1.0, true)] {
        let material = format!(r#"{{"normalTexture": {{"index": 0, "scale": {scale}}}, {CHALK}}}"#);
        let mut maker = sunlit(&material);
        maker.texture(1, &[[204, 128, 230, 255]], "{}");
        if mirrored {
            // u runs the other way, and red with it
            maker.attribute("TEXCOORD_0", &[[1.0f32, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
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
            maker.attribute("TEXCOORD_0", &[[1.0f32, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
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
    fails(broken.load(), "material 0: its clearcoatFactor is no number of 0…1");
}

/// By texture, factor and colours of vertices.
#[test]
fn unlit_surfaces_show_their_colour() {
    let unlit = r#"{"extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0.25, 1], "baseColorTexture": {"index": 0}}}"#;
    let mut maker = sunlit(unlit);
    maker.texture(1, &[[188, 188, 188, 255]], "{}");
    let seen = linear(188);
    assert_close(mean(&maker, 16, 9), [0.5 * seen, seen, 0.25 * seen], 1e-4);

    let mut maker = sunlit(&unlit.replace(r#", "baseColorTexture": {"index": 0}"#, ""));
    maker.attribute("COLOR_0", &[[1.0f32, 0.5, 0.25]; 4]);
    assert_close(mean(&maker, 16, 9), [0.5, 0.5, 0.0625], 1e-4);
    assert_eq!(maker.load().unwrap().warnings, []);
    // From black on the left to white on the right: 1/4 and 3/4 in the mean over each half
    let [black, white] = [[0.0f32; 3], [1.0; 3]];
    maker.attribute("COLOR_0", &[black, white, white, black]);
    let pixels = render(maker.load().unwrap(), 2, 4096, 1);
    for (x, share) in [(0, 0.25), (1, 0.75)] {
        assert_close(pixels[x], [0.5 * share, share, 0.25 * share], 0.01);
    }
}

/// Red is along TANGENT, green along the cross product of the normal and that, times its fourth number (glTF
/// 2.0, §3.7.2.1): here +y, and −x or +x. In a mirror image all of it is mirrored. Without normals, it does
/// not count.
#[test]
fn tangents_of_a_mesh_are_the_tangent_space() {
    let n = normal([160, 90, 245]);
    for (side, mirrored, normals, want) in [
        (1.0f32, false, true, [-n[1], n[0], n[2]]),
        (-1.0, false, true, [n[1], n[0], n[2]]),
        (1.0, true, true, [n[1], n[0], n[2]]),
        (1.0, false, false, [n[0], n[1], n[2]]),
    ] {
        let mut maker = sunlit(&format!(r#"{{"normalTexture": {{"index": 0}}, {CHALK}}}"#));
        maker.texture(1, &[[160, 90, 245, 255]], "{}");
        let tangents = maker.floats(&[[0.0f32, 1.0, 0.0, side]; 4]);
        let up = maker.floats(&[[0.0f32, 0.0, 1.0]; 4]);
        let attributes = &mut maker.root["meshes"][0]["primitives"][0]["attributes"];
        attributes["TANGENT"] = tangents.into();
        if normals {
            attributes["NORMAL"] = up.into();
        }
        if mirrored {
            maker.root["nodes"][1]["scale"] = json("[-1, 1, 1]");
        }
        let expected = lambert(want);
        assert_close(mean(&near(maker), 16, 9), [expected; 3], 5e-3 * expected + 1e-4);
    }
}

#[test]
fn colours_of_vertices_multiply() {
    let chalk =
        CHALK.replace(r#"{"metallicFactor""#, r#"{"baseColorFactor": [0.5, 1, 1, 1], "metallicFactor""#);
    let mut maker = sunlit(&format!("{{{chalk}}}"));
    maker.attribute("COLOR_0", &[[1.0f32, 0.5, 0.25]; 4]);
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
        Maker::wall(material).load().unwrap().warnings.iter().any(|w| w.what.contains("a grey sky"))
    };
    assert!(warns("{}"));
    assert!(warns(r#"{"emissiveFactor": [0.001, 0.001, 0.001]}"#));
    assert!(!warns(r#"{"emissiveFactor": [1, 1, 1]}"#));
    assert!(!warns(
        r#"{"emissiveFactor": [0.1, 0.1, 0.1],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 20}}}"#
    ));
    assert!(!warns(r#"{"extensions": {"KHR_materials_unlit": {}}}"#));

    // A headlight, however bright, shows too little of the wall that it is on
    let mut maker = Maker::wall("{}");
    let lamp = maker.show(
        [-0.1, 0.1],
        [-0.1, 0.1],
        -0.999,
        r#"{"emissiveFactor": [1, 1, 1],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 20}}}"#,
    );
    assert_warns(&maker.load().unwrap(), &["its own lights show next to nothing", "a grey sky"]);
    // In front of it, and turned to it, it is a lamp
    let turned = r#", "rotation": [0, 1, 0, 0], "translation": [0, 0, -1.2]"#;
    maker.root["nodes"].as_array_mut().unwrap().pop();
    maker.root["scenes"][0]["nodes"].as_array_mut().unwrap().pop();
    maker.node(&format!(r#"{{"mesh": {lamp}{turned}}}"#));
    assert_eq!(maker.load().unwrap().warnings, []);

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

/// What is compressed by other means than those we read is refused by the name of its extension.
#[test]
fn compressed_pictures_and_meshes_are_refused_by_name() {
    for (bytes, what) in [
        (&b"\xabKTX 20\xbb\r\n\x1a\n\0\0\0\0"[..], "a KTX2 picture (KHR_texture_basisu)"),
        (&b"RIFF\0\0\0\0WEBPVP8 "[..], "the picture is broken"),
    ] {
        let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}"#);
        let view = maker.view(bytes, "");
        maker.push("images", &format!(r#"{{"bufferView": {view}, "mimeType": "image/png"}}"#));
        maker.push("textures", r#"{"source": 0}"#);
        fails(maker.load(), what);
    }
    let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}"#);
    maker.push("textures", r#"{"extensions": {"KHR_texture_basisu": {"source": 0}}}"#);
    fails(maker.load(), "texture 0: an image of only KHR_texture_basisu is not supported");
    // Used but not required, and nothing to fall back on
    let mut maker = wall("{}");
    maker.root["meshes"][0]["primitives"][0]["extensions"] = json(r#"{"EXT_other_compression": {}}"#);
    maker.root["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    fails(maker.load(), "a mesh of only EXT_other_compression is not supported");
    let mut maker = wall("{}");
    maker.root["extensionsRequired"] = json(r#"["KHR_texture_basisu", "EXT_meshopt_compression"]"#);
    fails(maker.load(), "KHR_texture_basisu, EXT_meshopt_compression");
}

/// Hidden nodes hide all below them, lamps as well, but no cameras.
#[test]
fn hidden_nodes_are_not_seen() {
    let mut maker = Maker::new();
    maker.rectangle([-1.0, 1.0], [-1.0, 1.0], -1.0, r#"{"emissiveFactor": [1, 1, 1]}"#);
    maker.root["extensions"]["KHR_lights_punctual"]["lights"] = json(r#"[{"type": "point"}]"#);
    let hidden = r#""KHR_node_visibility": {"visible": false}"#;
    let children = [
        r#"{"mesh": 0, "extensions": {"KHR_node_visibility": {"visible": true}}}"#,
        r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}}"#,
    ];
    let children = children.map(|child| maker.push("nodes", child));
    maker.root["nodes"][0]["extensions"] = json(&format!("{{{hidden}}}"));
    let parent =
        maker.node(&format!(r#"{{"mesh": 0, "children": {children:?}, "extensions": {{{hidden}}}}}"#));
    maker.root["extensionsUsed"] = json(r#"["KHR_node_visibility", "KHR_lights_punctual"]"#);
    let seen = |maker: &Maker| {
        let Loaded { scene, warnings, .. } = maker.load().unwrap();
        assert!(!warnings.iter().any(|w| w.to_string().contains("KHR_node")), "{warnings:?}");
        (scene.surfaces(), scene.lights())
    };
    assert_eq!(seen(&maker), (0, 0));
    maker.root["nodes"][parent].as_object_mut().unwrap().remove("extensions");
    assert_eq!(seen(&maker), (4, 5));
}

/// Three squares of one mesh: where translations, rotations and scales say, relative to the node; with a lamp of the node
/// that is there once.
#[test]
fn instances_are_seen_where_they_are() {
    let chalk = format!("{{{CHALK}}}");
    for (material, shining) in [(r#"{"emissiveFactor": [1, 1, 1]}"#, true), (chalk.as_str(), false)] {
        let make = |node: &dyn Fn(&mut Maker, usize)| {
            let mut maker = Maker::new();
            let mesh = maker.rectangle([-0.25, 0.25], [-0.25, 0.25], 0.0, material);
            maker.root["extensions"]["KHR_lights_punctual"]["lights"] =
                json(r#"[{"type": "point", "intensity": 3}]"#);
            maker.node(r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}}"#);
            node(&mut maker, mesh);
            maker
        };
        // Turned by 90° around the view, and of half the width
        let turn = 0.5f32.sqrt();
        let places: [([f32; 3], [f32; 4], [f32; 3]); 3] = [
            ([-0.5, 0.5, -1.0], [0.0, 0.0, 0.0, 1.0], [1.0; 3]),
            ([0.5, 0.5, -1.0], [0.0, 0.0, turn, turn], [0.5, 1.0, 1.0]),
            ([0.0, -0.5, -1.0], [0.0, 0.0, 0.0, 1.0], [1.5, 0.5, 1.0]),
        ];
        let instanced = make(&|maker, mesh| {
            let translations = maker.floats(&places.map(|(t, ..)| [t[0] - 0.1, t[1], t[2]]));
            let (rotations, scales) =
                (maker.floats(&places.map(|p| p.1)), maker.floats(&places.map(|p| p.2)));
            maker.node(&format!(
                r#"{{"mesh": {mesh}, "translation": [0.1, 0, 0], "extensions": {{"EXT_mesh_gpu_instancing":
                    {{"attributes": {{"TRANSLATION": {translations}, "ROTATION": {rotations}, "SCALE": {scales},
                        "_ID": {scales}}}}}}}}}"#
            ));
            maker.root["extensionsUsed"] = json(r#"["EXT_mesh_gpu_instancing", "KHR_lights_punctual"]"#);
            maker.root["extensionsRequired"] = json(r#"["EXT_mesh_gpu_instancing"]"#);
        });
        let apart = make(&|maker, mesh| {
            for (t, r, s) in places {
                maker.node(&format!(
                    r#"{{"mesh": {mesh}, "translation": {t:?}, "rotation": {r:?}, "scale": {s:?}}}"#
                ));
            }
        });
        let loaded = instanced.load().unwrap();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        assert_eq!(loaded.scene.instances(), if shining { 0 } else { 3 });
        let (found, expected) = (render(loaded, 8, 4, 2), render(apart.load().unwrap(), 8, 4, 2));
        assert!(expected.iter().filter(|pixel| pixel[0] > 0.1).count() > 6, "{shining} {expected:?}");
        for (found, expected) in found.iter().zip(&expected) {
            assert_close(*found, *expected, 1e-5);
        }
    }

    let mut maker = Maker::new();
    let mesh = maker.rectangle([-1.0, 1.0], [-1.0, 1.0], -1.0, "{}");
    let [two, three] = [maker.floats(&[[0.0f32; 3]; 2]), maker.floats(&[[1.0f32; 3]; 3])];
    maker.node(&format!(r#"{{"mesh": {mesh}}}"#));
    let many = maker.push("accessors", r#"{"componentType": 5126, "type": "VEC3", "count": 4000000000}"#);
    for (attributes, what) in [
        (format!(r#"{{"TRANSLATION": {two}, "SCALE": {three}}}"#), "its attributes differ in number"),
        (format!(r#"{{"SCALE": {many}}}"#), "inflated bytes so far, more than"),
        ("null".into(), "it needs `attributes`"),
    ] {
        let extension = format!(r#"{{"EXT_mesh_gpu_instancing": {{"attributes": {attributes}}}}}"#);
        maker.root["nodes"][1]["extensions"] = json(&extension);
        let error = maker.load().unwrap_err().to_string();
        assert!(error.contains("node 1: ") && error.contains(what), "{error}");
    }
}

/// WebP pictures, losslessly compressed, with a PNG for other readers or without.
#[test]
fn webp_pictures_are_read() {
    let mut webp = std::io::Cursor::new(vec![]);
    let picture = image::RgbImage::from_pixel(64, 64, image::Rgb([188, 10, 250]));
    picture.write_to(&mut webp, image::ImageFormat::WebP).unwrap();
    for fallback in [false, true] {
        let mut maker = wall(r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}"#);
        if fallback {
            maker.texture(1, &[[188, 10, 250, 255]], "{}");
        } else {
            maker.push("textures", "{}");
        }
        let view = maker.view(webp.get_ref(), "");
        let image = maker.push("images", &format!(r#"{{"bufferView": {view}, "mimeType": "image/webp"}}"#));
        let extension = format!(r#"{{"EXT_texture_webp": {{"source": {image}}}}}"#);
        maker.root["textures"][0]["extensions"] = json(&extension);
        maker.root["extensionsRequired"] = json(r#"["EXT_texture_webp"]"#);
        maker.root["extensionsUsed"] = json(r#"["EXT_texture_webp"]"#);
        assert_close(mean(&maker, 4, 1), [188, 10, 250].map(linear), 1e-5);
        assert_eq!(maker.load().unwrap().warnings, []);
    }
}

/// A lossless WebP of one colour: as many bytes whatever its size. The codes of its five channels have no bits.
fn plain_webp(width: u32, height: u32) -> Vec<u8> {
    let mut bits: u128 = u128::from(width - 1) | u128::from(height - 1) << 14;
    // No alpha, version 0, no transform, no cache, no groups; five codes of the one symbol 1
    for code in 0..5 {
        bits |= 0b1001 << (14 + 14 + 1 + 3 + 3 + 4 * code);
    }
    let mut chunk = vec![0x2f];
    chunk.extend(&bits.to_le_bytes()[..9]);
    let mut file = b"RIFF".to_vec();
    file.extend((4 + 8 + chunk.len() as u32).to_le_bytes());
    file.extend(b"WEBPVP8L");
    file.extend((chunk.len() as u32).to_le_bytes());
    file.extend(chunk);
    file
}

/// A few bytes stand for a picture of one colour of some size, but not of any, and not any number of times.
#[test]
fn plain_pictures_have_limits() {
    let textured = |size: u32, images: usize| {
        let mut maker = Maker::new();
        let view = maker.view(&plain_webp(size, size), "");
        for index in 0..images {
            maker.push("images", &format!(r#"{{"bufferView": {view}, "mimeType": "image/webp"}}"#));
            maker.push("textures", &format!(r#"{{"source": {index}}}"#));
            let material =
                format!(r#"{{"emissiveFactor": [1, 1, 1], "emissiveTexture": {{"index": {index}}}}}"#);
            maker.show([-1.0, 1.0], [-1.0, 1.0], -1.0, &material);
        }
        maker.load()
    };
    // The code 1 of 255
    let seen = render(textured(64, 1).unwrap(), 4, 1, 1)[5][1];
    assert!((seen - 1.0 / 255.0 / 12.92).abs() < 1e-6, "{seen}");
    fails(textured(8192, 1), "bytes cannot hold 8192×8192 pixels");
    fails(textured(2048, 40), "pixels of pictures so far, more than");
}

/// A texture whose image was lost is white, and a normal map without one is left out; of two images, the one that is
/// there is shown.
#[test]
fn textures_without_images_are_left_out() {
    let mut maker = Maker::new();
    maker.push("textures", "{}");
    let material =
        r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}, "normalTexture": {"index": 0}}"#;
    maker.show([-1.0, 1.0], [-1.0, 1.0], -1.0, material);
    let loaded = maker.load().unwrap();
    assert_warns(&loaded, &["texture 0: ", "it names no image: it is white"]);
    assert_warns(&loaded, &["material 0: ", "its normal map names no image: it is left out"]);
    assert_eq!(render(loaded, 4, 1, 1)[5], [1.0; 3]);

    // A PNG that is absent beside a WebP that is there, and the other way round
    let view = maker.view(&plain_webp(4, 4), "");
    let webp = maker.push("images", &format!(r#"{{"bufferView": {view}, "mimeType": "image/webp"}}"#));
    let absent = maker.push("images", r#"{"uri": "absent.png"}"#);
    for (own, other) in [(absent, webp), (webp, absent)] {
        maker.root["textures"][0] = json(&format!(
            r#"{{"source": {own}, "extensions": {{"EXT_texture_webp": {{"source": {other}}}}}}}"#
        ));
        maker.root["materials"][0].as_object_mut().unwrap().remove("normalTexture");
        let seen = render(maker.load().unwrap(), 4, 1, 1)[5][1];
        assert!((seen - 1.0 / 255.0 / 12.92).abs() < 1e-6, "{seen}");
    }
    maker.root["textures"][0] = json(&format!(r#"{{"source": {absent}}}"#));
    let error = maker.load().unwrap_err();
    assert!(format!("{error:?}").contains("absent.png"), "{error:?}");
}
