use crate::util::{CAMERA, Folder, close, fails, ply, seen, serialized};

const RECTANGLE: &str = r#"<shape type="rectangle"/>"#;

fn folder() -> Folder {
    Folder::new()
        .with("broken.png", b"\x89PNG\r\n\x1a\nand so on")
        .with("text.png", "not a picture")
        .with("empty.obj", "")
        .with("curves.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\ncurv 0 1 1 2\n")
        .with("empty.ply", ply("", &[], &[]))
        .with("page.obj", "\n<!DOCTYPE html>\n<html><body>404</body></html>\n")
        .with("bad.obj", "v 0 0 0\nf 1 2 3\n")
        .with("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 1 2\nf 1 2 2\n")
        .with("short.ply", "ply\nformat ascii 1.0\nelement vertex 99\nproperty float x\nend_header\n0\n")
        .with("bad.serialized", [0x1c, 0x04, 0x04, 0x00, 1, 2, 3])
        .with_exr("nan.exr", 1, &[[f32::NAN, 0.0, 0.0]])
        .with_png("good.png", 1, &[[1, 2, 3, 4]])
}

/// Loads each body, which must fail with a message that contains the text.
#[track_caller]
fn all_fail(bodies: &[(String, &str)]) {
    let folder = folder();
    for (body, want) in bodies {
        fails(folder.body(body), want);
    }
}

fn mesh(kind: &str, name: &str) -> String {
    format!("\n<shape type='{kind}'><string name='filename' value='{name}'/></shape>")
}

fn bitmap(name: &str) -> String {
    let file = format!("<string name='filename' value='{name}'/>");
    diffuse(&format!("<texture type='bitmap' name='reflectance'>{file}</texture>"))
}

fn diffuse(inside: &str) -> String {
    of("diffuse", inside)
}

fn reflectance(tag: &str, value: &str) -> String {
    diffuse(&format!("<{tag} name='reflectance' value='{value}'/>"))
}

fn of(kind: &str, inside: &str) -> String {
    bsdf(&format!("<bsdf type='{kind}'>{inside}</bsdf>"))
}

fn shape(kind: &str, inside: &str) -> String {
    format!("<shape type='{kind}'>{inside}</shape>")
}

fn bsdf(inside: &str) -> String {
    format!("<shape type='rectangle'>\n{inside}</shape>")
}

fn light(inside: &str) -> String {
    format!("<shape type='rectangle'><emitter type='area'>\n{inside}</emitter></shape>")
}

fn move_by(inside: &str) -> String {
    format!("<shape type='rectangle'><transform name='to_world'>\n{inside}</transform></shape>")
}

#[test]
fn missing_and_broken_files_are_named() {
    let outside = if cfg!(windows) { "C:\\x.png" } else { "/etc/hostname" };
    all_fail(&[
        (bitmap("missing.png"), "scene.xml: line 3: cannot be read: `"),
        (bitmap("../good.png"), "scene.xml: line 3: `../good.png` lies outside the folder of the scene"),
        (bitmap("a/../../good.png"), "lies outside the folder of the scene"),
        (bitmap(outside), "lies outside the folder of the scene"),
        (bitmap("."), "line 3: cannot be read: `"),
        (bitmap("broken.png"), "broken.png: the picture is broken"),
        (
            bitmap("text.png"),
            "text.png: a picture that is neither PNG, JPEG, WebP, BMP, TGA, PFM, OpenEXR nor Radiance is not",
        ),
        (bitmap("nan.exr"), "line 3: the picture has values that are not finite"),
        (mesh("obj", "bad.obj"), "bad.obj: line 2: `2`: there is no position 2"),
        (mesh("ply", "short.ply"), "short.ply: the header asks for more elements than the file holds"),
        (mesh("serialized", "bad.serialized"), "bad.serialized: mesh 0: the file is cut short"),
        (mesh("obj", "missing.obj"), "line 3: cannot be read"),
        (mesh("obj", "empty.obj"), "empty.obj: the OBJ file has no faces"),
        (mesh("obj", "page.obj"), "page.obj: this is a web page (HTML), not the file itself"),
        ("<shape type='obj'/>".to_owned(), "line 2: <shape type=\"obj\"> needs a `filename`"),
        (format!("<include filename='b.xml'/>{RECTANGLE}"), "line 2: cannot be read"),
    ]);
}

#[test]
fn unsupported_kinds_are_named() {
    all_fail(&[
        ("\n<shape type='hair'/>".to_owned(), "line 3: <shape type=\"hair\"> is not supported"),
        (
            bsdf("<bsdf type='hair'/>"),
            "line 3: <bsdf type=\"hair\"> (`--source mitsuba` has it) is not supported",
        ),
        (bsdf("<bsdf type='twosided'/>"), "line 3: <bsdf type=\"twosided\"> needs a <bsdf> in it"),
        (
            of("mask", "<bsdf type='diffuse'/><bsdf type='diffuse'/>"),
            "with more than one <bsdf> in it is not supported",
        ),
        (
            of("mask", "<bsdf type='mask'><bsdf type='diffuse'/></bsdf>"),
            "line 3: a mask in a mask is not supported",
        ),
        (bsdf("<bsdf type='diffuse'/><bsdf type='diffuse'/>"), "line 3: a shape has at most one bsdf"),
        (bsdf("<emitter type='area'/><emitter type='area'/>"), "line 3: a shape has at most one emitter"),
        (bsdf("<emitter type='ies'/>"), "line 3: <emitter type=\"ies\"> in a shape is not supported"),
        ("<emitter type='ies'/>".to_owned(), "line 2: <emitter type=\"ies\"> is not supported"),
    ]);
}

#[test]
fn bad_values_are_named() {
    all_fail(&[
        (reflectance("rgb", "1 2"), "line 3: 2 numbers; a colour has 1 or 3"),
        (reflectance("rgb", "-1"), "is negative or too large"),
        (reflectance("rgb", "inf"), "line 3: `inf` is not a finite number"),
        (diffuse("<rgb name='reflectance'/>"), "line 3: `reflectance` has no value"),
        (reflectance("string", "red"), "line 3: `reflectance` is a <string>; expected <rgb>, <srgb>"),
        (reflectance("srgb", "#12345"), "line 3: `#12345` is not a colour like #80ff00"),
        (reflectance("srgb", "#12345é"), "is not a colour like #80ff00"),
        (reflectance("srgb", "#12345g"), "line 3: `#12345g` is not a colour like #80ff00"),
        (reflectance("spectrum", "500:0.1, 400:0.2"), "line 3: the wavelengths of a spectrum must rise"),
        (
            diffuse("<texture type='wood' name='reflectance'/>"),
            "line 3: <texture type=\"wood\" name=\"reflectance\"> is not supported",
        ),
        (
            of("plastic", "<float name='int_ior' value='1'/><float name='ext_ior' value='2'/>"),
            "line 2: an index of refraction is 0.5, outside 1…4",
        ),
        (of("dielectric", "<float name='int_ior' value='0'/>"), "line 3: `int_ior` must be above 0"),
        (
            of("dielectric", "<string name='int_ior' value='jelly'/>"),
            "line 3: the material `jelly` (known: vacuum, helium",
        ),
        (of("conductor", "<rgb name='eta' value='1'/>"), "line 3: give both `eta` and `k`, or `material`"),
        (light("<string name='radiance' value='1'/>"), "line 3: `radiance` is a <string>"),
        (light("<rgb name='radiance' value='1e13'/>"), "scene.xml: line 2: "),
        (
            light(
                "<ref name='radiance' id='x'/></emitter></shape><bsdf type='diffuse' id='x'/>\
            <shape type='cube'><emitter type='area'>",
            ),
            "expected a texture",
        ),
        (
            shape("rectangle", "<boolean name='flip_normals' value='maybe'/>"),
            "line 2: `maybe` is neither true nor false",
        ),
        (shape("sphere", "<float name='radius' value='one'/>"), "line 2: `one` is not a finite number"),
        (shape("sphere", "<float name='radius' value='0'/>"), "line 2: the radius of a sphere is 0"),
        (
            shape("sphere", "<float name='center' value='0'/>"),
            "line 2: `center` is a <float>; expected a point or vector",
        ),
        (
            mesh("serialized", "bad.serialized'/><integer name='shape_index' value='-1"),
            "line 3: `shape_index` is negative",
        ),
        (
            shape("rectangle", "<float name='to_world' value='1'/>"),
            "line 2: `to_world` is a <float>; expected a transform",
        ),
    ]);
}

#[test]
fn bad_transforms_are_named() {
    all_fail(&[
        (move_by("<twist x='1'/>"), "line 3: <twist> in a transform is not supported"),
        (move_by("<rotate y='1'/>"), "line 3: a rotation needs an angle"),
        (move_by("<rotate angle='1'/>"), "line 3: a rotation needs an axis that is not 0"),
        (move_by("<matrix value='1 2 3'/>"), "line 3: 3 numbers; a matrix has 9 or 16"),
        (
            move_by("<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1'/>"),
            "line 3: a matrix whose last row is not 0 0 0 1 is not supported",
        ),
        (move_by("<lookat origin='1,2,3' target='1,2,3'/>"), "line 3: origin and target are the same"),
        (move_by("<lookat origin='1,2,3'/>"), "line 3: `target` is missing"),
        (move_by("<translate x='1e300'/><scale value='1e300'/>"), "line 2: the transform is too large"),
        (move_by("<translate x='1e9'/>"), "line 2: "),
    ]);
}

#[cfg(unix)]
#[test]
fn links_do_not_lead_out() {
    let elsewhere = Folder::new().with_png("a.png", 1, &[[1, 2, 3, 4]]);
    let folder = Folder::new();
    std::os::unix::fs::symlink(elsewhere.path(), folder.path().join("link")).unwrap();
    let body = "<emitter type='envmap'><string name='filename' value='link/a.png'/></emitter>";
    fails(folder.body(body), "`link/a.png` lies outside the folder of the scene");
}

/// What is left out is warned of, with its line; what makes no difference is not.
#[test]
fn warnings_say_what_is_left_out() {
    let folder = folder();
    for (body, want) in [
        (mesh("obj", "flat.obj"), "2 of 3 faces have no area and are left out"),
        (mesh("ply", "empty.ply"), "the mesh has no faces, as its file says"),
        (mesh("obj", "curves.obj"), "line 5: `curv` of `curves.obj` is ignored"),
        (move_by("<scale value='2' x='3'/>"), "the attribute `x` of <scale> is ignored"),
        (bsdf("<float name='unheard_of' value='1'/>"), "<float name=\"unheard_of\"> is ignored"),
        ("\n<volume type='grid'/>".to_owned(), "<volume type=\"grid\"> is ignored"),
        (
            of("roughplastic", "<string name='distribution' value='phong'/>"),
            "the distribution `phong` is replaced by `beckmann`",
        ),
        (
            of("dielectric", "<float name='specular_reflectance' value='0.5'/>"),
            "`specular_reflectance` [0.5, 0.5, 0.5] is ignored: it is 1",
        ),
    ] {
        let warnings = folder.body(&body).unwrap_or_else(|e| panic!("{body}: {e}")).warnings;
        let [warning] = warnings.as_slice() else { panic!("{body}: {warnings:?}") };
        assert!(warning.to_string().ends_with(&format!("scene.xml: line 3: {want}")), "{warning}");
    }
    // As many as ten thousand
    let many = "<x/>\n".repeat(20_000);
    let warnings = folder.body(&many).unwrap().warnings;
    assert_eq!(warnings.len(), 10_001);
    assert!(warnings[10_000].to_string().ends_with("scene.xml: further warnings are left out"));
}

#[test]
fn what_is_no_scene_is_an_error() {
    let folder = Folder::new();
    for (text, want) in [
        ("", "scene.xml: line 1: the XML is broken"),
        ("<scene version='3.0.0'>\n<a></scene>", "scene.xml: line 2: the XML is broken"),
        ("<world version='3.0.0'/>", "expected <scene version=\"…\"> of Mitsuba"),
        ("<scene/>", "expected <scene version=\"…\"> of Mitsuba"),
        ("<scene version='new'/>", "expected <scene version=\"…\"> of Mitsuba"),
        ("<scene version='4.0.0'/>", "version 4.0.0 of Mitsuba's scenes is not supported"),
        ("<!DOCTYPE x [<!ENTITY a 'b'>]><scene version='3.0.0'/>", "the scene has no <sensor>"),
        (
            "<scene version='3.0.0'/>\n<scene version='3.0.0'/>",
            "line 2: the XML is broken: something follows",
        ),
        (
            "<scene version='3.0.0'>\n<default name='a'/></scene>",
            "line 2: a <default> needs a name and a value",
        ),
    ] {
        fails(folder.load(text), want);
    }
    std::fs::write(folder.path().join("bytes.xml"), [0xff, 0xfe]).unwrap();
    fails(
        noisefloor_scenefile::load(&folder.path().join("bytes.xml")),
        "the XML is broken: it has no element",
    );
    fails(noisefloor_scenefile::load(&folder.path().join("none.xml")), "cannot be read");
}

/// What would take long, or much memory, or the stack, is refused at once.
#[test]
fn what_is_too_large_is_an_error() {
    let folder = Folder::new();
    let scene = |inside: &str| format!("<scene version='3.0.0'>{CAMERA}{inside}</scene>");
    let deep = scene(&("<a>".repeat(100_000) + &"</a>".repeat(100_000)));
    fails(folder.load(&deep), "33 levels of elements, more than 32");
    let attributes: String = (0..200_000).map(|i| format!(" b{i}='1'")).collect();
    fails(folder.load(&scene(&format!("<a{attributes}/>"))), "attributes of one element, more than 64");
    let spaces: String = (0..3000).map(|i| format!("<a xmlns:n{i}='u{i}'>")).collect();
    fails(folder.load(&scene(&spaces)), "33 levels of elements, more than 32");
    fails(folder.load(&scene(&"<a/>".repeat(1 << 20))), "elements, more than 1048576");

    // Twenty doublings of a hundred bytes
    let mut bomb = format!("<default name='p0' value='{}'/>", "x".repeat(100));
    for i in 0..20 {
        bomb += &format!("<default name='p{}' value='$p{i}$p{i}'/>", i + 1);
    }
    fails(folder.load(&scene(&bomb)), "bytes in parameters, more than 67108864");

    // A PNG whose header claims more than its bytes can hold, and one above the limit
    for (width, height, want) in [
        (8000u32, 8000u32, "bytes cannot hold 8000×8000 pixels"),
        (65_000, 65_000, "4225000000 pixels, more than"),
    ] {
        let header =
            [b"IHDR".as_slice(), &width.to_be_bytes(), &height.to_be_bytes(), &[8, 2, 0, 0, 0]].concat();
        let chunk = |data: &[u8]| {
            let mut crc = flate2::Crc::new();
            crc.update(data);
            [&(data.len() as u32 - 4).to_be_bytes(), data, &crc.sum().to_be_bytes()].concat()
        };
        let png = [b"\x89PNG\r\n\x1a\n".to_vec(), chunk(&header), chunk(b"IDAT")].concat();
        let folder = Folder::new().with("a.png", png);
        fails(folder.body("<emitter type='envmap'><string name='filename' value='a.png'/></emitter>"), want);
    }
}

/// A few hundred bytes can ask for what never ends: depth, cycles and cost of all that nests are bounded.
#[test]
fn what_nests_is_bounded() {
    let folder = Folder::new().with_png("a.png", 1, &[[9; 4]]);
    let checkers = |count: usize, last: &str| {
        let mut all = String::new();
        for i in 0..count {
            let next = if i + 1 == count { last.to_owned() } else { format!("c{}", i + 1) };
            all += &format!(
                "<texture type='checkerboard' id='c{i}'><ref name='color0' id='{next}'/>\
                 <ref name='color1' id='{next}'/></texture>\n"
            );
        }
        let leaf = "<texture type='bitmap' id='leaf'><string name='filename' value='a.png'/></texture>";
        let shape =
            "<shape type='cube'><bsdf type='diffuse'><ref name='reflectance' id='c0'/></bsdf></shape>";
        format!("{all}{leaf}{shape}")
    };
    let mixture = |count: usize, part: &str| {
        let weights = vec!["0.001"; count].join(", ");
        format!(
            "<bsdf type='mixturebsdf' id='{count}'><string name='weights' value='{weights}'/>{}</bsdf>",
            part.repeat(count)
        )
    };
    let grey = "<bsdf type='diffuse'/>";
    let worn = |bsdf: &str| format!("<shape type='cube'>{bsdf}</shape>");
    let sky = "<emitter type='sky'/>\n";
    let blends = (0..20).fold(grey.to_owned(), |inside, i| {
        format!("<bsdf type='blendbsdf' id='b{i}'>{inside}<ref id='b{}'/></bsdf>", i - 1)
            .replace("<ref id='b-1'/>", grey)
    });
    for (body, want) in [
        (checkers(1, "c0"), "<texture type=\"checkerboard\" id=\"c0\"> refers to itself"),
        (checkers(3, "c1"), "refers to itself"),
        (checkers(40, "leaf"), "17 nested surfaces and textures, more than 16"),
        (worn(&mixture(3500, grey)), "257 surfaces that are mixed, more than 256"),
        (
            mixture(100, grey) + &worn(&mixture(50, "<ref id='100'/>")),
            "surfaces that are mixed, more than 256",
        ),
        (worn(&blends), "17 nested surfaces and textures, more than 16"),
        ("<shape type='merge' id='m'><ref id='m'/></shape>".to_owned(), "refers to itself"),
        (sky.repeat(50), "a second emitter surrounds the scene; there can be only one (49 times"),
    ] {
        fails(folder.body(&body), want);
        // 2^40 checkerboards would never end
    }
    // As deep as may be is well
    folder.body(&checkers(14, "leaf")).unwrap();
    folder.body(&worn(&mixture(200, grey))).unwrap();
}

/// What Mitsuba reads and XML does not allow.
#[test]
fn xml_is_read_as_mitsuba_reads_it() {
    let lamp =
        "<shape type='rectangle'><emitter type='area'><rgb name='radiance' value='0.5'/></emitter></shape>";
    let text = format!("<scene version='3.0.0'>{CAMERA}\n<!-- ---- lamp ---- --->\n{lamp}</scene>");
    let declared = |encoding: &str| format!("<?xml version='1.0' encoding='{encoding}'?>{text}");
    let wide = |word: fn(u16) -> [u8; 2], text: &str| -> Vec<u8> {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(word).collect()
    };
    let latin: Vec<u8> =
        declared("iso-8859-1").replace("lamp ----", "l\u{e4}mp").chars().map(|c| c as u8).collect();
    for bytes in [
        text.clone().into_bytes(),
        declared("utf-8").into_bytes(),
        format!("\n \n{}", declared("utf-8")).into_bytes(),
        format!("\u{feff}{}", declared("utf-8")).into_bytes(),
        format!("<!DOCTYPE scene>{text}").into_bytes(),
        format!("<!DOCTYPE scene SYSTEM 'a>b' [\n<!ELEMENT scene ANY>\n]>{text}").into_bytes(),
        text.replace("'rectangle'", "'rectangle' type='cube'").into_bytes(),
        text.replace("<shape", "<shape id='salt & pepper'").into_bytes(),
        format!("{text}\0").into_bytes(),
        latin,
        wide(u16::to_le_bytes, &text),
        wide(u16::to_be_bytes, &declared("utf-16")),
    ] {
        let folder = Folder::new().with("a.xml", &bytes);
        let loaded = noisefloor_scenefile::load(&folder.path().join("a.xml"));
        let loaded = loaded.unwrap_or_else(|e| panic!("{}: {e}", String::from_utf8_lossy(&bytes)));
        close(seen(loaded), [0.5; 3], 1e-4, &String::from_utf8_lossy(&bytes));
    }
}

/// Any number of shapes can name one mesh that inflates a thousandfold: all together are in proportion to the files.
#[test]
fn inflated_meshes_count_together() {
    let vertices = 1 << 19;
    let mut inside = 0x1000u32.to_le_bytes().to_vec();
    inside.extend(b"\0");
    inside.extend([vertices as u64, 1].map(u64::to_le_bytes).concat());
    inside.extend(vec![0; 12 * vertices]);
    inside.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
    let bytes = serialized(4, &inside);
    assert!(bytes.len() < 10_000);
    let shape = r#"<shape type="serialized"><string name="filename" value="mesh.serialized"/></shape>"#;
    let folder = Folder::new().with("mesh.serialized", bytes);
    fails(folder.body(&shape.repeat(40)), "inflated bytes so far, more than");
}
