use crate::util::{Folder, PINHOLE, assert_warns, fails};
use noisefloor_scenefile::LoadOptions;

#[test]
fn errors_say_where_and_what() {
    let folder = Folder::new().with("bad.ply", "ply\nformat ascii 1.0\nend_header\n");
    for (world, want) in [
        ("Shape 'curve'", "line 3: Shape \"curve\" is not supported"),
        ("\nMaterial 'hair'\nShape 'sphere'", "line 4: the material `hair` is not supported"),
        ("LightSource 'goniometric'", "line 3: LightSource \"goniometric\" is not supported"),
        ("NamedMaterial 'a' Shape 'sphere'", "line 3: there is no material `a`"),
        ("Material 'diffuse' 'texture reflectance' 'a' Shape 'sphere'", "there is no texture `a`"),
        ("Shape 'trianglemesh'", "line 3: a mesh needs its points `P`"),
        ("Shape 'trianglemesh' 'point3 P' [0 0 0 1]", "`P` has 4 numbers, not a multiple of 3"),
        ("Shape 'trianglemesh' 'point3 P' [0 0 0] 'integer indices' [0 1 2]", "there are 1 vertices"),
        ("Shape 'trianglemesh' 'point3 P' [0 0 0] 'integer indices' [0 -1 2]", "whole numbers of at least 0"),
        ("Shape 'sphere' 'float radius' 0", "line 3: `radius` is 0; it must be above 0"),
        ("Shape 'sphere' 'float radius' 'one'", "`radius` must be numbers"),
        ("Shape 'sphere' 'float radius' [1 2]", "`radius` has 2 numbers instead of one"),
        ("Shape 'sphere' 'radius' 1", "`radius` is not a type and a name"),
        ("Shape 'sphere' 'float radius' [1", "the values of `radius` do not end"),
        ("Shape 'sphere' 'float radius' [1 'a']", "`radius` mixes numbers, texts and switches"),
        ("Shape 'sphere' 'float radius' nan", "`nan` is not a finite number"),
        ("Shape 'sph", "line 3: a quote does not end"),
        ("Translate 1 2", "expected 3 numbers"),
        ("Rotate 1 0 0 0", "a rotation needs an axis that is not 0"),
        ("LookAt 0 0 0 0 0 0 0 1 0", "eye and target are the same"),
        ("Scale 1e300 1 1 Scale 1e300 1 1", "the transform is too large"),
        ("AttributeEnd", "AttributeEnd without its begin"),
        ("ObjectInstance 'o'", "there is no object `o`"),
        ("Include '../a.pbrt'", "lies outside the folder of the scene"),
        ("Shape 'plymesh' 'string filename' 'none.ply'", "cannot be read"),
        ("12", "expected a directive"),
        ("Shape sphere", "line 3: Shape needs a name in quotes"),
        ("SetAbsorber\nShape 'sphere'", "line 3: the directive SetAbsorber is not known"),
        ("ScenePhoto 'string filename' 'b.png'", "line 3: the directive ScenePhoto is not known"),
        ("Shpe 'sphere' [1 2] 'x'", "line 3: the directive Shpe is not known"),
        ("ColorSpace 'acescg'", "line 3: the colour space `acescg` is not supported"),
        (
            "AreaLightSource 'diffuse' 'rgb L' [1 1 1] 'string filename' 'a.png'",
            "an area light has either `L` or a `filename`",
        ),
        ("MakeNamedMedium 'fog'", "a participating medium (`--ignore volumes` leaves them all out)"),
        ("AreaLightSource 'diffuse' 'rgb L' [-1 0 0] Shape 'sphere'", "is negative or too large"),
        ("LightSource 'infinite' LightSource 'infinite'", "a second light surrounds the scene"),
    ] {
        fails(folder.world(world), want);
        fails(folder.world(world), ".pbrt");
    }
    fails(folder.load_with("Shape 'sphere'", &LoadOptions::default()), "no WorldBegin");
}

/// One load names all shapes that are wrong, and what is left out is warned of.
#[test]
fn all_is_said_at_once() {
    let folder = Folder::new();
    let error = folder.world("Shape 'curve'\nShape 'curve'\nLightSource 'projection'").unwrap_err();
    let lines: Vec<&str> = error.lines().collect();
    assert_eq!(lines.len(), 2, "{error}");
    assert!(lines[0].contains("(2 times: ") && lines[0].ends_with("line 3, line 4)"), "{error}");

    let world = "Shape 'sphere' 'float wobble' 1\nMaterial 'coateddiffuse' Shape 'sphere'";
    let loaded = folder.world(world).unwrap();
    assert_eq!(loaded.warnings.len(), 3);
    assert_warns(&loaded, &["scene.pbrt: the scene has no light: it is black"]);
    assert_warns(&loaded, &["line 3: `wobble` of Shape \"sphere\" is ignored"]);
    assert_warns(&loaded, &["line 4: the material `coateddiffuse` is replaced by"]);

    let mut options = LoadOptions::default();
    options.ignore_volumes = true;
    let text = "WorldBegin MakeNamedMedium 'm' MediumInterface 'm' '' Shape 'sphere'";
    assert!(!folder.load_with(text, &options).unwrap().warnings.is_empty());
}

/// What version 3 and its exporters write, and what makes the picture another one.
#[test]
fn odd_spellings_are_read_and_losses_are_named() {
    let folder = Folder::new();
    let lit = "LightSource 'infinite' 'rgb L' [1, 1, 1,]\n";
    let loaded = folder.world(&format!("{lit}Shape 'sphere' 'float radius' 1,")).unwrap();
    assert_eq!(loaded.warnings, []);
    let options = "Option 'seed' 42 Option 'string msereferenceimage' 'a.exr' ColorSpace 'srgb'\n";
    let text = format!("{options}{}WorldBegin {lit}", PINHOLE);
    let loaded = folder.load_with(&text, &LoadOptions::default()).unwrap();
    assert_eq!(loaded.warnings, []);
    // What is not read is said, whatever it is a parameter of
    for (world, want) in [
        ("Shape 'trianglemesh' 'point3 P' [] 'integer indices' []", "the mesh has no faces"),
        (
            "Shape 'trianglemesh' 'point3 P' [0 0 0 1 0 0 2 0 0] 'integer indices' [0 1 2]",
            "a shape is left out: none of its faces has an area",
        ),
        (
            "Material 'glass' 'rgb Kr' [0.5 0.5 0.5] Shape 'sphere'",
            "`Kr` of the material `glass` is taken for 1",
        ),
        (
            "Shape 'bilinearmesh' 'point3 P' [0 0 0 1 0 0 0 1 0 1 1 0] 'string emissionfilename' 'a.exr'",
            "`emissionfilename` of Shape \"bilinearmesh\" is ignored",
        ),
        (
            "Texture 't' 'spectrum' 'checkerboard' 'integer dimension' 3",
            "a checkerboard in space is laid on by texture coordinates",
        ),
        (
            "Texture 't' 'spectrum' 'checkerboard' 'string mapping' 'planar' 'vector3 v1' [1 0 0]",
            "the texture is laid on by texture coordinates",
        ),
        (
            "Shape 'sphere' 'float alpha' 0.5 'float shadowalpha' 1",
            "`shadowalpha` of Shape \"sphere\" is ignored",
        ),
        ("Option 'bool forcediffuse' true", "the option `forcediffuse` is ignored"),
        ("Integrator 'path' 'bool regularize' true", "`regularize` of Integrator \"path\" is ignored"),
    ] {
        let warnings =
            folder.world(&format!("{lit}{world}")).unwrap_or_else(|e| panic!("{world}: {e}")).warnings;
        assert!(warnings.iter().any(|w| w.what == want), "{world}: {warnings:?}");
    }
    let same = "Shape 'sphere' 'float alpha' 0.5 'float shadowalpha' 0.5";
    assert_eq!(folder.world(&format!("{lit}{same}")).unwrap().warnings, []);
    let metal = "Material 'metal' 'rgb eta' [-0.01 1 1] 'rgb k' [3 3 3] Shape 'sphere'";
    assert_warns(&folder.world(&format!("{lit}{metal}")).unwrap(), &["brought into 0…100"]);
}

/// All directives that are not known are named by one load, with what follows them passed over.
#[test]
fn unknown_directives_are_named_at_once() {
    let error = Folder::new().world("SetA 'x' [1 'Y']\nShape 'sphere'\nSetB 1 2\nShape 'curve'").unwrap_err();
    let lines: Vec<&str> = error.lines().collect();
    assert_eq!(lines.len(), 3, "{error}");
    assert!(lines[1].ends_with("line 5: the directive SetB is not known"), "{error}");
}
