use crate::util::{Folder, fails, ply};
use noisefloor_testkit::HANG;
use std::io::Write;
use std::time::Instant;

/// What would take long or much memory is refused at once.
#[test]
fn what_is_too_large_is_an_error() {
    let folder = Folder::new();
    let nested = folder.world(&"AttributeBegin ".repeat(100_000)).unwrap_err();
    assert!(nested.contains("1024 nested attributes") || nested.contains("more than 1024"), "{nested}");
    let mut bomb = String::new();
    for i in 0..40 {
        bomb += &format!(
            "MakeNamedMaterial \"{i}\" \"string type\" \"mix\" \"string materials\" [\"{0}\" \"{0}\"]\n",
            i + 1
        );
    }
    fails(
        folder.world(&format!("{bomb}NamedMaterial \"0\" Shape \"sphere\"")),
        "17 nested surfaces and textures, more than 16",
    );
    let itself = "MakeNamedMaterial \"a\" \"string type\" \"mix\" \"string materials\" [\"a\" \"a\"] NamedMaterial \"a\"
        Shape \"sphere\"";
    fails(folder.world(itself), "the material `mix` refers to itself");
    // As deep as may be: each is made once, not twice for each above it, and so is the mean of its picture
    image::RgbImage::from_pixel(2000, 2000, image::Rgb([99; 3])).save(folder.path().join("a.png")).unwrap();
    let mut deep = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\"
        MakeNamedMaterial \"15\" \"string type\" \"dielectric\" \"texture Kt\" \"t\"\n"
        .to_owned();
    for i in (0..15).rev() {
        deep += &format!(
            "MakeNamedMaterial \"{i}\" \"string type\" \"mix\" \"string materials\" [\"{0}\" \"{0}\"]\n",
            i + 1
        );
    }
    let start = Instant::now();
    folder.world(&format!("{deep}NamedMaterial \"0\" Shape \"sphere\"")).unwrap();
    // 2^15 means of four million pixels took minutes
    assert!(start.elapsed() < HANG, "{:?}", start.elapsed());

    // 11 levels of one triangle, and ten files in each of eleven that include each other
    let levels = "Shape \"loopsubdiv\" \"integer indices\" [0 1 2] \"point3 P\" [0 0 0 1 0 0 0 1 0] \
        \"integer levels\" 11";
    fails(folder.world(levels), "4194304 triangles of a subdivision, more than 2");
    for i in 0..11 {
        let include = format!("Include \"{}.pbrt\"\n", i + 1).repeat(10);
        std::fs::write(folder.path().join(format!("{i}.pbrt")), include).unwrap();
    }
    std::fs::write(folder.path().join("11.pbrt"), "Translate 0 0 0").unwrap();
    fails(folder.world("Include \"0.pbrt\""), "262145 files of directives, more than 262144");
}

/// A mesh can be included any number of times: what becomes of it is in proportion to the files.
#[test]
fn files_that_are_included_again_count_again() {
    let mesh = format!(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [{}]\n",
        "0 1 2 ".repeat(10_000)
    );
    let folder = Folder::new().with("m.pbrt", mesh);
    let world = |times: usize| folder.world(&"Include \"m.pbrt\"\n".repeat(times));
    assert_eq!(world(10).unwrap().scene.surfaces(), 100_000);
    fails(world(300), "m.pbrt: line 1: 2230000 surfaces so far, more than 22");
}

/// Any number of shapes can name one gzipped mesh: what all become together is in proportion to the files.
#[test]
fn inflated_files_count_together() {
    let mesh = ply("", &["0 0 0", "1 0 0", "0 1 0"], &["3 0 1 2"]) + &" ".repeat(6 << 20);
    let mut encoder = flate2::write::GzEncoder::new(vec![], flate2::Compression::default());
    encoder.write_all(mesh.as_bytes()).unwrap();
    let folder = Folder::new().with("a.ply.gz", encoder.finish().unwrap());
    let shape = "Shape \"plymesh\" \"string filename\" \"a.ply.gz\"\n";
    folder.world(shape).unwrap();
    fails(folder.world(&shape.repeat(40)), "inflated bytes so far, more than");
}
