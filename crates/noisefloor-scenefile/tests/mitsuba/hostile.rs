use crate::util::Folder;
use noisefloor_scenefile::load;
use std::path::Path;

/// A scene with every kind of file, all small. `mesh.serialized` holds no names, so that every byte of it
/// matters.
fn folder() -> Folder {
    let quad = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nf 1/1/1 2/2/1 \
        3/3/1 4//1\n";
    let ascii = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        property float u\nproperty float v\nproperty float u_0\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 0 0 1\n1 0 0 1 0 1\n1 1 0 1 1 1\n3 0 1 2\n";
    let mut binary =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
            .to_vec();
    for v in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0f32] {
        binary.extend(v.to_le_bytes());
    }
    binary.push(3);
    binary.extend([0i32, 1, 2].map(i32::to_le_bytes).concat());
    Folder::new()
        .with("quad.obj", quad)
        .with("ascii.ply", ascii)
        .with("binary.ply", binary)
        .with("mesh.serialized", serialized())
        .with_png("picture.png", 2, &[[9, 200, 30, 255], [1, 2, 3, 4], [255, 0, 0, 0], [7, 7, 7, 7]])
        .with("picture.jpg", jpeg())
        .with(
            "picture.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x40\x20\x10\x80",
        )
        .with_exr("sky.exr", 4, &[[1.0, 2.0, 3.0]; 8])
        .with("scene.xml", SCENE)
}

const SCENE: &str = r##"<?xml version="1.0"?>
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

fn serialized() -> Vec<u8> {
    use std::io::Write;
    let mut inside = 0x1001u32.to_le_bytes().to_vec();
    inside.extend([3u64, 1].map(u64::to_le_bytes).concat());
    for v in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0f32] {
        inside.extend(v.to_le_bytes());
    }
    inside.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
    let mut encoder = flate2::write::ZlibEncoder::new(vec![0x1c, 0x04, 3, 0], flate2::Compression::default());
    encoder.write_all(&inside).unwrap();
    let mut bytes = encoder.finish().unwrap();
    bytes.extend(0u32.to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    bytes
}

fn jpeg() -> Vec<u8> {
    let pixels: Vec<u8> = (0..16 * 16 * 3).map(|i| (i * 7 % 256) as u8).collect();
    let mut bytes = Vec::new();
    image::codecs::jpeg::JpegEncoder::new(&mut bytes)
        .encode(&pixels, 16, 16, image::ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

/// Writes a file anew. To cut one short first makes some file systems wait for the disk.
fn replace(path: &Path, bytes: &[u8]) {
    std::fs::remove_file(path).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// Changed files are scenes or errors that name a file of the folder. That they never panic is seen by this
/// ending; the targets of `fuzz` try many more.
#[test]
fn changed_bytes_never_panic() {
    let folder = folder();
    let scene = folder.path().join("scene.xml");
    load(&scene).unwrap();
    let files = [
        "scene.xml",
        "quad.obj",
        "ascii.ply",
        "binary.ply",
        "mesh.serialized",
        "picture.png",
        "picture.jpg",
        "picture.hdr",
    ];
    let mut random = fastrand::Rng::with_seed(20);
    let mut broken = 0;
    for round in 0..400 {
        let path = folder.path().join(files[round % files.len()]);
        let original = std::fs::read(&path).unwrap();
        let mut bytes = original.clone();
        for _ in 0..1 + random.usize(..4) {
            let at = random.usize(..bytes.len());
            match random.usize(..5) {
                0 => bytes[at] ^= 1 << random.usize(..8),
                // What numbers and brackets are made of
                1 => bytes[at] = b"0123456789-+.eE<>/\"'= \n$#&x"[random.usize(..27)],
                2 => bytes[at] = [0x00, 0x01, 0x7f, 0x80, 0xff][random.usize(..5)],
                3 => bytes.truncate(at.max(1)),
                _ => {
                    let end = (at + 1 + random.usize(..40)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    bytes.splice(at..at, piece);
                }
            }
        }
        replace(&path, &bytes);
        if let Err(error) = load(&scene) {
            broken += 1;
            let folder = folder.path().display().to_string();
            assert!(error.to_string().contains(&folder), "round {round}: {error}");
        }
        replace(&path, &original);
    }
    // Most changes matter
    assert!(broken > 100, "{broken}");
}

/// Any number of shapes can name one mesh that inflates a thousandfold: all together are in proportion to the files.
#[test]
fn inflated_meshes_count_together() {
    use std::io::Write;
    let vertices = 1 << 19;
    let mut inside = 0x1000u32.to_le_bytes().to_vec();
    inside.extend(b"\0");
    inside.extend([vertices as u64, 1].map(u64::to_le_bytes).concat());
    inside.extend(vec![0; 12 * vertices]);
    inside.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
    let mut encoder = flate2::write::ZlibEncoder::new(vec![0x1c, 0x04, 4, 0], flate2::Compression::default());
    encoder.write_all(&inside).unwrap();
    let mut bytes = encoder.finish().unwrap();
    bytes.extend(0u64.to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    assert!(bytes.len() < 10_000);
    let shape = r#"<shape type="serialized"><string name="filename" value="mesh.serialized"/></shape>"#;
    let scene = |shapes: usize| {
        format!(r#"<scene version="3.0.0"><sensor type="perspective"/>{}</scene>"#, shape.repeat(shapes))
    };
    let folder = Folder::new().with("mesh.serialized", bytes).with("scene.xml", scene(40));
    let error = load(&folder.path().join("scene.xml")).unwrap_err().to_string();
    assert!(error.contains("inflated bytes so far, more than"), "{error}");
}
