//! Buffer views that meshoptimizer 1.3.0 compressed: a square, its texture coordinates and its corners.

use crate::kit::{Maker, json, render};

const POSITIONS: &str = "\
    a00000000133000000ffff000000010c000000ff00000000000000000000000000000000000000000000000000 \
    0080bf000080bf000080bf";
const UVS: &str = "\
    a000000133000000ffff01330000007e7d0000010c000000ff010c0000007d0000000000000000000000000000 \
    00000000000000000000000000000000803f";
const INDICES: &str = "\
    e1f000007687566778a9866589689801690000";

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u32> = hex.chars().filter_map(|c| c.to_digit(16)).collect();
    digits.chunks(2).map(|pair| (pair[0] << 4 | pair[1]) as u8).collect()
}

/// The square with a picture that shines.
fn square() -> Maker {
    let mut maker = Maker::new();
    let material = r#"{"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}"#;
    let mesh = maker.rectangle([-1.0, 1.0], [-1.0, 1.0], -1.0, material);
    maker.texture(2, &[[255, 80, 0, 255], [0, 255, 90, 255], [70, 0, 255, 255], [255; 4]], "{}");
    maker.node(&format!(r#"{{"mesh": {mesh}}}"#));
    maker
}

/// The same, compressed. The buffer that other readers would take has no data.
fn compressed() -> Maker {
    let mut maker = square();
    let mut data = vec![];
    for (view, (hex, stride, count, mode)) in
        [(POSITIONS, 12, 4, "ATTRIBUTES"), (UVS, 8, 4, "ATTRIBUTES"), (INDICES, 2, 6, "TRIANGLES")]
            .into_iter()
            .enumerate()
    {
        let (start, bytes) = (data.len(), bytes(hex));
        let extension = format!(
            r#"{{"EXT_meshopt_compression": {{"buffer": 1, "byteOffset": {start}, "byteLength": {},
                "byteStride": {stride}, "count": {count}, "mode": "{mode}"}}}}"#,
            bytes.len()
        );
        data.extend(bytes);
        maker.root["bufferViews"][view]["extensions"] = json(&extension);
    }
    maker.bytes = data;
    let fallback = r#"{"byteLength": 120, "extensions": {"EXT_meshopt_compression": {"fallback": true}}}"#;
    let there = format!(r#"{{"byteLength": {}}}"#, maker.bytes.len());
    maker.root["buffers"] = json(&format!("[{fallback}, {there}]"));
    maker.root["extensionsRequired"] = json(r#"["EXT_meshopt_compression"]"#);
    maker.root["extensionsUsed"] = json(r#"["EXT_meshopt_compression"]"#);
    uri(&mut maker);
    maker
}

/// Puts the bytes beside the JSON, as the second buffer.
fn uri(maker: &mut Maker) {
    let base64 = crate::kit::base64(&maker.bytes);
    maker.root["buffers"][1]["uri"] = format!("data:application/octet-stream;base64,{base64}").into();
}

#[test]
fn compressed_views_are_read() {
    let loaded = compressed().load().unwrap();
    assert_eq!(loaded.warnings, square().load().unwrap().warnings);
    assert_eq!(render(loaded, 16, 4, 1), render(square().load().unwrap(), 16, 4, 1));
}

#[test]
fn bad_views_are_named() {
    let place = "/bufferViews/0/extensions/EXT_meshopt_compression";
    let set = |key: &str, value: &str| {
        let mut maker = compressed();
        maker.root.pointer_mut(place).unwrap()[key] = json(value);
        maker
    };
    let mut cut = compressed();
    cut.bytes[0] = 0xa1;
    uri(&mut cut);
    for (maker, what) in [
        (set("count", "null"), "it needs a `count`"),
        (set("count", "200"), "its data is broken, or of a later version"),
        (set("count", "99999999"), "bytes of compressed data, more than"),
        (set("byteStride", "3"), "4 elements of 3 bytes are no ATTRIBUTES (NONE)"),
        (set("byteStride", "0"), "4 elements of 0 bytes are no ATTRIBUTES (NONE)"),
        (set("filter", r#""QUATERNION""#), "4 elements of 12 bytes are no ATTRIBUTES (QUATERNION)"),
        (
            set("filter", r#""COLOR""#),
            r#"data of the mode "ATTRIBUTES" with the filter "COLOR" is not supported"#,
        ),
        (set("mode", r#""INDICES""#), "4 elements of 12 bytes are no INDICES (NONE)"),
        (set("byteLength", "20"), "its data is broken"),
        (set("byteLength", "7777"), "reach past the end of buffer 1"),
        (set("buffer", "7"), "buffer 7 does not exist"),
        (cut, "its data is broken, or of a later version"),
    ] {
        let error = maker.load().err().unwrap_or_else(|| panic!("loads, not {what}")).to_string();
        assert!(
            error.contains("buffer view 0, EXT_meshopt_compression: ") && error.contains(what),
            "{error}"
        );
    }
}

/// Any number of views can name the same data, which stands for 64 times as much: what all become together is in
/// proportion to the file.
#[test]
fn views_of_the_same_data_count_together() {
    // Blocks of 256 elements of 32 bytes that are all alike
    let blocks = 800;
    let data = [&[0xa0][..], &vec![0; 128 * blocks + 32]].concat();
    let count = 256 * blocks;
    let bomb = |views: usize| {
        let mut maker = square();
        let view = maker.view(&data, "");
        let start = maker.root["bufferViews"][view]["byteOffset"].clone();
        for _ in 0..views {
            let extension = format!(
                r#"{{"EXT_meshopt_compression": {{"buffer": 0, "byteOffset": {start}, "byteLength": {},
                    "byteStride": 32, "count": {count}, "mode": "ATTRIBUTES"}}}}"#,
                data.len()
            );
            let view = format!(r#"{{"buffer": 0, "byteLength": {}, "extensions": {extension}}}"#, 32 * count);
            maker.push("bufferViews", &view);
        }
        maker.load()
    };
    bomb(2).unwrap();
    let error = bomb(100).unwrap_err().to_string();
    assert!(error.contains("inflated bytes so far, more than"), "{error}");
}
