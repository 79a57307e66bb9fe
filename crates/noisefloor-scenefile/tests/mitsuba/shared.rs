use noisefloor_scenefile::load;
use std::io::Write;
use std::path::PathBuf;

/// `scenes/<name>/scene.xml` in `NOISEFLOOR_SHARED`, or else in `../shared` beside the repository.
fn scene(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("NOISEFLOOR_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let path = root.join("scenes").join(name).join("scene.xml");
    if path.is_file() {
        return Some(path);
    }
    // Past the capture of the test harness, which keeps what passing tests print to itself
    let stderr = &mut std::io::stderr();
    writeln!(stderr, "SKIPPED: no {}; set NOISEFLOOR_SHARED to the folder of shared data", path.display())
        .unwrap();
    None
}

/// Faces, by `grep -c '^f'`, without those that have no area, and the rest of what the files say.
#[test]
fn scenes_of_research_are_read() {
    for (name, surfaces, lights, fov, eye, left_out) in [
        ("modern-hall", 28_500, 21, 70.0, [6.911_82, 1.651_63, 2.554_14], 2),
        ("living-room", 142_973, 1, 90.0, [5.105_18, 0.731_065, -2.317_89], 8),
    ] {
        let Some(path) = scene(name) else { continue };
        let loaded = load(&path).unwrap();
        assert_eq!((loaded.scene.surfaces(), loaded.scene.lights()), (surfaces, lights), "{name}");
        assert_eq!((loaded.size, loaded.max_depth), (Some((512, 512)), Some(65)));
        let camera = loaded.scene.camera();
        assert_eq!(camera.eye, eye);
        assert!((camera.vertical_fov - fov).abs() < 1e-4);
        assert_eq!(loaded.warnings.len(), left_out, "{:?}", loaded.warnings);
        assert!(
            loaded.warnings.iter().all(|warning| warning.what.ends_with("have no area and are left out"))
        );
    }
}
