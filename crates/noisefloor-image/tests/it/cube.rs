use noisefloor::display::{CubeError, LutInput, parse_cube};
use noisefloor::{Params, ToneMapping, display::srgb_encode};
use noisefloor_image::read_cube;

/// A cube whose entry at (r, g, b) is `value` of these, in [0, 1].
fn cube(size: usize, head: &str, value: impl Fn([f32; 3]) -> [f32; 3]) -> String {
    let mut text = format!("TITLE \"a # b\"\n# made by a test\nLUT_3D_SIZE {size}\n{head}\n");
    let place = |i: usize| i as f32 / (size - 1) as f32;
    for i in 0..size.pow(3) {
        let [r, g, b] = value([place(i % size), place(i / size % size), place(i / size / size)]);
        text += &format!("{r} {g} {b}\n");
    }
    text
}

fn near(a: [f32; 3], b: [f32; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6)
}

#[test]
fn a_cube_that_changes_nothing_changes_nothing() {
    let lut = parse_cube(cube(5, "", |c| c).as_bytes()).unwrap();
    for colour in [[0.0; 3], [1.0; 3], [0.1, 0.55, 0.99], [0.25, 0.5, 0.75]] {
        assert!(near(lut.map(colour), colour), "{colour:?}: {:?}", lut.map(colour));
    }
    assert!(near(lut.map([-1.0, 7.0, f32::NAN]), [0.0, 1.0, 0.0]));
    // As Windows writes it, with a byte order mark
    let marked = [b"\xef\xbb\xbfLUT_3D_SIZE 2\n".as_slice(), "1 1 1\n".repeat(8).as_bytes()].concat();
    assert!(near(parse_cube(&marked).unwrap().map([0.0; 3]), [1.0; 3]));
}

/// What is linear in each channel is interpolated exactly.
#[test]
fn red_is_fastest_and_what_lies_between_is_mixed() {
    let swap = |[r, g, b]: [f32; 3]| [b, r * g, 1.0 - g];
    let lut = parse_cube(cube(3, "", swap).as_bytes()).unwrap();
    for colour in [[0.0, 0.5, 1.0], [0.5, 1.0, 0.0], [0.25, 0.5, 0.7]] {
        assert!(near(lut.map(colour), swap(colour)), "{colour:?}");
    }
}

#[test]
fn the_domain_is_what_the_entries_span() {
    let wide = parse_cube(cube(2, "DOMAIN_MIN 0 0 0\nDOMAIN_MAX 4 4 4", |c| c).as_bytes()).unwrap();
    assert!(near(wide.map([1.0, 2.0, 4.0]), [0.25, 0.5, 1.0]));
    let above = parse_cube(cube(2, "DOMAIN_MIN 2 2 2\nDOMAIN_MAX 4 4 4", |c| c).as_bytes()).unwrap();
    assert!(near(above.map([1.0, 3.0, 4.0]), [0.0, 0.5, 1.0]));
    let curve = parse_cube(b"LUT_1D_SIZE 3\nLUT_1D_INPUT_RANGE 0 2\n0 0 1\n.5 1 1\n1e0 0 1\r\n").unwrap();
    assert!(near(curve.map([1.0, 1.5, 9.0]), [0.5, 0.5, 1.0]));
}

/// As Resolve writes them: a curve that brings radiance into the cube.
#[test]
fn a_curve_may_come_before_a_cube() {
    let mut text = "LUT_1D_SIZE 2\nLUT_1D_INPUT_RANGE 0 8\nLUT_3D_SIZE 2\n0 0 0\n1 1 1\n".to_owned();
    for i in 0..8 {
        text += &format!("{} {} {}\n", 1 - i % 2, 1 - i / 2 % 2, 1 - i / 4);
    }
    let lut = parse_cube(text.as_bytes()).unwrap();
    assert!(near(lut.map([0.0, 2.0, 8.0]), [1.0, 0.75, 0.0]));
}

#[test]
fn broken_ones_are_errors_that_say_where() {
    let error = |text: &str| parse_cube(text.as_bytes()).unwrap_err();
    assert_eq!(error(""), CubeError::NoSize);
    assert_eq!(error("0 0 0\n"), CubeError::NoSize);
    assert_eq!(error("LUT_1D_SIZE 2\n0 0 0\n"), CubeError::Entries { expected: 2, got: 1 });
    assert_eq!(error("LUT_1D_SIZE 2\n0 0 0\n1 1 1\n2 2 2\n"), CubeError::Entries { expected: 2, got: 3 });
    assert_eq!(error("LUT_1D_SIZE 2\nDOMAIN_MAX 1 1 0\n0 0 0\n1 1 1\n"), CubeError::Domain);
    // Sizes that the text cannot pay for
    assert_eq!(error("LUT_3D_SIZE 129\n0 0 0\n"), CubeError::Short { expected: 2_146_689, bytes: 22 });
    for (text, at) in [
        ("LUT_3D_SIZE 130\n", 1),
        ("LUT_3D_SIZE 1\n", 1),
        ("LUT_1D_SIZE 65537\n", 1),
        ("# a\n\nLUT_3D_SIZE -2\n", 3),
        ("LUT_1D_SIZE 2\nLUT_IN_VIDEO_RANGE\n", 2),
        ("LUT_1D_SIZE 2\nDOMAIN_MIN nan 0 0\n", 2),
        ("LUT_1D_SIZE 2\n0 0 0\n1 1\n", 3),
        ("LUT_1D_SIZE 2\n0 0 0\n1 1 inf\n", 3),
        ("LUT_1D_SIZE 2\n0 0 0\nDOMAIN_MAX 1 1\n", 3),
        ("LUT_1D_SIZE 2\n0 0 0\nnan 1 1\n", 3),
    ] {
        let error = error(text);
        assert!(matches!(error, CubeError::Line { line, .. } if line == at), "{text:?}: {error:?}");
    }
    assert!(error("lut_1d_size 2\nFOO 1\n").to_string().contains("the keyword \"FOO\" is not known"));
    // Files that stand for others
    let pointer = error("version https://git-lfs.github.com/spec/v1\noid sha256:aa\nsize 12\n").to_string();
    assert!(pointer.contains("Git LFS pointer") && pointer.contains("git lfs pull"), "{pointer}");
    for page in ["<!DOCTYPE html><html>", "\u{feff}\n<HTML>"] {
        assert!(error(page).to_string().contains("web page"), "{page}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.cube");
    std::fs::write(&path, "LUT_3D_SIZE 2\n0 0 0\n").unwrap();
    let said = read_cube(&path).unwrap_err().to_string();
    assert!(said.contains("a.cube") && said.contains("the 8 entries"), "{said}");
    assert!(read_cube(folder.path()).is_err() && read_cube(folder.path().join("none")).is_err());
}

#[test]
fn radiance_is_encoded_as_the_lut_expects_it() {
    let encoded = |text: &str, linear: f32| text.parse::<LutInput>().unwrap().encode(linear);
    assert_eq!(encoded("linear", 3.5), 3.5);
    assert_eq!(encoded("srgb", 0.18), srgb_encode(0.18));
    // Two stops above middle grey, on a scale of −10 to +6
    assert!((encoded("log2:-10,6", 0.72) - 12.0 / 16.0).abs() < 1e-6);
    assert_eq!((encoded("log2:-10,6", 0.0), encoded("log2:-10,6", 1e9)), (0.0, 1.0));
    // S-2016-001, table 1 of ACEScct: 0.18 → 0.4135884, 0 → 0.0729055
    assert!((encoded("acescct", 0.18) - 0.413_588_4).abs() < 1e-6);
    assert!((encoded("acescct", 0.0) - 0.072_905_53).abs() < 1e-7);
    for wrong in ["", "log", "log2:", "log2:1,1", "log2:2,1", "log2:nan,1", "linear "] {
        assert!(wrong.parse::<LutInput>().is_err(), "{wrong:?}");
    }
}

/// A LUT of the sRGB curve is sRGB; its identity is what it does, not how it is written.
#[test]
fn a_lut_is_a_tone_mapping() {
    let text = |comment: &str| {
        let mut text = format!("# {comment}\nLUT_1D_SIZE 4096\n");
        for i in 0..4096 {
            let v = srgb_encode(i as f32 / 4095.0);
            text += &format!("{v} {v} {v}\n");
        }
        text
    };
    let curve = |text: &str, input| parse_cube(text.as_bytes()).unwrap().into_tone_curve(input);
    let one = curve(&text("one"), LutInput::Linear);
    let tone = ToneMapping::Custom { exposure: 2.0, curve: one.clone() };
    assert!(Params::default().with_tone_mapping(tone.clone()).check().is_ok());
    let (lut, srgb) = (tone.settle(&[]), ToneMapping::Srgb { exposure: 2.0 }.settle(&[]));
    for value in [0.0, 0.001, 0.1, 0.3, 0.49, 0.7] {
        let (a, b) = (lut.luma([value; 3]), srgb.luma([value; 3]));
        // Between its entries a straight line, which is off by a step of 8 bits near black
        assert!((a - b).abs() < 1.0 / 255.0, "{value}: {a} {b}");
    }
    assert_eq!(one, curve(&text("two"), LutInput::Linear));
    assert_ne!(one, curve(&text("one"), LutInput::Srgb));
}

/// One table in every spelling that programs write: ends of lines, encodings, ends of files, and the domain after it.
#[test]
fn odd_spellings_are_the_same_table() {
    let plain = "LUT_1D_SIZE 2\nDOMAIN_MAX 2 2 2\n0 0 0\n1 0.5 0.25\n";
    let known = parse_cube(plain.as_bytes()).unwrap();
    assert!(near(known.map([2.0; 3]), [1.0, 0.5, 0.25]));
    let wide = |order: fn(u16) -> [u8; 2], text: &str| -> Vec<u8> {
        [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(order).collect()
    };
    let late = "LUT_1D_SIZE 2\n0 0 0\n1 0.5 0.25\nDOMAIN_MAX 2 2 2";
    for (called, bytes) in [
        ("CR", plain.replace('\n', "\r").into_bytes()),
        ("CRLF", plain.replace('\n', "\r\n").into_bytes()),
        ("UTF-16LE", wide(u16::to_le_bytes, plain)),
        ("UTF-16BE", wide(u16::to_be_bytes, plain)),
        ("^Z", [plain.as_bytes(), b"\x1a"].concat()),
        ("NUL", [plain.as_bytes(), b"\0\n"].concat()),
        ("lower case", plain.to_lowercase().into_bytes()),
        ("domain last", late.as_bytes().to_vec()),
    ] {
        assert_eq!(parse_cube(&bytes).as_ref(), Ok(&known), "{called}");
    }
}
