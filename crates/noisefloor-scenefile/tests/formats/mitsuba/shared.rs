use noisefloor_scenefile::load;
use noisefloor_testkit::require_shared;

/// Faces, by `grep -c '^f'`, without those that have no area, and the rest of what the files say. Eight lamps of
/// modern-hall and one thing in living-room are rectangles of two faces, which become one surface each.
#[test]
fn scenes_of_research_are_read() {
    for (name, surfaces, lights, fov, eye, left_out) in [
        ("modern-hall", 28_492, 13, 70.0, [6.911_82, 1.651_63, 2.554_14], 2),
        ("living-room", 142_972, 1, 90.0, [5.105_18, 0.731_065, -2.317_89], 8),
    ] {
        let Some(path) = require_shared(format!("scenes/{name}/scene.xml")) else { continue };
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
