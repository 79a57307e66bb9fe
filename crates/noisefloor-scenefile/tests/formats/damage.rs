//! Seeded damage: whatever the bytes, loading ends with a scene or an error that names its file, never a panic.
//! The targets of `fuzz` try many more.

use crate::gltf::kit::{Maker, json};
use crate::util::{Folder, ply, serialized};
use noisefloor_scenefile::load;

/// A little of everything.
fn gltf() -> Maker {
    let mut maker = Maker::new();
    let mesh = maker.rectangle(
        [-1.0, 1.0],
        [-1.0, 1.0],
        -1.0,
        r#"{"alphaMode": "MASK", "alphaCutoff": 0.4, "emissiveFactor": [1, 0, 1], "doubleSided": true,
            "emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": 1, "scale": [2, 2]}}},
            "normalTexture": {"index": 0}, "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 2}, "KHR_materials_ior": {"ior": 1.4},
                "KHR_materials_transmission": {"transmissionFactor": 0.9}, "EXT_other": {}},
            "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0, 0.9], "baseColorTexture": {"index": 0},
                "metallicFactor": 0.5, "roughnessFactor": 0}}"#,
    );
    maker.texture(
        2,
        &[[1, 2, 3, 255], [4, 5, 6, 0]],
        r#"{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}"#,
    );
    let (at, values) = (maker.view(&[0, 3], ""), maker.view(&[0; 24], r#", "byteStride": 12"#));
    maker.root["accessors"][0]["sparse"] = json(&format!(
        r#"{{"count": 2, "indices": {{"bufferView": {at}, "componentType": 5121}}, "values": {{"bufferView": {values}}}}}"#
    ));
    let normals = maker.floats(&[[0.0f32, 0.0, 1.0]; 4]);
    maker.root["meshes"][mesh]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
    maker.node(r#"{"mesh": 0, "rotation": [0, 0.6, 0, 0.8], "scale": [1, -2, 1], "children": [2]}"#);
    maker.push("nodes", r#"{"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]}"#);
    maker.root["extensions"]["KHR_lights_punctual"]["lights"] =
        json(r#"[{"type": "spot", "intensity": 2, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]"#);
    maker.node(r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}}"#);
    maker
}

/// A scene with every kind of file, all small. `mesh.serialized` holds no names, so that every byte of it
/// matters.
fn mitsuba() -> Folder {
    let quad = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/2/1 \
        3/3/1 4//1\n";
    let vertices = ["0 0 0 0 0 1", "1 0 0 1 0 1", "1 1 0 1 1 1"];
    let mut binary =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
            .to_vec();
    for v in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0f32] {
        binary.extend(v.to_le_bytes());
    }
    binary.push(3);
    binary.extend([0i32, 1, 2].map(i32::to_le_bytes).concat());
    let mut inside = 0x1001u32.to_le_bytes().to_vec();
    inside.extend([3u64, 1].map(u64::to_le_bytes).concat());
    for v in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0f32] {
        inside.extend(v.to_le_bytes());
    }
    inside.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
    Folder::new()
        .with("quad.obj", quad)
        .with("ascii.ply", ply("u v u_0", &vertices, &["3 0 1 2"]))
        .with("binary.ply", binary)
        .with("mesh.serialized", serialized(3, &inside))
        .with_png("picture.png", 2, &[[9, 200, 30, 255], [1, 2, 3, 4], [255, 0, 0, 0], [7, 7, 7, 7]])
        .with("picture.jpg", jpeg())
        .with(
            "picture.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x40\x20\x10\x80",
        )
        .with_exr("sky.exr", 4, &[[1.0, 2.0, 3.0]; 8])
        .with("scene.xml", MITSUBA)
}

const MITSUBA: &str = r##"<?xml version="1.0"?>
<scene version="3.0.0"><default name="r" value="0.5"/>
<integrator type="path"><integer name="max_depth" value="9"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/><string name="fov_axis" value="smaller"/><transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform><film type="hdrfilm"><integer name="width" value="32"/></film></sensor>
<bsdf type="mask" id="a"><texture name="opacity" type="bitmap"><string name="filename" value="picture.png"/></texture><bsdf type="twosided"><bsdf type="roughplastic"><texture name="diffuse_reflectance" type="bitmap"><string name="filename" value="picture.jpg"/><transform name="to_uv"><scale x="2"/></transform></texture></bsdf></bsdf></bsdf>
<bsdf type="conductor" id="b"><rgb name="eta" value="0.2, 0.9, 1.1"/><rgb name="k" value="3"/></bsdf>
<shape type="obj"><string name="filename" value="quad.obj"/><ref id="a"/></shape>
<shape type="ply"><string name="filename" value="ascii.ply"/><ref id="b"/><transform name="to_world"><rotate y="1" angle="30"/><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform></shape>
<shape type="ply"><string name="filename" value="binary.ply"/><bsdf type="dielectric"><string name="int_ior" value="bk7"/></bsdf></shape>
<shape type="serialized"><string name="filename" value="mesh.serialized"/><integer name="shape_index" value="0"/><emitter type="area"><rgb name="radiance" value="$r"/></emitter></shape>
<shape type="sphere"><float name="radius" value="$r"/><bsdf type="diffuse"><srgb name="reflectance" value="#80ff10"/></bsdf></shape>
<shape type="disk"><emitter type="area"><texture name="radiance" type="bitmap"><string name="filename" value="picture.hdr"/></texture></emitter></shape>
<emitter type="envmap"><string name="filename" value="sky.exr"/><float name="scale" value="2"/></emitter>
<emitter type="spot"><float name="cutoff_angle" value="30"/><texture type="bitmap" name="texture"><string name="filename" value="picture.png"/></texture></emitter>
<shape type="ply"><string name="filename" value="ascii.ply"/><bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance"><string name="name" value="vertex_u"/></texture></bsdf></shape>
<emitter type="projector"><float name="scale" value="9"/><texture type="bitmap" name="irradiance"><string name="filename" value="picture.hdr"/></texture></emitter></scene>"##;

fn jpeg() -> Vec<u8> {
    let pixels: Vec<u8> = (0..16 * 16 * 3).map(|i| (i * 7 % 256) as u8).collect();
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new(&mut bytes)
        .encode(&pixels, 16, 16, image::ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

const PBRT: &str = "# everything
Integrator \"path\" \"integer maxdepth\" [8] Option \"bool disablepixeljitter\" true
LookAt 0 0 5 0 0 0 0 1 0 Scale -1 1 1
Camera \"perspective\" \"float fov\" [40] \"float lensradius\" 0.1
Film \"rgb\" \"integer xresolution\" [32] \"integer yresolution\" [24]
WorldBegin
Texture \"t\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 1 0] \"float uscale\" 4
Texture \"a\" \"float\" \"constant\" \"float value\" 0.5
MakeNamedMaterial \"m\" \"string type\" \"conductor\" \"spectrum eta\" \"metal-Cu-eta\" \"float roughness\" 0.2
MakeNamedMaterial \"n\" \"string type\" \"coateddiffuse\" \"texture reflectance\" \"t\"
MakeNamedMaterial \"x\" \"string type\" \"mix\" \"string materials\" [\"m\" \"n\"] \"float amount\" 0.4
AttributeBegin NamedMaterial \"x\" Translate 1 2 3 Rotate 30 0 1 0
Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" [0 0 0 1 0 0 0 1 0] \"texture alpha\" \"a\" AttributeEnd
ObjectBegin \"o\" Material \"dielectric\" \"float roughness\" 0.1 Shape \"sphere\" \"float radius\" 2 ObjectEnd
ObjectInstance \"o\" ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1]
Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]
Shape \"disk\" \"float radius\" 2 Shape \"cylinder\"
AreaLightSource \"diffuse\" \"blackbody L\" [5000] \"bool twosided\" true
Shape \"sphere\" \"float radius\" 0.25
LightSource \"infinite\" \"rgb L\" [0.1 0.2 0.3] LightSource \"spot\" \"spectrum I\" [400 1 700 2]
";

/// What tags, numbers and brackets are made of.
const SIGNS: &[u8] = b"-+.eE<>/\"'= \n$#&[]x";

/// Damages some bytes: flips bits, writes digits and signs, copies or removes a stretch, cuts the end.
fn damaged(file: &[u8], random: &mut fastrand::Rng) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.usize(..3) {
        let at = random.usize(..file.len());
        let length = random.usize(..40).min(file.len() - at);
        match random.usize(..10) {
            0 => file[at] ^= 1 << random.usize(..8),
            1 => file[at] = random.u8(..),
            2 => file[at] = SIGNS[random.usize(..SIGNS.len())],
            // Another number: what damages most
            3..=5 => match (0..file.len()).map(|i| (at + i) % file.len()).find(|i| file[*i].is_ascii_digit())
            {
                Some(digit) => file[digit] = random.u8(b'0'..=b'9'),
                None => file[at] = 0xff,
            },
            6 => {
                let stretch = file[at..at + length].to_vec();
                file.splice(at..at, stretch);
            }
            7 => drop(file.drain(at..at + length)),
            _ => {
                if random.usize(..8) == 0 {
                    file.truncate(at.max(1));
                }
            }
        }
        if file.is_empty() {
            break;
        }
    }
    file
}

#[test]
fn damage_never_panics() {
    let binaries = ["mesh.serialized", "picture.png", "picture.jpg", "picture.hdr"];
    let texts = ["scene.xml", "quad.obj", "ascii.ply", "binary.ply"];
    let maker = gltf();
    for (folder, scene, files, rounds) in [
        (Folder::new().with("a.gltf", maker.gltf()), "a.gltf", vec!["a.gltf"], 800),
        (Folder::new().with("a.glb", maker.glb()), "a.glb", vec!["a.glb"], 800),
        (mitsuba(), "scene.xml", [texts, binaries].concat(), 400),
        (Folder::new().with("scene.pbrt", PBRT), "scene.pbrt", vec!["scene.pbrt"], 2000),
    ] {
        let scene = folder.path().join(scene);
        load(&scene).unwrap();
        let mut random = fastrand::Rng::with_seed(20);
        let mut loaded = 0;
        for round in 0..rounds {
            let path = folder.path().join(files[round % files.len()]);
            let original = std::fs::read(&path).unwrap();
            let write = |bytes: &[u8]| {
                // To cut a file short first makes some file systems wait for the disk
                std::fs::remove_file(&path).unwrap();
                std::fs::write(&path, bytes).unwrap();
            };
            write(&damaged(&original, &mut random));
            match load(&scene) {
                Ok(_) => loaded += 1,
                Err(error) => {
                    let named = |text: String| text.contains(&folder.path().display().to_string());
                    let findings = error.findings();
                    assert!(findings.iter().all(|f| named(f.to_string())), "round {round}: {error}");
                }
            }
            write(&original);
        }
        // Damage that is never noticed, or always, tests nothing
        let some = rounds / 20..rounds - rounds / 20;
        assert!(some.contains(&loaded), "{loaded} of {rounds}: {}", scene.display());
    }
}
