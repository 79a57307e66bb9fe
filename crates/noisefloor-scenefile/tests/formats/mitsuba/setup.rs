use crate::util::{CAMERA, Folder, SKY, assert_warns, close, fails, of, seen, value};
use noisefloor_ptwne::FovAxis;

fn sensor(version: &str, inside: &str) -> Result<noisefloor_scenefile::Loaded, String> {
    Folder::new()
        .load(&format!("<scene version='{version}'><sensor type='perspective'>{inside}</sensor></scene>"))
}

#[test]
fn fields_of_view_are_those_of_mitsuba() {
    let film = r#"<film type="hdrfilm"><integer name="width" value="300"/>
        <integer name="height" value="200"/><rfilter type="box"/></film>"#;
    for (axis, want) in [
        ("x", FovAxis::Horizontal),
        ("y", FovAxis::Vertical),
        ("diagonal", FovAxis::Diagonal),
        ("smaller", FovAxis::Smaller),
        ("larger", FovAxis::Larger),
    ] {
        let text = format!(
            r#"<float name="fov" value="40"/><string name="fov_axis" value="{axis}"/>{film}
                <sampler type="independent"><integer name="sample_count" value="4"/></sampler>
                <float name="near_clip" value="1"/>"#
        );
        let loaded = sensor("3.0.0", &text).unwrap();
        assert_eq!((loaded.scene.camera().vertical_fov, loaded.scene.optics().fov_axis), (40.0, want));
        assert_eq!((loaded.size, loaded.warnings.len()), (Some((300, 200)), 0));
    }

    // 50 mm where no angle is given, of a frame of 36 mm × 24 mm
    for (text, diagonal) in [("", 46.793_f32), (r#"<string name="focal_length" value="35mm"/>"#, 63.440_f32)]
    {
        let loaded = sensor("3.0.0", text).unwrap();
        assert!((loaded.scene.camera().vertical_fov - diagonal).abs() < 1e-2);
        assert_eq!(loaded.scene.optics().fov_axis, FovAxis::Diagonal);
        assert_eq!(loaded.size, None);
    }
}

/// The columns left, up, view and eye of transforms, as Mitsuba 3.9.1 has them.
#[test]
fn transforms_are_those_of_mitsuba() {
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let up = [-0.507_093, 0.845_154, -0.169_031];
    let view = [0.801_784, 0.534_522, 0.267_261];
    let eye = [1.0, 2.0, 3.0];
    let moved = r#"<scale value="2"/><matrix value="0 0 1 5, 1 0 0 6, 0 1 0 7, 0 0 0 1"/>"#;
    for (version, steps, up, view, eye) in [
        ("3.0.0", r#"<rotate y="1" angle="90"/><translate x="1"/>"#, y, x, x),
        ("3.0.0", r#"<translate x="1"/><rotate value="0 1 0" angle="90"/>"#, y, x, [0.0, 0.0, -1.0]),
        ("3.0.0", r#"<lookat origin="1,2,3" target="4,4,4" up="0,1,0"/>"#, up, view, eye),
        ("0.6.0", r#"<lookAt origin="1 2 3" target="4 4 4" up="0 1 0"/>"#, up, view, eye),
        ("3.0.0", r#"<translate value="1 2 3"/><translate value="1"/>"#, y, z, [2.0, 3.0, 4.0]),
        ("3.0.0", moved, z, x, [5.0, 6.0, 7.0]),
        ("3.0.0", r#"<matrix value="0 0 1 1 0 0 0 1 0"/>"#, z, x, [0.0; 3]),
    ] {
        let name = if version == "3.0.0" { "to_world" } else { "toWorld" };
        let camera =
            sensor(version, &format!("<transform name='{name}'>{steps}</transform>")).unwrap().scene.camera();
        let far = eye.iter().fold(1.0, |far: f32, x: &f32| far.max(x.abs()));
        close(camera.eye, eye, 1e-5, steps);
        close(camera.up, up, 1e-5, steps);
        close([0, 1, 2].map(|i| (camera.target[i] - camera.eye[i]) / far), view, 1e-5, steps);
    }
}

#[test]
fn other_cameras_are_read_or_refused() {
    let mirrored = r#"<transform name="to_world"><scale x="-1"/></transform>"#;
    assert!(sensor("3.0.0", mirrored).unwrap().scene.optics().mirrored);
    let folder = Folder::new();
    let fisheye = folder.load("<scene version='3.0.0'>\n<sensor type='fisheye'/></scene>");
    fails(fisheye, "scene.xml: line 2: <sensor type=\"fisheye\"> is not supported");
    fails(folder.load("<scene version='3.0.0'/>"), "no <sensor>");
    let two = format!("<scene version='3.0.0'>{CAMERA}\n{CAMERA}</scene>");
    assert_warns(&folder.load(&two).unwrap(), &["line 2: only the first sensor is used"]);
    let lens = r#"<scene version="3.0.0"><sensor type="thinlens"><float name="aperture_radius" value="0.5"/>
        <float name="focus_distance" value="4"/></sensor></scene>"#;
    let loaded = folder.load(lens).unwrap();
    let optics = loaded.scene.optics();
    assert_eq!((optics.aperture_radius, optics.focus_distance), (0.5, 4.0));
    assert_eq!(loaded.warnings, []);
    // Two units wide, scaled
    let parallel = r#"<scene version="3.0.0"><sensor type="orthographic"><transform name="to_world">
        <scale value="3"/></transform><film type="hdrfilm"><integer name="width" value="30"/>
        <integer name="height" value="20"/></film></sensor></scene>"#;
    assert_eq!(folder.load(parallel).unwrap().scene.optics().parallel_height, Some(4.0));
}

#[test]
fn path_lengths_are_read() {
    let folder = Folder::new();
    let integrator = |kind: &str, inside: &str| of("integrator", kind, inside);
    let depth = |depth: i32| value("integer", "max_depth", depth);
    let aovs = value("string", "aovs", "dd.y:depth");
    for (integrator, want) in [
        (String::new(), None),
        (integrator("path", ""), None),
        (integrator("path", &(depth(-1) + &value("integer", "rr_depth", 3))), None),
        (integrator("path", &depth(7)), Some(7)),
        (integrator("volpath", &depth(1)), Some(1)),
        (integrator("direct", ""), Some(2)),
        (integrator("aov", &(aovs + &integrator("path", &depth(4)))), Some(4)),
    ] {
        let loaded = folder.body(&integrator).unwrap();
        assert_eq!((loaded.max_depth, loaded.warnings.len()), (want, 0), "{integrator}");
    }
    fails(folder.body(&integrator("path", &depth(0))), "line 2: `max_depth` is 0");
    assert_eq!(folder.body(&integrator("ptracer", "")).unwrap().warnings.len(), 1);
}

/// The camera sees through what shines, and black around the scene; mirrors and glass see both (Mitsuba 3.9.1).
#[test]
fn hidden_emitters_are_not_seen() {
    let folder = Folder::new();
    let hidden = r#"<integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>"#;
    let lamp = r#"<shape type="rectangle"><transform name="to_world"><scale value=".3"/></transform>
        <emitter type="area"><rgb name="radiance" value="4"/></emitter></shape>"#;
    let behind = |bsdf: &str| {
        format!(
            r#"<shape type="rectangle"><transform name="to_world"><scale value="50"/><translate z="-1"/></transform>
            <bsdf type="{bsdf}</bsdf></shape>"#
        )
    };
    let wall = behind(r#"diffuse"><rgb name="reflectance" value=".5"/>"#);
    let mirror = behind(r#"conductor"><string name="material" value="none"/>"#);
    let pane = r#"<shape type="rectangle"><transform name="to_world"><scale value="50"/><translate z="1"/></transform>
        <bsdf type="thindielectric"><float name="int_ior" value="1.5"/></bsdf></shape>"#;
    for (body, seen, unseen) in [
        (lamp.to_owned(), 4.0, 0.0),
        (SKY.to_owned(), 1.0, 0.0),
        (format!("{mirror}{SKY}"), 1.0, 1.0),
        // A pane reflects 2·0.04/1.04 of the sky, and shows the lamp behind it
        (format!("{pane}{lamp}{SKY}"), 4.0 - 3.0 * 0.076923, 4.0 - 3.0 * 0.076923),
    ] {
        close(folder.see(&body), [seen; 3], 2e-2, &body);
        close(folder.see(&format!("{hidden}{body}")), [unseen; 3], 2e-2, &body);
        let loaded = folder.body(&format!("{hidden}{body}")).unwrap();
        assert_eq!(loaded.warnings, [], "{body}");
        let nested =
            format!(r#"<integrator type="aov"><string name="aovs" value="a:depth"/>{hidden}</integrator>"#);
        close(folder.see(&format!("{nested}{body}")), [unseen; 3], 2e-2, &body);
    }
    // The lamp lights the wall behind it only from its back, where it does not shine; the sky around does
    let before = format!("{wall}{lamp}{SKY}");
    let without = folder.see(&format!("{wall}{SKY}"))[0];
    let seen = folder.see(&format!("{hidden}{before}"))[0];
    assert!(seen < without && seen > 0.8 * without, "{seen} beside {without}");
}

#[test]
fn parameters_are_put_in_the_longest_first() {
    let folder = Folder::new();
    let body = r#"<default name="r" value="9"/><default name="red" value="0.25"/><default name="all" value="$red, $red"/>
        <shape type="rectangle"><emitter type="area"><rgb name="radiance" value="$red, $all"/></emitter></shape>"#;
    close(folder.see(body), [0.25; 3], 1e-5, body);
    fails(folder.body("\n<shape type='$what'/>"), "line 3: `$what` has no value");
}

#[test]
fn references_may_come_first_and_must_not_go_round() {
    let folder = Folder::new();
    let body = r#"<shape type="rectangle"><ref id="light"/><ref id="black"/></shape>
        <bsdf type="twosided" id="black"><ref id="base"/></bsdf>
        <bsdf type="diffuse" id="base"><rgb name="reflectance" value="0"/></bsdf>
        <emitter type="area" id="light"><rgb name="radiance" value="0.5"/></emitter>"#;
    close(folder.see(body), [0.5; 3], 1e-5, body);

    let round = r#"<bsdf type="twosided" id="a"><ref id="b"/></bsdf><bsdf type="mask" id="b"><ref id="a"/>
        </bsdf><shape type="cube"><ref id="a"/></shape>"#;
    fails(folder.body(round), "<bsdf type=\"twosided\" id=\"a\"> refers to itself");
    fails(folder.body(r#"<shape type="cube"><ref id="c"/></shape>"#), "nothing has the id `c`");
    fails(folder.body(r#"<bsdf type="diffuse" id="a"/><bsdf type="diffuse" id="a"/>"#), "taken already");
    // In a texture that is referred to, what is not read is warned of
    let texture = r#"<texture type="checkerboard" id="t"><float name="x" value="1"/></texture>
        <shape type="cube"><bsdf type="diffuse"><ref name="reflectance" id="t"/></bsdf></shape>"#;
    assert_warns(&folder.body(texture).unwrap(), &["<float name=\"x\"> is ignored"]);
    // What nobody refers to is neither read nor warned of
    assert_eq!(folder.body(r#"<bsdf type="unheard-of" id="a"/>"#).unwrap().warnings, []);
}

#[test]
fn old_names_are_read_in_old_files() {
    let scene = |version: &str, to_world: &str, unit: &str| {
        format!(
            r#"<scene version="{version}">{}<shape type="rectangle"><transform name="{to_world}">
                <scale value="3"/></transform><boolean name="{unit}" value="true"/><bsdf type="diffuse"/>
                <emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape></scene>"#,
            CAMERA.replace("to_world", to_world)
        )
    };
    let folder = Folder::new();
    let old = folder.load(&scene("0.5.0", "toWorld", "flipNormals")).unwrap();
    assert_eq!(old.warnings, []);
    assert_eq!(seen(old), [0.0; 3]);
    let new = folder.load(&scene("2.1.0", "to_world", "flip_normals")).unwrap();
    assert_eq!(seen(new), [0.0; 3]);
    // In files of version 3, the names of 0.5 are no names
    let neither = folder.load(&scene("3.0.0", "to_world", "flipNormals")).unwrap();
    assert_warns(&neither, &["<boolean name=\"flipNormals\"> is ignored"]);
    // A spectrum of equal energy is not white in Rec.709; Mitsuba 3.9.1 takes old files for that, too
    close(seen(neither), [2.4096, 1.8966, 1.8178], 1e-4, "spectrum");
    let old = folder.load(&scene("0.6.0", "toWorld", "unheardOf")).unwrap();
    close(seen(old), [2.4096, 1.8966, 1.8178], 1e-4, "old spectrum");
}
