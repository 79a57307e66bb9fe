//! Scenes and their meshes: of a GLB, lengths are right; of a serialized mesh, the bytes are what is inside
//! the compression.

use crate::files::Folder;
use base64::Engine;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use noisefloor_scenefile::load;
use std::io::Write;

thread_local!(static FOLDER: Folder = Folder::new());

fn read(name: &str, bytes: &[u8]) -> bool {
    let path = FOLDER.with(|folder| folder.write(name, bytes));
    // Errors and warnings can be said
    let loaded = load(&path);
    match &loaded {
        Ok(loaded) => assert!(loaded.warnings.iter().all(|warning| !warning.to_string().is_empty())),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    loaded.is_ok()
}

/// Loads a scene with the mesh in it.
fn read_mesh(name: &str, kind: &str, bytes: &[u8]) -> bool {
    FOLDER.with(|folder| folder.write(name, bytes));
    let shape = format!(r#"<shape type="{kind}"><string name="filename" value="{name}"/></shape>"#);
    let scene = format!(r#"<scene version="3.0.0"><sensor type="perspective"/>{shape}</scene>"#);
    read("mesh.xml", scene.as_bytes())
}

/// A triangle under a lamp, seen by a camera; `uri` names or holds its positions.
fn triangle(uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1,2]}}],
"extensionsUsed":["KHR_lights_punctual"],
"extensions":{{"KHR_lights_punctual":{{"lights":[
{{"type":"spot","intensity":9,"spot":{{"outerConeAngle":1}}}}]}}}},
"nodes":[{{"mesh":0,"scale":[2,1,1]}},{{"camera":0,"translation":[0,0,3]}},
{{"extensions":{{"KHR_lights_punctual":{{"light":0}}}},"rotation":[0,0,0,1]}}],
"cameras":[{{"type":"perspective","perspective":{{"yfov":1,"znear":0.1}}}}],
"materials":[{{"name":"a","pbrMetallicRoughness":{{"baseColorFactor":[1,0.5,0,1],"metallicFactor":0.5}},
"emissiveFactor":[1,0,1],"doubleSided":true}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
{{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":6}}],
"buffers":[{{"byteLength":44{uri}}}]}}"#
    )
}

fn positions() -> Vec<u8> {
    let values = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0f32];
    let mut bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
    bytes.extend([0u16, 1, 2, 0].into_iter().flat_map(u16::to_le_bytes));
    bytes
}

pub(crate) fn gltf(bytes: &[u8]) -> bool {
    read("scene.gltf", bytes)
}

pub(crate) fn gltf_seeds() -> Vec<Vec<u8>> {
    let data = base64::engine::general_purpose::STANDARD.encode(positions());
    let uri = format!(r#","uri":"data:application/octet-stream;base64,{data}""#);
    vec![triangle(&uri).into_bytes(), dressed(&uri).into_bytes()]
}

/// The triangle with a skin, a morph target, colours, and materials of extensions; its positions are all of its
/// numbers.
fn dressed(uri: &str) -> String {
    let image = base64::engine::general_purpose::STANDARD.encode(include_bytes!("../seeds/two.png"));
    let material = r#"[{"normalTexture":{"index":0,"scale":0.5},"occlusionTexture":{"index":0},
"extensions":{"KHR_materials_clearcoat":{"clearcoatFactor":0.5,"clearcoatTexture":{"index":0}},
"KHR_materials_pbrSpecularGlossiness":{"diffuseTexture":{"index":0},"specularFactor":[1,0.5,0]}}},
{"extensions":{"KHR_materials_unlit":{}}}]"#;
    let primitive = |material: u32| {
        format!(
            r#"{{"attributes":{{"POSITION":0,"NORMAL":0,"COLOR_0":0,"TEXCOORD_0":2,"JOINTS_0":3,"WEIGHTS_0":4}},
"targets":[{{"POSITION":0}}],"indices":1,"material":{material}}}"#
        )
    };
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],
"nodes":[{{"mesh":0,"skin":0,"weights":[0.5],"children":[1]}},{{"translation":[1,0,0]}}],
"skins":[{{"joints":[1,0]}}],"materials":{material},
"textures":[{{"source":0}}],"images":[{{"uri":"data:image/png;base64,{image}"}}],
"meshes":[{{"weights":[1],"primitives":[{},{}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
{{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}},
{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC2"}},
{{"bufferView":2,"componentType":5121,"count":3,"type":"VEC4"}},
{{"bufferView":0,"componentType":5121,"count":3,"type":"VEC4","normalized":true}}],
"bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":6}},
{{"buffer":0,"byteLength":12}}],
"buffers":[{{"byteLength":44{uri}}}]}}"#,
        primitive(0),
        primitive(1)
    )
}

/// The JSON up to the first zero byte, and the binary chunk after it.
pub(crate) fn glb(bytes: &[u8]) -> bool {
    let at = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    let (json, binary) = (&bytes[..at], bytes.get(at + 1..).unwrap_or_default());
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, binary) = (pad(json, b' '), pad(binary, 0));
    let mut file = b"glTF".to_vec();
    for number in [2, (12 + 8 + json.len() + 8 + binary.len()) as u32, json.len() as u32] {
        file.extend(number.to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(&json);
    file.extend((binary.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(&binary);
    read("scene.glb", &file)
}

pub(crate) fn glb_seeds() -> Vec<Vec<u8>> {
    vec![
        [triangle("").as_bytes(), &[0], &positions()].concat(),
        [COMPRESSED.as_bytes(), &[0], include_bytes!("../seeds/square.drc")].concat(),
    ]
}

/// Eight triangles that Draco compressed, which are the binary chunk.
const COMPRESSED: &str = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
"extensionsRequired":["KHR_draco_mesh_compression"],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":0,"COLOR_0":1},"indices":2,"extensions":
{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{"POSITION":3,"NORMAL":2,"COLOR_0":0}}}}]}],
"accessors":[{"componentType":5126,"count":9,"type":"VEC3"},
{"componentType":5121,"count":9,"type":"VEC4","normalized":true},
{"componentType":5123,"count":24,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteLength":262}],"buffers":[{"byteLength":262}]}"#;

pub(crate) fn xml(bytes: &[u8]) -> bool {
    read("scene.xml", bytes)
}

pub(crate) fn xml_seeds() -> Vec<Vec<u8>> {
    let scene = r##"<?xml version="1.0"?>
<scene version="3.0.0"><default name="r" value="0.5"/>
<integrator type="path"><integer name="max_depth" value="9"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/><string name="fov_axis" value="smaller"/>
<transform name="to_world"><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
<film type="hdrfilm"><integer name="width" value="32"/></film></sensor>
<bsdf type="twosided" id="a"><bsdf type="roughplastic">
<rgb name="diffuse_reflectance" value="0.2"/></bsdf></bsdf>
<bsdf type="conductor" id="b"><rgb name="eta" value="0.2, 0.9, 1.1"/><rgb name="k" value="3"/></bsdf>
<bsdf type="mask" id="c"><float name="opacity" value="0.4"/><bsdf type="diffuse"/></bsdf>
<shape type="rectangle"><ref id="a"/><transform name="to_world"><rotate y="1" angle="30"/>
<matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/><scale x="2"/></transform></shape>
<shape type="cube"><bsdf type="dielectric"><string name="int_ior" value="bk7"/></bsdf></shape>
<shape type="cube"><bsdf type="roughdiffuse"><float name="alpha" value="0.3"/></bsdf></shape>
<shape type="sphere"><float name="radius" value="$r"/><ref id="c"/></shape>
<shape type="cylinder"><point name="p0" value="0,0,2"/><ref id="b"/></shape>
<shape type="disk"><emitter type="area"><rgb name="radiance" value="9"/></emitter></shape>
<texture type="checkerboard" id="t"/>
<emitter type="constant"/><emitter type="point"/><emitter type="directional"/>
<emitter type="spot"><float name="cutoff_angle" value="30"/></emitter></scene>"##;
    vec![scene.as_bytes().to_vec(), include_bytes!("../../fixtures/cornell-box.xml").to_vec()]
}

pub(crate) fn pbrt(bytes: &[u8]) -> bool {
    read("scene.pbrt", bytes)
}

pub(crate) fn pbrt_seeds() -> Vec<Vec<u8>> {
    let head = "Scale -1 1 1 LookAt 0 0 5 0 0 0 0 1 0 # a\nCamera \"perspective\" \"float fov\" 40\n\
                Film \"rgb\" \"integer xresolution\" [8] WorldBegin\n";
    let looks = "MakeNamedMaterial \"a\" \"string type\" \"conductor\" \"spectrum eta\" \"metal-Cu-eta\"\n\
        Texture \"t\" \"float\" \"constant\" \"float value\" 2\n\
        Texture \"s\" \"float\" \"scale\" \"texture tex\" \"t\" \"float scale\" -0.5\n\
        Material \"diffuse\" \"texture displacement\" \"s\" \"rgb reflectance\" [1 0.5 0]\n";
    let shapes = "AttributeBegin ReverseOrientation Rotate 30 0 1 0 AreaLightSource \"diffuse\" \"blackbody L\" 5000\n\
        Shape \"sphere\" \"float radius\" 0.5 AttributeEnd NamedMaterial \"a\"\n\
        ObjectBegin \"o\" Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" [0 0 0 1 0 0 0 1 0] ObjectEnd\n\
        ObjectInstance \"o\" Shape \"loopsubdiv\" \"integer levels\" 2 \"integer indices\" [0 1 2 0 2 3]\n\
        \"point3 P\" [-1 -1 0 1 -1 0 1 1 0 -1 1 0] Shape \"disk\" \"float alpha\" 0.5\n\
        LightSource \"infinite\" \"rgb L\" [1 1 1] LightSource \"spot\" \"point3 to\" [0 0 -1]\n";
    let lobes = "Material \"matte\" \"float sigma\" 20 Shape \"sphere\"\n\
        Material \"plastic\" \"rgb Kd\" [1 0 0] \"float roughness\" 0.1 Shape \"sphere\"\n\
        Material \"uber\" \"rgb opacity\" [0.5 1 0] \"rgb Kr\" [0 0 0] \"float eta\" 1.5 Shape \"disk\" \"float alpha\" 0.5\n\
        Material \"substrate\" \"float uroughness\" 0.1 \"float vroughness\" 0.2 Shape \"sphere\"\n\
        Material \"translucent\" \"rgb reflect\" [1 1 1] \"rgb transmit\" [0 1 0] Shape \"sphere\"\n\
        Material \"diffusetransmission\" \"rgb transmittance\" [1 0 0] \"float scale\" 2 Shape \"sphere\"\n";
    vec![format!("{head}{looks}{shapes}").into_bytes(), format!("{head}{lobes}").into_bytes()]
}

/// A file of a spectrum.
pub(crate) fn spectrum(bytes: &[u8]) -> bool {
    FOLDER.with(|folder| folder.write("a.spd", bytes));
    let xml = read(
        "spectrum.xml",
        br#"<scene version="3.0.0"><sensor type="perspective"/><emitter type="point">
<spectrum name="intensity" filename="a.spd"/></emitter></scene>"#,
    );
    read("spectrum.pbrt", b"WorldBegin LightSource \"point\" \"spectrum I\" \"a.spd\"") && xml
}

pub(crate) fn spectrum_seeds() -> Vec<Vec<u8>> {
    vec![b"# a\n400 0.5\n550.5 1e0\n700 0\n".to_vec(), b"400, 0.5\n 500 , 1\n".to_vec()]
}

/// A picture on a surface and around the scene: those without a mark are tried as TGA.
pub(crate) fn texture(bytes: &[u8]) -> bool {
    FOLDER.with(|folder| folder.write("a.tga", bytes));
    read(
        "texture.xml",
        br#"<scene version="3.0.0"><sensor type="perspective"/><shape type="rectangle"><bsdf type="bumpmap">
<texture type="bitmap"><string name="filename" value="a.tga"/></texture><bsdf type="diffuse"/></bsdf></shape>
<emitter type="envmap"><string name="filename" value="a.tga"/></emitter></scene>"#,
    )
}

pub(crate) fn texture_seeds() -> Vec<Vec<u8>> {
    // 2 by 1 pixels each
    let tga = [&[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 24, 0][..], &[1, 2, 3, 4, 5, 6]].concat();
    let packed = [&[0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 1, 0, 24, 0][..], &[0x81, 1, 2, 3]].concat();
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\x20\x80\x10\x20\x30\x81".to_vec();
    vec![tga, packed, hdr, include_bytes!("../seeds/two.png").to_vec()]
}

pub(crate) fn ply(bytes: &[u8]) -> bool {
    read_mesh("mesh.ply", "ply", bytes)
}

pub(crate) fn ply_seeds() -> Vec<Vec<u8>> {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment a\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nproperty float u\nproperty float v\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n"
        )
    };
    let text = header("ascii") + "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n3 0 1 2\n";
    let mut little = header("binary_little_endian").into_bytes();
    let mut big = header("binary_big_endian").into_bytes();
    for value in [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0f32] {
        little.extend(value.to_le_bytes());
        big.extend(value.to_be_bytes());
    }
    little.push(3);
    big.push(3);
    little.extend([0i32, 1, 2].map(i32::to_le_bytes).concat());
    big.extend([0i32, 1, 2].map(i32::to_be_bytes).concat());
    vec![text.into_bytes(), little, big]
}

pub(crate) fn obj(bytes: &[u8]) -> bool {
    read_mesh("mesh.obj", "obj", bytes)
}

pub(crate) fn obj_seeds() -> Vec<Vec<u8>> {
    let quad = "# a\no b\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n\
                g c\nusemtl d\ns 1\nf 1/1/1 2/2/1 3/3/1 4//1\nf -1 -2 -3\n";
    vec![quad.as_bytes().to_vec()]
}

/// The first four bytes are the version; the rest is compressed, by storing it.
pub(crate) fn serialized(bytes: &[u8]) -> bool {
    let (head, inside) = bytes.split_at(bytes.len().min(4));
    let mut encoder = ZlibEncoder::new(head.to_vec(), Compression::none());
    let packed = encoder.write_all(inside).and_then(|()| encoder.finish());
    let mut file = packed.expect("memory takes all");
    // Where the mesh begins, which version 4 says in eight bytes, and how many there are
    file.extend(vec![0; if head.get(2) == Some(&4) { 8 } else { 4 }]);
    file.extend(1u32.to_le_bytes());
    read_mesh("mesh.serialized", "serialized", &file)
}

pub(crate) fn serialized_seeds() -> Vec<Vec<u8>> {
    let seed = |version: u8, flags: u32, name: &[u8], colours: usize| {
        let mut bytes = vec![0x1c, 0x04, version, 0];
        bytes.extend(flags.to_le_bytes());
        bytes.extend(name);
        bytes.extend([3u64, 1].map(u64::to_le_bytes).concat());
        for i in 0..9 + 9 + 6 + colours {
            bytes.extend((i as f32 / 7.0).to_le_bytes());
        }
        bytes.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
        bytes
    };
    // Single precision with normals and coordinates; version 4 has a name, and may have colours
    vec![seed(3, 0x1003, b"", 0), seed(4, 0x100b, b"mesh\0", 9)]
}
