use crate::util::{CAMERA, Folder, SKY, assert_warns, close, fails, nearest, ply, seen, shape_at};

const LIGHT: &str = r#"<emitter type="area"><rgb name="radiance" value="1, 2, 3"/></emitter>"#;

fn folder() -> Folder {
    let with_normals = "v -9 -9 0\nv 9 -9 0\nv 0 9 0\nvn 0 0.6 0.8\nf 1//1 2//1 3//1\n";
    Folder::new()
        .with("bare.obj", "v -9 -9 0\nv 9 -9 0\nv 0 9 0\nf 1 2 3\n")
        .with("normals.obj", with_normals)
        .with("backwards.obj", with_normals.replace("0.8", "-0.8"))
        .with("bare.ply", ply("", &["-9 -9 0", "9 -9 0", "0 9 0"], &["3 0 1 2"]))
}

/// Which side shines, as Mitsuba 3.9.1 has it: from shading normals where there are any, from the corners
/// where not.
#[test]
fn fronts_are_those_of_mitsuba() {
    let folder = folder();
    let rectangle = r#"<shape type="rectangle">"#;
    let disk = r#"<shape type="disk">"#;
    let cube = r#"<shape type="cube">"#;
    let bare = r#"<shape type="obj"><string name="filename" value="bare.obj"/>"#;
    let ply = r#"<shape type="ply"><string name="filename" value="bare.ply"/>"#;
    let normals = r#"<shape type="obj"><string name="filename" value="normals.obj"/>"#;
    let backwards = r#"<shape type="obj"><string name="filename" value="backwards.obj"/>"#;
    let flat = r#"<boolean name="face_normals" value="true"/>"#;
    let flip = r#"<boolean name="flip_normals" value="true"/>"#;
    let (as_is, x, z) = ("", r#"<scale x="-1"/>"#, r#"<scale z="-1"/>"#);
    let behind = r#"<rotate y="1" angle="180"/>"#;
    for (shape, more, to_world, shines) in [
        (rectangle, "", as_is, true),
        (rectangle, "", behind, false),
        (rectangle, "", x, true),
        (rectangle, "", z, false),
        (rectangle, flip, as_is, false),
        (rectangle, flip, x, false),
        (rectangle, flip, z, true),
        (disk, "", as_is, true),
        (disk, "", behind, false),
        (disk, "", x, true),
        (disk, "", z, false),
        (disk, flip, as_is, false),
        (cube, "", as_is, true),
        (cube, "", behind, true),
        (cube, "", x, true),
        (cube, "", z, true),
        (cube, flip, as_is, false),
        (bare, "", as_is, true),
        (bare, "", x, false),
        (bare, "", z, true),
        (bare, flip, as_is, false),
        (bare, flip, x, true),
        (bare, flat, x, false),
        (ply, "", as_is, true),
        (ply, "", x, false),
        (normals, "", as_is, true),
        (normals, "", x, true),
        (normals, "", z, false),
        (normals, flip, as_is, false),
        (normals, flip, z, true),
        (normals, flat, x, false),
        (normals, flat, z, true),
        (backwards, "", as_is, false),
        (backwards, "", z, true),
        (backwards, flat, as_is, true),
        (backwards, flip, as_is, true),
    ] {
        let body =
            format!(r#"{shape}{more}<transform name="to_world">{to_world}</transform>{LIGHT}</shape>"#);
        let want = if shines { [1.0, 2.0, 3.0] } else { [0.0; 3] };
        close(folder.see(&body), want, 1e-5, &body);
    }
}

/// Where the shapes end: the camera sees what is on the z axis.
#[test]
fn shapes_have_the_sizes_of_mitsuba() {
    let folder = Folder::new();
    let moved = |shape: &str, x: f32, y: f32| folder.see(&shape_at(shape, x, y, LIGHT)) == [1.0, 2.0, 3.0];
    for (shape, x, y, seen) in [
        ("rectangle", 0.99, -0.99, true),
        ("rectangle", 1.01, 0.0, false),
        ("cube", -0.99, 0.99, true),
        ("cube", 0.0, 1.01, false),
        ("disk", 0.99, 0.0, true),
        ("disk", 0.72, 0.72, false),
        ("sphere", 0.0, 0.99, true),
        ("sphere", 0.72, 0.72, false),
    ] {
        assert_eq!(moved(shape, x, y), seen, "{shape} {x} {y}");
    }
    let ball = |to_world: &str| {
        let body = format!(
            r#"<shape type="sphere"><point name="center" x="1" y="2" z="3"/>
                <float name="radius" value="0.5"/>
                <transform name="to_world">{to_world}</transform>{LIGHT}</shape>"#
        );
        folder.see(&body) == [1.0, 2.0, 3.0]
    };
    // Centre and radius go through the transform
    assert!(ball(r#"<scale value="0.5"/><translate value="-0.5, -0.8, 0"/>"#));
    assert!(!ball(r#"<scale value="0.5"/><translate value="-0.5, -0.7, 0"/>"#));
}

#[test]
fn spheres_inside_out_are_glass_of_the_reciprocal_index() {
    let folder = Folder::new();
    let flip = r#"<boolean name="flip_normals" value="true"/>"#;
    // One that shines inwards is made of triangles
    let inwards = folder.body(&format!(r#"<shape type="sphere">{flip}{LIGHT}</shape>"#)).unwrap();
    assert!(inwards.scene.lights() > 10_000);
    let mirrored = r#"<transform name="to_world"><scale z="-2" x="2" y="2"/></transform>"#;
    let both = folder.body(&format!(r#"<shape type="sphere">{flip}{mirrored}{LIGHT}</shape>"#)).unwrap();
    assert_eq!((both.scene.lights(), both.warnings.len()), (1, 0));
    let stretched = r#"<shape type="sphere"><transform name="to_world"><scale x="2"/></transform></shape>"#;
    // An instance of one that is round, unless it shines
    let scene = folder.body(stretched).unwrap().scene;
    assert_eq!((scene.surfaces(), scene.instances()), (1, 1));
    let lamp = folder.body(&stretched.replace("</shape>", &format!("{LIGHT}</shape>"))).unwrap();
    assert!(lamp.scene.lights() > 10_000);
    let one_sided = folder.body(&format!(r#"<shape type="sphere">{flip}</shape>"#)).unwrap();
    assert_warns(&one_sided, &["line 2: the sphere is seen from outside, too"]);

    // Reflection alone, 53° from the normal: total in a bubble, past asin(1/1.5) = 42°, and little on a ball
    let reflected = |flip: &str| {
        folder.see(&format!(
            r#"<shape type="sphere">{flip}<transform name="to_world"><translate x="0.8"/></transform>
                <bsdf type="dielectric"><float name="int_ior" value="1.5"/>
                <float name="ext_ior" value="1"/><float name="specular_transmittance" value="0"/></bsdf>
                </shape>{SKY}"#
        ))
    };
    close(reflected(flip), [1.0; 3], 1e-3, "bubble");
    assert!(reflected("")[0] < 0.15);
}

#[test]
fn smooth_meshes_and_flat_ones_differ() {
    // A roof whose ridge is seen from above, lit along +x −z: without normals, Mitsuba smooths the ridge away
    let folder = Folder::new().with("roof.obj", "v 0 -9 0\nv 0 9 0\nv 9 0 -9\nv -9 0 -9\nf 1 3 2\nf 1 2 4\n");
    let roof = |more: &str| {
        folder.see(&format!(
            r#"<emitter type="directional"><vector name="direction" x="-1" y="0" z="-1"/><rgb name="irradiance" value="1"/></emitter>
            <shape type="obj"><string name="filename" value="roof.obj"/>{more}<transform name="to_world"><translate x="-0.02"/></transform><bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf></bsdf></shape>"#
        ))
    };
    let inverse_pi = std::f32::consts::FRAC_1_PI;
    // The eastern side faces the light; smooth, the ridge is turned by 45° to it
    close(roof(r#"<boolean name="face_normals" value="true"/>"#), [inverse_pi; 3], 1e-2, "flat");
    close(roof(""), [inverse_pi * 0.5f32.sqrt(); 3], 1e-2, "smooth");
}

/// Where the camera sees light along the z axis when a shape is moved by x.
fn seen_at(folder: &Folder, before: &str, shape: &str, x: f32) -> bool {
    let moved = shape.replace("AT", &format!(r#"<translate x="{x}"/>"#));
    folder.see(&format!("{before}{moved}")) == [1.0, 2.0, 3.0]
}

#[test]
fn cylinders_have_the_size_of_mitsuba() {
    let folder = Folder::new();
    let cylinder = |more: &str| {
        format!(r#"<shape type="cylinder">{more}<transform name="to_world">AT</transform>{LIGHT}</shape>"#)
    };
    // Along x, from 0 to 2, of radius 1: seen from +z where it is, and open at its ends
    let lying = cylinder(r#"<point name="p0" x="0" y="0" z="0"/><point name="p1" x="2" y="0" z="0"/>"#);
    for (x, seen) in [(-0.1, true), (-1.9, true), (0.1, false), (-2.1, false)] {
        assert_eq!(seen_at(&folder, "", &lying, x), seen, "{x}");
    }
    // Along z one looks through it, and the inside is dark
    assert!(!seen_at(&folder, "", &cylinder(""), 0.0));
    let error = folder.body(r#"<shape type="cylinder"><float name="radius" value="0"/></shape>"#);
    fails(error, "line 2: a cylinder needs a `radius` above 0");
}

/// A group is seen where its instances are, and nowhere else.
#[test]
fn instances_are_where_they_are_put() {
    let folder = folder();
    let group = format!(
        r#"<shape type="shapegroup" id="g"><shape type="rectangle">{LIGHT}</shape><shape type="ply"><string
            name="filename" value="bare.ply"/><transform name="to_world"><translate z="-50"/></transform>
            </shape></shape>"#
    );
    let instance = r#"<shape type="instance"><ref id="g"/><transform name="to_world">AT</transform></shape>"#;
    assert_eq!(folder.body(&group).unwrap().scene.surfaces(), 0);
    for (x, seen) in [(0.9, true), (1.1, false)] {
        assert_eq!(seen_at(&folder, &group, instance, x), seen, "{x}");
    }
    let two = folder.body(&format!("{group}{}{}", instance.replace("AT", ""), instance.replace("AT", "")));
    // The lamp twice, and what does not shine once
    let scene = two.unwrap().scene;
    assert_eq!((scene.surfaces(), scene.instances(), scene.lights()), (3, 2, 2));
    // A mirrored instance has its front where its original has it
    let mirrored = instance.replace("AT", r#"<scale x="-1"/>"#);
    assert_eq!(folder.see(&format!("{group}{mirrored}")), [1.0, 2.0, 3.0]);

    fails(
        folder.body(r#"<shape type="instance"/>"#),
        "line 2: an instance needs one <shape type=\"shapegroup\">",
    );
    let nested = format!(r#"<shape type="shapegroup" id="h">{instance}</shape>"#).replace("AT", "");
    let nested = format!("{group}{nested}{}", instance.replace("AT", "").replace("\"g\"", "\"h\""));
    fails(folder.body(&nested), "an instance in a group is not supported");
}

/// Instances share their group. A sphere stays one where they stretch it, and has its front outside where they
/// mirror it.
#[test]
fn instances_share_their_group() {
    let group =
        r#"<shape type="shapegroup" id="g"><shape type="sphere"><bsdf type="diffuse"/></shape></shape>"#;
    let instance = r#"<shape type="instance"><ref id="g"/><transform name="to_world">
        <scale x="-2" y="0.5" z="1"/></transform></shape>"#;
    let folder = Folder::new();
    let scene = folder.body(&format!("{group}{}", instance.repeat(4000))).unwrap().scene;
    assert_eq!((scene.surfaces(), scene.instances()), (1, 4000));
    // Grey in a white sky, black from inside
    close(folder.see(&format!("{SKY}{group}{instance}")), [0.5; 3], 0.02, "mirrored");

    let flat = instance.replace("0.5", "0");
    let loaded = folder.body(&format!("{group}{instance}{flat}{flat}")).unwrap();
    assert_eq!(loaded.scene.instances(), 1);
    let said: Vec<&str> = loaded.warnings.iter().map(|warning| warning.what.as_str()).collect();
    assert_eq!(said, ["an instance is left out: its transform is singular"; 2]);
    // What is wrong with a group is said once
    let bad = group.replace("diffuse", "thatch");
    let errors = folder.body(&format!("{bad}{instance}{instance}{instance}")).unwrap_err();
    assert_eq!(errors.matches("thatch").count(), 1, "{errors}");
}

/// Without coordinates in its file, a triangle has the weights of its second and third corner, as in
/// Mitsuba: u grows to the second, and the picture's rows run to the third.
#[test]
fn meshes_without_coordinates_are_mapped_by_their_corners() {
    let ply = ply("", &["0 0 0", "4 0 0", "0 4 0"], &["3 0 1 2"]);
    let pixels = [[0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 0, 255]];
    let folder = Folder::new().with("a.ply", ply).with_png("a.png", 2, &pixels);
    for (x, y, want) in
        [(0.8, 0.8, [0.0, 0.0]), (2.8, 0.6, [1.0, 0.0]), (0.6, 2.8, [0.0, 1.0]), (1.9, 1.9, [0.0, 0.0])]
    {
        let seen = folder.see(&format!(
            r#"<shape type="ply"><string name="filename" value="a.ply"/>
            <transform name="to_world"><translate x="-{x}" y="-{y}"/></transform>
            <emitter type="area">{}</emitter></shape>"#,
            nearest("radiance", "a.png", true)
        ));
        close(seen, [want[0], want[1], 0.0], 1e-3, &format!("{x} {y}"));
    }
}

/// The shapes in a `merge` are shapes of the scene, also in groups and by reference.
#[test]
fn merged_shapes_are_shapes() {
    let folder = Folder::new();
    let lamp = r#"<shape type="rectangle" id="lamp"><emitter type="area"><rgb name="radiance" value="0.5"/></emitter></shape>"#;
    let aside = r#"<shape type="cube"><transform name="to_world"><translate x="9"/></transform></shape>"#;
    let merge = format!(r#"<shape type="merge">{lamp}<shape type="merge">{aside}</shape></shape>"#);
    close(folder.see(&merge), [0.5; 3], 1e-4, "merge");
    assert_eq!(folder.body(&merge).unwrap().scene.surfaces(), 1 + 12);
    let group = format!(
        r#"<shape type="shapegroup" id="g">{merge}</shape><shape type="instance"><ref id="g"/></shape>"#
    );
    close(folder.see(&group), [0.5; 3], 1e-4, "group");
}

/// Mitsuba 3 does not bring the axis of a rotation to the length 1: about 2z, a quarter turn takes (x, y) to
/// (−2y, 2x), as mitsuba.ScalarTransform4f().rotate([0, 0, 2], 90) says. Version 0.6 does.
#[test]
fn long_axes_stretch_as_in_mitsuba_3() {
    let body = r#"<shape type="rectangle"><transform name="to_world"><rotate z="2" angle="90"/>
        <translate x="-1.5"/></transform><emitter type="area"><rgb name="radiance" value="0.5"/></emitter></shape>"#;
    let folder = Folder::new();
    close(folder.see(body), [0.5; 3], 1e-4, "stretched to x = 0.5");
    let loaded = folder.body(body).unwrap();
    assert_warns(&loaded, &["an axis of length 2.000 stretches"]);
    assert_eq!(loaded.warnings.len(), 1);
    let old = format!("<scene version=\"0.6.0\">{CAMERA}\n{body}</scene>").replace("to_world", "toWorld");
    close(seen(folder.load(&old).unwrap()), [0.0; 3], 1e-4, "ends at x = −0.5");
}

/// A black U of one polygon before a white sky, over [−1, 1]²: it covers 1 − 0.5·0.75 = 0.625 of 4. Five
/// standard errors are 5·√(0.156·0.844/4096) = 0.028; a fan from its first corner would cover 0.052 more.
#[test]
fn concave_polygons_cover_what_they_enclose() {
    let rows = [
        "-0.5 -0.5 0",
        "0.5 -0.5 0",
        "0.5 0.5 0",
        "0.25 0.5 0",
        "0.25 -0.25 0",
        "-0.25 -0.25 0",
        "-0.25 0.5 0",
        "-0.5 0.5 0",
    ];
    let obj = rows.iter().map(|row| format!("v {row}\n")).collect::<String>() + "f 1 2 3 4 5 6 7 8\n";
    let ply = ply("", &rows, &["8 0 1 2 3 4 5 6 7"]);
    let folder = Folder::new().with("u.obj", obj).with("u.ply", ply);
    let sensor = CAMERA.replace("perspective", "orthographic").replace(
        r#"<float name="fov" value="0.1"/>"#,
        r#"<film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/></film>"#,
    );
    for kind in ["obj", "ply"] {
        let scene = format!(
            r#"<scene version="3.0.0">{sensor}{SKY}
            <shape type="{kind}"><string name="filename" value="u.{kind}"/><bsdf type="twosided"><bsdf type="diffuse">
            <rgb name="reflectance" value="0"/></bsdf></bsdf></shape></scene>"#
        );
        let [shown, ..] = seen(folder.load(&scene).unwrap());
        assert!((shown - 0.84375).abs() < 0.028, "{kind}: {shown}");
    }
}
