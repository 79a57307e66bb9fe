use crate::util::Folder;
use noisefloor_scenefile::load;
use noisefloor_testkit::HANG;
use std::time::Instant;

const SCENE: &str = "# everything
Integrator \"path\" \"integer maxdepth\" [8] Option \"bool disablepixeljitter\" true
LookAt 0 0 5 0 0 0 0 1 0 Scale -1 1 1
Camera \"perspective\" \"float fov\" [40] \"float lensradius\" 0.1
Film \"rgb\" \"integer xresolution\" [32] \"integer yresolution\" [24]
WorldBegin
Texture \"t\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 1 0] \"float uscale\" 4
Texture \"a\" \"float\" \"constant\" \"float value\" 0.5
MakeNamedMaterial \"m\" \"string type\" \"conductor\" \"spectrum eta\" \"metal-Cu-eta\" \"float roughness\" 0.2
MakeNamedMaterial \"n\" \"string type\" \"coateddiffuse\" \"texture reflectance\" \"t\"
MakeNamedMaterial \"x\" \"string type\" \"mix\" \"string materials\" [\"m\" \"n\"] \"float amount\" 0.4
AttributeBegin NamedMaterial \"x\" Translate 1 2 3 Rotate 30 0 1 0
Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" [0 0 0 1 0 0 0 1 0] \"texture alpha\" \"a\" AttributeEnd
ObjectBegin \"o\" Material \"dielectric\" \"float roughness\" 0.1 Shape \"sphere\" \"float radius\" 2 ObjectEnd
ObjectInstance \"o\" ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1]
Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]
Shape \"disk\" \"float radius\" 2 Shape \"cylinder\"
AreaLightSource \"diffuse\" \"blackbody L\" [5000] \"bool twosided\" true
Shape \"sphere\" \"float radius\" 0.25
LightSource \"infinite\" \"rgb L\" [0.1 0.2 0.3] LightSource \"spot\" \"spectrum I\" [400 1 700 2]
";

/// Changed files are scenes or errors that name the file. That they never panic is seen by this ending.
#[test]
fn changed_bytes_never_panic() {
    let folder = Folder::new();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, SCENE).unwrap();
    load(&path).unwrap();
    let mut random = fastrand::Rng::with_seed(4);
    let (mut broken, rounds) = (0, 2000);
    for round in 0..rounds {
        let mut bytes = SCENE.as_bytes().to_vec();
        for _ in 0..1 + random.usize(..3) {
            let at = random.usize(..bytes.len());
            match random.usize(..5) {
                0 => bytes[at] ^= 1 << random.usize(..8),
                // What numbers, quotes and brackets are made of
                1 | 2 => bytes[at] = b"0123456789-+.eE\"[]# \n"[random.usize(..21)],
                3 => bytes.truncate(at.max(1)),
                _ => {
                    let end = (at + 1 + random.usize(..60)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    bytes.splice(at..at, piece);
                }
            }
        }
        std::fs::write(&path, &bytes).unwrap();
        if let Err(error) = load(&path) {
            broken += 1;
            let findings: Vec<String> = error.findings().iter().map(ToString::to_string).collect();
            assert!(findings.iter().all(|f| f.contains("scene.pbrt")), "round {round}: {findings:?}");
        }
    }
    // Damage that is never noticed, or always, tests nothing
    assert!((rounds / 4..rounds).contains(&broken), "{broken}");
}

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
    let bomb = folder.world(&format!("{bomb}NamedMaterial \"0\" Shape \"sphere\"")).unwrap_err();
    assert!(bomb.contains("17 nested surfaces and textures, more than 16"), "{bomb}");
    let itself = "MakeNamedMaterial \"a\" \"string type\" \"mix\" \"string materials\" [\"a\" \"a\"] NamedMaterial \"a\"
        Shape \"sphere\"";
    let itself = folder.world(itself).unwrap_err();
    assert!(itself.contains("the material `mix` refers to itself"), "{itself}");
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
    let levels = folder.world(levels).unwrap_err();
    assert!(levels.contains("4194304 triangles of a subdivision, more than 2"), "{levels}");
    for i in 0..11 {
        let include = format!("Include \"{}.pbrt\"\n", i + 1).repeat(10);
        std::fs::write(folder.path().join(format!("{i}.pbrt")), include).unwrap();
    }
    std::fs::write(folder.path().join("11.pbrt"), "Translate 0 0 0").unwrap();
    let includes = folder.world("Include \"0.pbrt\"").unwrap_err();
    assert!(includes.contains("262145 files of directives, more than 262144"), "{includes}");
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
    let error = world(300).unwrap_err();
    assert!(error.contains("m.pbrt: line 1: 2230000 surfaces so far, more than 22"), "{error}");
}

/// Any number of shapes can name one gzipped mesh: what all become together is in proportion to the files.
#[test]
fn inflated_files_count_together() {
    use std::io::Write;
    let mut ply = b"ply\nformat ascii 1.0\n".to_vec();
    ply.extend(b"element vertex 3\nproperty float x\nproperty float y\nproperty float z\n");
    ply.extend(b"element face 1\nproperty list uchar int vertex_indices\nend_header\n");
    ply.extend(b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2");
    ply.extend(vec![b' '; 6 << 20]);
    let mut encoder = flate2::write::GzEncoder::new(vec![], flate2::Compression::default());
    encoder.write_all(&ply).unwrap();
    let folder = Folder::new().with("a.ply.gz", encoder.finish().unwrap());
    let shape = "Shape \"plymesh\" \"string filename\" \"a.ply.gz\"\n";
    folder.world(shape).unwrap();
    let error = folder.world(&shape.repeat(40)).unwrap_err();
    assert!(error.contains("inflated bytes so far, more than"), "{error}");
}
