use crate::util::{CAMERA, Folder, assert_warns, close, fails, seen};
use noisefloor_scenefile::{LoadFault, LoadOptions, Treatment, group_warnings, load_with};

fn scene(inside: &str) -> String {
    format!("<scene version='3.0.0'>{CAMERA}\n{inside}</scene>")
}

fn lamp(radiance: &str) -> String {
    format!(
        r#"<shape type="rectangle"><emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>"#
    )
}

#[test]
fn includes_are_read_in_place_with_their_own_lines() {
    let folder = Folder::new()
        .with("lamp.xml", format!("<scene version='3.0.0'>\n{}</scene>", lamp("$level")))
        .with("alone.xml", "<bsdf type='diffuse' id='grey'/>")
        .with("wrong.xml", "<scene version='3.0.0'>\n\n<shape type='hair'/></scene>")
        .with("round.xml", "<scene version='3.0.0'><include filename='round.xml'/></scene>");
    let body = r#"<default name="level" value="0.5"/><include filename="lamp.xml"/>
        <include filename="alone.xml"/><shape type="cube"><ref id="grey"/>
        <transform name="to_world"><translate z="-50"/></transform></shape>"#;
    close(seen(folder.body(body).unwrap()), [0.5; 3], 1e-4, body);
    fails(
        folder.body(r#"<include filename="wrong.xml"/>"#),
        "wrong.xml: line 3: <shape type=\"hair\"> is not supported",
    );
    fails(folder.body(r#"<include filename="round.xml"/>"#), "33 levels of elements, more than 32");
    fails(
        folder.body(r#"<include filename="../a.xml"/>"#),
        "lies outside the folder of the scene; allow a folder by `--scene-root DIR`",
    );
    fails(folder.body("<include/>"), "line 2: an <include> needs a `filename`");
}

#[test]
fn parameters_come_from_options_then_from_the_first_default() {
    let folder = Folder::new();
    let path = folder.path().join("scene.xml");
    let text = scene(&format!(
        r#"<default name="level" value="0.5"/><default name="level" value="4"/>{}"#,
        lamp("$level")
    ));
    std::fs::write(&path, &text).unwrap();
    let mut options = LoadOptions::default();
    close(seen(load_with(&path, &options).unwrap()), [0.5; 3], 1e-4, "default");
    options.parameters.insert("level".to_owned(), "0.25".to_owned());
    close(seen(load_with(&path, &options).unwrap()), [0.25; 3], 1e-4, "option");
    // What is not read needs no value
    let unread = r#"<sensor type="perspective"><float name="fov" value="$fov"/></sensor>"#;
    let loaded = folder.body(&format!("{unread}{}", lamp("0.5"))).unwrap();
    close(seen(loaded), [0.5; 3], 1e-4, "unset");
    fails(folder.body(&lamp("$level")), "line 2: `$level` has no value");
}

#[test]
fn other_folders_are_searched_within_the_root() {
    let folder = Folder::new().with("lamp.xml", scene(&lamp("0.5")));
    std::fs::create_dir_all(folder.path().join("a/scenes")).unwrap();
    std::fs::create_dir_all(folder.path().join("common")).unwrap();
    let ball = "v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n";
    std::fs::write(folder.path().join("common/mesh.obj"), ball).unwrap();
    let path = folder.path().join("a/scenes/scene.xml");
    let text =
        r#"<path value="../../common"/><shape type="obj"><string name="filename" value="mesh.obj"/></shape>"#;
    std::fs::write(&path, scene(text)).unwrap();
    let mut options = LoadOptions::default();
    options.root = Some(folder.path().join("a"));
    assert!(matches!(load_with(&path, &options).unwrap_err().fault, LoadFault::Outside(_)));
    options.root = Some(folder.path().to_owned());
    assert_eq!(load_with(&path, &options).unwrap().scene.surfaces(), 1);
}

#[test]
fn volumes_are_refused_unless_they_are_to_be_ignored() {
    let folder = Folder::new();
    let body = r#"<medium type="homogeneous" id="fog"/><shape type="cube">
        <ref name="interior" id="fog"/></shape>"#;
    let error = folder.body(body).unwrap_err();
    let what = "line 3: a participating medium (`--ignore volumes` leaves them all out, `--source mitsuba` \
                renders them) is not supported";
    assert!(error.contains(what), "{error}");
    let path = folder.path().join("scene.xml");
    let mut options = LoadOptions::default();
    options.ignore_volumes = true;
    let loaded = load_with(&path, &options).unwrap();
    assert_eq!(loaded.warnings.len(), 2);
    assert_warns(&loaded, &["the scene has no light: it is black"]);
    assert_warns(&loaded, &["line 3: the participating medium is ignored"]);
    // What nobody refers to makes no difference
    assert_eq!(folder.body(r#"<medium type="homogeneous" id="fog"/>"#).unwrap().warnings, []);
}

/// One load names all that is wrong, the same things together.
#[test]
fn all_errors_are_said_at_once() {
    let folder = Folder::new();
    let hair = r#"<shape type="hair"/>"#;
    let body = format!("{hair}\n{hair}\n<emitter type='ies'/>\n{hair}");
    let error = folder.body(&body).unwrap_err();
    let lines: Vec<&str> = error.lines().collect();
    assert_eq!(lines.len(), 2, "{error}");
    assert!(lines[0].starts_with("<shape type=\"hair\"> is not supported (3 times: "), "{error}");
    assert!(lines[0].ends_with("scene.xml: line 2, line 3, line 5)"), "{error}");
    assert!(lines[1].ends_with("line 4: <emitter type=\"ies\"> is not supported"), "{error}");
}

#[test]
fn warnings_that_say_the_same_are_one_finding() {
    let folder = Folder::new();
    let rough = r#"<shape type="cube"><bsdf type="roughdiffuse"/></shape>"#;
    let loaded = folder.body(&format!("<x/>\n{rough}\n{rough}\n<x/>")).unwrap();
    let findings = group_warnings(&loaded.warnings);
    let counts: Vec<_> = findings.iter().map(|f| (f.treatment, f.places.len())).collect();
    assert_eq!(counts, [(Treatment::Approximated, 2), (Treatment::Ignored, 2)]);
}

/// Everything that was read is in the scene's identity, and the values of parameters.
#[test]
fn the_identity_of_a_scene_has_all_its_files() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let folder = Folder::new()
        .with("rest.xml", scene(r#"<shape type="obj"><string name="filename" value="a.obj"/></shape>"#))
        .with("a.obj", triangle)
        .with_png("wood.png", 1, &[[9; 4]])
        .with("unused.png", "not read")
        .with(
            "scene.xml",
            format!(
                r#"<scene version="3.0.0"><include filename="rest.xml"/><shape type="cube"><bsdf type="diffuse">
                <texture type="bitmap" name="reflectance"><string name="filename" value="wood.png"/></texture>
                </bsdf></shape>{}</scene>"#,
                lamp("1")
            ),
        );
    let path = folder.path().join("scene.xml");
    let identity = |options: &LoadOptions| load_with(&path, options).unwrap().scene.identity().clone();
    let before = identity(&LoadOptions::default());
    assert_eq!(before.files().collect::<Vec<_>>(), ["a.obj", "rest.xml", "scene.xml", "wood.png"]);
    let mut options = LoadOptions::default();
    options.parameters.insert("level".into(), "2".into());
    assert!(identity(&options).change_since(&before).unwrap().to_string().contains("level"));
    let folder = folder.with("a.obj", format!("{triangle}# edited\n"));
    let now = load_with(&folder.path().join("scene.xml"), &LoadOptions::default()).unwrap();
    let change = now.scene.identity().change_since(&before).unwrap();
    assert_eq!(change.to_string(), "`a.obj` has changed");
}
