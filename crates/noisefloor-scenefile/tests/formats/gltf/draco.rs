//! Meshes that Draco compressed, beside the numbers that another decoder finds in them.
//!
//! A bumpy square of 3×3 vertices, encoded three times by DracoPy 2.2.0, which is Google's Draco: positions of 11
//! bits, normals of 8, texture coordinates of 10, colours of bytes.

use super::kit::{Maker, json, render};
use noisefloor::Rgb;

/// Edgebreaker with valences, level 10.
const VALENCE: &str = "\
    445241434f02020101000000090803080200037fda07ff0111ff028840ff028840ff02884004000000ff000101 \
    000002000001020204010001010009030003020103090201010201010903000203010101000903ad2a13390e1d \
    07042e5b9e8151d3a00150c01d00189f0000000000000000ff000000010101000c1b1d07390e1d07390e591505 \
    adc2021f83ffffbfccfe0f80fe00e0ff670000e0250000940900a00c00003103003803006400000000ff070000 \
    000080bf000080bfcdccccbf000000400b050101000b03390e1d0707390e390e0b3d0e05cb28125f85ffffff3f \
    008053219468840c070000000102704000000000ff03000000000000000000000000803f0a0603010009071d07 \
    031d070bc93103158b7cfc01dfa0dfbf9f6381bf7f307f301f01ff0000007f000000ff02994008";
/// Edgebreaker, level 4.
const STANDARD: &str = "\
    445241434f02020101000000090800080200037fda07ff011101ff000004020204010003090201010109030002 \
    000903000301020302010101000903ad2a13390e1d07042e5b9e8151d3a00150c01d00189f0000000000000000 \
    ff000000010101000b03ad2a1f5515032a624cffffff3f0000f80f0800000000ff030000000301000913390e1d \
    071d07912304804d26a2803fe80deeeafba836b803e2bebafa3eff0000007f000000010101000c1b1d07390e1d \
    07390e591505adc2021f83ffffbfccfe0f80fe00e0ff670000e0250000940900a00c0000310300380300640000 \
    0000ff07000000000000000000000000803f0a08000080bf000080bfcdccccbf000000400b";
/// As it is, in its order.
const SEQUENTIAL: &str = "\
    445241434f02020100000008090100010400040301020501050403040703070604050804080701040202040100 \
    030902010101090300020009030003010203020001010104c901a51a9103ff33ad0a4f91034ba90a9b91039791 \
    03c9010d5b924463f769b8fee1c3f6784700000000ff000000000101000b031d071fe5380304e085fe0f80ff00 \
    08d0ffff00f80f8000ffff0f80ff000000000000ff030000000301000913551507ad2a034f084eee55eafb9554 \
    bb88037430afb2af4e2aff0000007f000000000101000c1f1d0707e5380304e0850000ccff078033fc0f806608 \
    e0ff68f83f00fce37f005c4600fe6fc6ff01a019ff03a04c00000000ff07000000000000000000000000803f0a \
    08000080bf000080bfcdccccbf000000400b";
/// The attributes as DracoPy 2.2.0 decodes `SEQUENTIAL`, and as the other two have them in another order.
const POSITIONS: [[f32; 3]; 9] = [
    [-1.0, -1.0, -1.500342],
    [0.00048851967, -1.0, -1.399707],
    [1.0, -1.0, -1.500342],
    [-1.0, 0.00048851967, -1.449536],
    [0.00048851967, 0.00048851967, -1.2003908],
    [1.0, 0.00048851967, -1.399707],
    [-1.0, 1.0, -1.500342],
    [0.00048851967, 1.0, -1.3000488],
    [1.0, 1.0, -1.6],
];
const NORMALS: [[f32; 3]; 9] = [
    [-0.2771114, -0.18843587, 0.9421789],
    [0.00000007005163, -0.19433618, 0.98093504],
    [0.2771114, -0.18843578, 0.94217896],
    [-0.28375518, 0.0, 0.95889676],
    [0.0, 0.0, 1.0],
    [0.28375518, 0.0, 0.95889676],
    [-0.27711132, 0.18843587, 0.94217896],
    [0.0, 0.19433622, 0.9809349],
    [0.2771115, 0.1884357, 0.94217896],
];
const UVS: [[f32; 2]; 9] = [
    [0.0, 1.0],
    [0.50048876, 1.0],
    [1.0, 1.0],
    [0.0, 0.50048876],
    [0.50048876, 0.50048876],
    [1.0, 0.50048876],
    [0.0, 0.0],
    [0.50048876, 0.0],
    [1.0, 0.0],
];
const COLOURS: [[u8; 4]; 9] = [
    [255, 100, 0, 255],
    [215, 100, 60, 255],
    [175, 100, 120, 255],
    [255, 150, 20, 255],
    [215, 150, 80, 255],
    [175, 150, 140, 255],
    [255, 200, 40, 255],
    [215, 200, 100, 255],
    [175, 200, 160, 255],
];
const FACES: [[u16; 3]; 8] =
    [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6], [4, 5, 8], [4, 8, 7]];

/// The numbers of its attributes in all three buffers.
const IDS: &str = r#"{"POSITION": 3, "NORMAL": 2, "TEXCOORD_0": 1, "COLOR_0": 0}"#;

fn bytes(hex: &str) -> Vec<u8> {
    let digit = |c: u8| (c as char).to_digit(16).unwrap() as u8;
    let digits: Vec<u8> = hex.bytes().filter(|c| *c != b' ').collect();
    digits.chunks(2).map(|pair| digit(pair[0]) << 4 | digit(pair[1])).collect()
}

/// The square, with a picture on it and a light from the side.
fn square(fill: impl FnOnce(&mut Maker) -> String) -> Maker {
    let mut maker = Maker::new();
    maker.texture(2, &[[255, 80, 0, 255], [0, 255, 90, 255], [70, 0, 255, 255], [255; 4]], "{}");
    maker.push(
        "materials",
        r#"{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}"#,
    );
    let primitive = fill(&mut maker);
    maker.push("meshes", &format!(r#"{{"primitives": [{primitive}]}}"#));
    maker.node(r#"{"mesh": 0}"#);
    maker.root["extensions"]["KHR_lights_punctual"]["lights"] = json(r#"[{"type": "directional"}]"#);
    let light = r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}, "rotation": [0, 0.38, 0, 0.92]}"#;
    maker.node(light);
    maker
}

fn plain() -> Maker {
    square(|maker| {
        let [positions, normals, uvs] =
            [maker.floats(&POSITIONS), maker.floats(&NORMALS), maker.floats(&UVS)];
        let colours = maker.accessor(5121, "VEC4", 9, &COLOURS.concat(), r#", "normalized": true"#);
        let indices = maker.indices(&FACES.concat());
        format!(
            r#"{{"attributes": {{"POSITION": {positions}, "NORMAL": {normals}, "TEXCOORD_0": {uvs},
                "COLOR_0": {colours}}}, "indices": {indices}, "material": 0}}"#
        )
    })
}

/// The same, of which only the bytes in `data` are there.
fn compressed(data: &[u8]) -> Maker {
    let mut maker = square(|maker| {
        let view = maker.view(data, "");
        let accessor = |maker: &mut Maker, kind: u32, shape: &str, count: usize| {
            let accessor = format!(
                r#"{{"componentType": {kind}, "type": "{shape}", "count": {count}, "normalized": {}}}"#,
                kind == 5121
            );
            maker.push("accessors", &accessor)
        };
        let [positions, normals] = [0; 2].map(|_| accessor(maker, 5126, "VEC3", 9));
        let uvs = accessor(maker, 5126, "VEC2", 9);
        let colours = accessor(maker, 5121, "VEC4", 9);
        let indices = accessor(maker, 5123, "SCALAR", 24);
        format!(
            r#"{{"attributes": {{"POSITION": {positions}, "NORMAL": {normals}, "TEXCOORD_0": {uvs},
                "COLOR_0": {colours}}}, "indices": {indices}, "material": 0,
                "extensions": {{"KHR_draco_mesh_compression": {{"bufferView": {view}, "attributes": {IDS}}}}}}}"#
        )
    });
    maker.root["extensionsUsed"] = json(r#"["KHR_draco_mesh_compression", "KHR_lights_punctual"]"#);
    maker.root["extensionsRequired"] = json(r#"["KHR_draco_mesh_compression"]"#);
    maker
}

fn picture(maker: &Maker) -> Vec<Rgb> {
    let loaded = maker.load().unwrap();
    assert!(loaded.warnings.is_empty(), "{:#?}", loaded.warnings);
    render(loaded, 16, 16, 2)
}

/// Positions, normals, texture coordinates, colours and corners are those that the other decoder finds.
#[test]
fn compressed_meshes_look_like_what_another_decoder_makes_of_them() {
    let expected = picture(&plain());
    assert!(expected.iter().filter(|p| p.iter().all(|x| *x > 0.01)).count() > 100, "{expected:?}");
    assert_eq!(picture(&compressed(&bytes(SEQUENTIAL))), expected);
    for data in [VALENCE, STANDARD] {
        let found = picture(&compressed(&bytes(data)));
        // The same triangles from other corners: rounding, and samples at their edges
        let off = found.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f32::max) < 1e-3);
    }
}

/// Where the mesh is there as well, that is read, even if the compressed one is broken. Primitives may share one.
#[test]
fn fallbacks_are_read_and_data_is_shared() {
    let mut maker = plain();
    let view = maker.view(b"DRACO?", "");
    let extension =
        format!(r#"{{"KHR_draco_mesh_compression": {{"bufferView": {view}, "attributes": {IDS}}}}}"#);
    maker.root["meshes"][0]["primitives"][0]["extensions"] = json(&extension);
    maker.root["extensionsUsed"] = json(r#"["KHR_draco_mesh_compression"]"#);
    assert_eq!(picture(&maker), picture(&plain()));

    let mut maker = compressed(&bytes(STANDARD));
    let primitive = maker.root["meshes"][0]["primitives"][0].clone();
    maker.root["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    assert_eq!(maker.load().unwrap().scene.surfaces(), 16);
}

/// What does not fit is an error that names the primitive.
#[test]
fn bad_data_is_named() {
    let good = || compressed(&bytes(STANDARD));
    let set = |path: &str, value: &str| {
        let mut maker = good();
        *maker.root.pointer_mut(path).unwrap() = json(value);
        maker
    };
    let extension = "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression";
    let mut cut = bytes(STANDARD);
    cut.truncate(150);
    let mut later = bytes(STANDARD);
    later[5] = 9;
    for (maker, what) in [
        (set("/accessors/1/type", r#""VEC2""#), "NORMAL has 3 numbers in its Draco data, not 2"),
        (set(&format!("{extension}/attributes/NORMAL"), "7"), "its Draco data has no attribute 7"),
        (set(&format!("{extension}/attributes"), r#"{"NORMAL": -1}"#), "it needs a number per attribute"),
        (set(&format!("{extension}/bufferView"), "null"), "it needs a bufferView"),
        (set(&format!("{extension}/bufferView"), "77"), "buffer view 77 does not exist"),
        (compressed(&cut), "its Draco data cannot be decoded"),
        (compressed(b"glTF"), "its Draco data cannot be decoded"),
        (compressed(&later), "version 9.2 of Draco data is not supported"),
    ] {
        let error = maker.load().err().unwrap_or_else(|| panic!("loads, not {what}")).to_string();
        assert!(error.contains("mesh 0, primitive 0: ") && error.contains(what), "{error}, not {what}");
    }
}

/// Damage ends with a scene or an error.
#[test]
fn damaged_data_never_panics() {
    let mut random = fastrand::Rng::with_seed(11);
    let (mut loaded, mut refused) = (0, 0);
    for data in [VALENCE, STANDARD, SEQUENTIAL] {
        let data = bytes(data);
        for _ in 0..150 {
            let mut data = data.clone();
            for _ in 0..=random.usize(..3) {
                let at = random.usize(..data.len());
                data[at] = random.u8(..);
            }
            data.truncate(if random.bool() { data.len() } else { random.usize(..data.len()) });
            match compressed(&data).load() {
                Ok(_) => loaded += 1,
                Err(_) => refused += 1,
            }
        }
    }
    assert!(loaded > 20 && refused > 20, "{loaded} {refused}");
}

/// Old encoders counted vertices that they left out: the data knows.
#[test]
fn counts_of_accessors_may_be_others() {
    let expected = picture(&compressed(&bytes(STANDARD)));
    for (accessor, count) in [(0, "8"), (0, "1000000"), (2, "12"), (4, "3"), (4, "27"), (0, "99999999999")] {
        let mut maker = compressed(&bytes(STANDARD));
        maker.root["accessors"][accessor]["count"] = json(count);
        assert_eq!(picture(&maker), expected, "{accessor} {count}");
    }
}

/// Without an accessor of indices, the faces are those of the data.
#[test]
fn indices_need_no_accessor() {
    for data in [VALENCE, STANDARD, SEQUENTIAL] {
        let mut maker = compressed(&bytes(data));
        let with = render(maker.load().unwrap(), 16, 4, 1);
        maker.root["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
        assert_eq!(render(maker.load().unwrap(), 16, 4, 1), with);
    }
}
