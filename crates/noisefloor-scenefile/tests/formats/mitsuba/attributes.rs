use crate::util::{Folder, SKY, assert_warns, bsdf, close, fails, rgb, value};

/// Two triangles side by side with a colour at their corners, and a weight on each.
fn folder() -> Folder {
    let corner = |x: i32, y: i32| format!("{x} {y} 0 0.2 0.4 0.8 0.5\n");
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        property float color_0\nproperty float color_1\nproperty float color_2\nproperty float grey_0\n\
        element face 2\nproperty list uchar int vertex_indices\nproperty float weight_0\nproperty float r\n\
        property float g\nproperty float b\nend_header\n{}{}{}{}3 0 1 2 0.25 0.5 0.6 0.7\n3 0 2 3 7 0 0 0\n",
        corner(-9, -9),
        corner(9, -9),
        corner(9, 8),
        corner(-9, 10)
    );
    Folder::new().with("mesh.ply", text).with("mesh.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
}

fn mesh(bsdf: &str) -> String {
    format!(
        r#"<shape type="ply"><string name="filename" value="mesh.ply"/>
            <transform name="to_world"><translate y="1"/></transform>{bsdf}</shape>{SKY}"#
    )
}

/// The attribute `name` as the parameter `of`.
fn texture(of: &str, name: &str, more: &str) -> String {
    let name = value("string", "name", name);
    format!(r#"<texture type="mesh_attribute" name="{of}">{name}{more}</texture>"#)
}

fn attribute(name: &str, more: &str) -> String {
    bsdf("diffuse", &texture("reflectance", name, more))
}

/// In a white sky, a diffuse surface shows its reflectance. The middle lies in the first triangle.
#[test]
fn meshes_have_the_colours_of_their_attributes() {
    let folder = folder();
    let half = r#"<float name="scale" value="0.5"/>"#;
    for (name, more, want) in [
        ("vertex_color", "", [0.2, 0.4, 0.8]),
        ("vertex_color", half, [0.1, 0.2, 0.4]),
        ("vertex_grey", "", [0.5; 3]),
        ("face_weight", "", [0.25; 3]),
        ("face_color", "", [0.5, 0.6, 0.7]),
    ] {
        close(folder.see(&mesh(&attribute(name, more))), want, 1e-3, name);
    }
    let parts = ["0.8, 0.4, 0", "0, 0.4, 0.8"].map(|colour| bsdf("diffuse", &rgb("reflectance", colour)));
    let blend = bsdf("blendbsdf", &(texture("weight", "face_weight", "") + &parts.concat()));
    // Which part is chosen is random: 4096 samples
    close(folder.see(&mesh(&blend)), [0.6, 0.4, 0.2], 0.06, "a blend");
}

#[test]
fn attributes_out_of_place_are_named() {
    let folder = folder();
    let outside = folder.body(&mesh(&attribute("face_weight", ""))).unwrap();
    assert_warns(&outside, &["3 values of `face_weight` are outside 0…1"]);
    let (grey, weight) = (bsdf("diffuse", ""), texture("weight", "face_weight", ""));
    let two = bsdf("blendbsdf", &(weight + &grey + &attribute("vertex_color", "")));
    let masked = bsdf("mask", &(texture("opacity", "face_weight", "") + &grey));
    let obj = mesh(&attribute("vertex_color", "")).replace("\"ply\"", "\"obj\"").replace(".ply", ".obj");
    for (body, want) in [
        (mesh(&attribute("vertex_smell", "")), "mesh.ply: the mesh has no attribute `vertex_smell`"),
        (mesh(&attribute("color", "")), "mesh.ply: the mesh has no attribute `color`"),
        (mesh(&two), "a second attribute of one mesh is not supported"),
        (mesh(&masked), "an attribute of a mesh as this parameter is not supported"),
        (obj, "`vertex_color` of a mesh that is no PLY is not supported"),
    ] {
        fails(folder.body(&body), want);
    }
}
