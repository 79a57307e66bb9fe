use noisefloor::Tile;
use noisefloor_image::{RenderLayers, StackError, StackFault, write_exr, write_png};
use noisefloor_learn::CorpusError;
use noisefloor_learn::{Corpus, Encoding, ZoneImages};
use std::path::Path;

const HEADER: &str = "scene,renderer,zone,x,y,width,height,human_spp,first_spp,last_spp\n";

fn table(dir: &Path, rows: &str) {
    std::fs::write(dir.join("thresholds.csv"), format!("{HEADER}{rows}")).unwrap();
}

/// A 40×40 PNG whose red is x, green y and blue the value.
fn coordinates(path: &Path, blue: u8) {
    let rgb: Vec<u8> = (0..40u8).flat_map(|y| (0..40u8).flat_map(move |x| [x, y, blue])).collect();
    write_png(path, 40, 40, &rgb).unwrap();
}

/// Two scenes of running means with four zones of 20×20 each.
fn scenes(dir: &Path) {
    let mut rows = String::new();
    for (scene, human) in [("Kitchen", "70"), ("Bath", "900")] {
        std::fs::create_dir(dir.join(scene)).unwrap();
        for (i, spp) in [10, 50, 900].into_iter().enumerate() {
            coordinates(&dir.join(scene).join(format!("{spp:05}.png")), i as u8);
        }
        for zone in 0..4 {
            rows +=
                &format!("{scene},maxwell,{zone},{},{},20,20,{human},10,900\n", zone % 2 * 20, zone / 2 * 20);
        }
    }
    table(dir, &rows);
}

#[test]
fn running_means_with_halos() {
    let folder = tempfile::tempdir().unwrap();
    scenes(folder.path());
    let corpus = Corpus::open(folder.path()).unwrap();
    assert_eq!((corpus.scenes(), corpus.zones().len()), (vec!["Kitchen", "Bath"], 8));
    let zone = &corpus.zones()[1];
    assert_eq!(
        (zone.row.scene.as_str(), zone.row.zone, zone.row.x, zone.row.human_spp, zone.censored()),
        ("Kitchen", 1, 20, 70.0, false)
    );
    // At the most converged image observers could choose
    assert!(corpus.zones()[4].censored());

    let levels: Vec<_> = corpus.scene_levels("Kitchen").unwrap().map(Result::unwrap).collect();
    assert_eq!(levels.len(), 12);
    let order: Vec<_> = levels.iter().map(|l| (l.last, l.zone)).collect();
    assert_eq!(order[3..6], [(10, 3), (50, 0), (50, 1)]);
    let level = &levels[5];
    assert_eq!((level.first, level.last, level.encoding), (0, 50, Encoding::Display));

    // JudgedZone 1 is the top right quarter: halo to the left and below
    let patch = &level.patch;
    assert_eq!((patch.width, patch.height), (28, 28));
    assert_eq!(patch.inner, Tile { index: 0, x: 8, y: 0, width: 20, height: 20 });
    assert_eq!(patch.pixels[0], [12.0 / 255.0, 0.0, 1.0 / 255.0]);
    assert_eq!(patch.pixels[28 * 28 - 1], [39.0 / 255.0, 27.0 / 255.0, 1.0 / 255.0]);
    let inner: Vec<_> = patch.inner_pixels().collect();
    assert_eq!(
        (inner.len(), inner[0], inner[399]),
        (400, [20.0 / 255.0, 0.0, 1.0 / 255.0], [39.0 / 255.0, 19.0 / 255.0, 1.0 / 255.0])
    );

    let error = corpus.scene_levels("Attic").unwrap_err();
    assert!(error.to_string().contains("Kitchen, Bath"), "{error}");
}

fn one_scene(dir: &Path) {
    for zone in ["zone00", "zone01"] {
        std::fs::create_dir(dir.join(zone)).unwrap();
        for (first, last, value) in [(0, 20, 1.0), (20, 60, 2.0)] {
            flat_exr(&dir.join(zone).join(format!("batch_{first:05}_{last:05}.exr")), (16, 12), value);
        }
    }
    table(dir, "stairs,path,0,36,36,16,12,30,20,10000\nstairs,path,1,236,36,16,12,10000,20,20000\n");
}

#[test]
fn batches_of_zones() {
    let folder = tempfile::tempdir().unwrap();
    one_scene(folder.path());
    let corpus = Corpus::open(folder.path()).unwrap();
    assert_eq!(corpus.zones()[1].stack, ZoneImages::Batches(folder.path().join("zone01")));
    // 10000 means at or above 10,000
    assert_eq!(corpus.zones().iter().map(|z| z.censored()).collect::<Vec<_>>(), [false, true]);
    let levels: Vec<_> = corpus.scene_levels("stairs").unwrap().map(Result::unwrap).collect();
    let order: Vec<_> = levels.iter().map(|l| (l.zone, l.first, l.last)).collect();
    assert_eq!(order, [(0, 0, 20), (0, 20, 60), (1, 0, 20), (1, 20, 60)]);
    assert!(levels.iter().all(|l| l.encoding == Encoding::Linear));
    assert_eq!(levels[3].patch.inner, Tile { index: 0, x: 0, y: 0, width: 16, height: 12 });
    assert_eq!(levels[3].patch.pixels, [[2.0; 3]; 16 * 12]);
}

#[test]
fn malformed_rows_have_a_line() {
    let folder = tempfile::tempdir().unwrap();
    scenes(folder.path());
    let good = "Bath,m,0,0,0,20,20,70,10,900\n";
    for (row, word) in [
        ("Bath,m,1,0,0,20,20,seventy,10,900\n", "human_spp"),
        ("Bath,m,1,0,0,20,20,nan,10,900\n", "human_spp"),
        ("Bath,m,1,0,0,20,20,-7,10,900\n", "human_spp"),
        ("Bath,m,-1,0,0,20,20,70,10,900\n", "zone"),
        ("Bath,m,1,0,0,0,20,70,10,900\n", "0×20"),
        ("Bath,m,1,99999999,0,20,20,70,10,900\n", "x and y"),
        ("Bath,m,1,0,0,20,20,70,901,900\n", "first_spp"),
        ("Bath,m,1,0,0,20\n", "6"),
        ("Bath,m,0,0,0,20,20,70,10,900\n", "already"),
        ("../Bath,m,1,0,0,20,20,70,10,900\n", "plain folder name"),
        ("..,m,1,0,0,20,20,70,10,900\n", "plain folder name"),
        ("/,m,1,0,0,20,20,70,10,900\n", "plain folder name"),
        (",m,1,0,0,20,20,70,10,900\n", "plain folder name"),
    ] {
        table(folder.path(), &format!("{good}{row}"));
        let error = Corpus::open(folder.path()).unwrap_err();
        assert!(matches!(error, CorpusError::Row { line: 3, .. }), "{row}{error}");
        let said = error.to_string();
        assert!(said.contains(word) && said.contains("line 3") && said.contains("thresholds.csv"), "{said}");
    }

    std::fs::write(folder.path().join("thresholds.csv"), "scene,zone\nBath,1\n").unwrap();
    assert!(Corpus::open(folder.path()).unwrap_err().to_string().contains("missing field `renderer`"));
    for text in [HEADER.as_bytes(), b"", b"\xff\xfe\n\xff"] {
        std::fs::write(folder.path().join("thresholds.csv"), text).unwrap();
        assert!(matches!(Corpus::open(folder.path()), Err(CorpusError::Row { .. })));
    }
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = Corpus::open(folder.path()).unwrap_err();
    assert!(
        matches!(error, CorpusError::Io { .. }) && error.to_string().contains("thresholds.csv"),
        "{error}"
    );

    one_scene(folder.path());
    std::fs::remove_file(folder.path().join("zone01/batch_00000_00020.exr")).unwrap();
    let error = Corpus::open(folder.path()).unwrap_err();
    assert!(matches!(error, CorpusError::Stack(StackError { fault: StackFault::Start(_), .. })), "{error}");
    std::fs::remove_dir_all(folder.path().join("zone01")).unwrap();
    let error = Corpus::open(folder.path()).unwrap_err();
    assert!(
        matches!(error, CorpusError::NoImages { zone: 1, .. }) && error.to_string().contains("zone01"),
        "{error}"
    );

    table(folder.path(), "stairs,path,0,0,0,16,12,30,20,900\nattic,path,0,0,0,16,12,30,20,900\n");
    assert!(matches!(Corpus::open(folder.path()), Err(CorpusError::Scenes { .. })));
}

#[test]
fn zones_must_fit_their_images() {
    let folder = tempfile::tempdir().unwrap();
    scenes(folder.path());
    table(folder.path(), "Bath,m,0,30,0,20,20,70,10,900\n");
    let corpus = Corpus::open(folder.path()).unwrap();
    let mut levels = corpus.scene_levels("Bath").unwrap();
    let error = levels.next().unwrap().unwrap_err();
    assert!(
        matches!(error, CorpusError::Zone { width: 40, .. }) && error.to_string().contains("00010.png"),
        "{error}"
    );
    assert!(levels.next().is_none());

    // An image of another size in the middle of the stack
    table(folder.path(), "Bath,m,0,0,0,4,4,70,10,900\n");
    let rgb = [[0.0; 3]; 30 * 30];
    write_exr(folder.path().join("Bath/00060.exr"), &RenderLayers::rgb(30, 30, &rgb)).unwrap();
    let corpus = Corpus::open(folder.path()).unwrap();
    let errors: Vec<_> = corpus.scene_levels("Bath").unwrap().filter_map(Result::err).collect();
    assert!(
        matches!(&errors[..], [CorpusError::Stack(StackError { fault: StackFault::Size { .. }, .. })]),
        "{errors:?}"
    );
}

/// Writes a grey EXR of one value.
fn flat_exr(path: &Path, size: (usize, usize), value: f32) {
    let rgb = vec![[value; 3]; size.0 * size.1];
    write_exr(path, &RenderLayers::rgb(size.0, size.1, &rgb)).unwrap();
}
