use crate::kit::{Folder, Running, film, levels, stack};
use noisefloor_image::{RenderLayers, write_exr, write_png};
use noisefloor_study::analysis::files::write;
use noisefloor_study::analysis::{AnalysisOptions, CorpusThreshold, analyse};
use noisefloor_study::simulated::{Public, drive};
use noisefloor_study::{FileFault, Study, StudyError};
use std::fs;

/// What is wrong with a study is said, and where.
#[test]
fn malformed_studies_are_refused() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    let good = fs::read_to_string(&folder.file).unwrap();
    for (from, to, said) in [
        ("tile = 32", "tile = 7", "tile size 7"),
        ("tile = 32", "tile = 32\nrepeats = 0", "repeats is 0"),
        ("tile = 32", "tile = 32\nrepeats = 4000000000", "repeats is 4000000000"),
        ("tile = 32", "tile = 32\ncolour = 1", "colour"),
        ("tile = 32", "tile = \"x\"", "line 3"),
        ("[text.en]", "[text.de]", "text.de"),
        ("name = \"wall\"", "name = \"../wall\"", "plain name"),
        ("folder = \"wall\"", "folder = \"nowhere\"", "nowhere"),
        ("\"acquisition\"", "\"validation\"", "stops"),
        ("\"acquisition\"", "\"telepathy\"", "telepathy"),
        ("[[stack]]", "[[stack]]\nname = \"wall\"\nfolder = \"wall\"\n[[stack]]", "two stacks"),
    ] {
        assert!(good.contains(from));
        fs::write(&folder.file, good.replacen(from, to, 1)).unwrap();
        let error = Study::open(&folder.file).unwrap_err().to_string();
        assert!(error.contains(said), "{to}: {error}");
    }
    fs::write(&folder.file, "x = 1\n".repeat(1 << 18)).unwrap();
    assert!(Study::open(&folder.file).unwrap_err().to_string().contains("longer"));
    let absent = Study::open("/nonexistent/study.toml");
    assert!(matches!(absent, Err(StudyError::File { fault: FileFault::Io(_), .. })));
}

#[test]
fn broken_pictures_are_found_before_anyone_looks() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    folder.study().check_pictures().unwrap();
    let path = folder.dir.path().join("wall/00020.png");
    write_png(&path, 16, 16, &[0; 768]).unwrap();
    assert!(matches!(
        folder.study().check_pictures(),
        Err(StudyError::File { fault: FileFault::Size { .. }, .. })
    ));
    fs::write(&path, b"no picture").unwrap();
    assert!(matches!(folder.study().check_pictures(), Err(StudyError::Picture(_))));
    fs::remove_file(&path).unwrap();
    write_exr(folder.dir.path().join("wall/00020.exr"), &RenderLayers::rgb(64, 32, &vec![[1.0; 3]; 64 * 32]))
        .unwrap();
    assert!(folder.study().check_pictures().is_err(), "an EXR among PNGs");
}

/// Linear pictures are tone mapped by the exposure of the reference: twice the radiance everywhere is shown
/// brighter, and not settled away.
#[test]
fn linear_stacks_share_one_exposure() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    let dir = folder.dir.path().join("wall");
    fs::remove_dir_all(&dir).unwrap();
    fs::create_dir(&dir).unwrap();
    for (spp, radiance) in [(10, 2.0), (20, 1.0), (40, 1.0)] {
        write_exr(dir.join(format!("{spp}.exr")), &RenderLayers::rgb(64, 32, &vec![[radiance; 3]; 64 * 32]))
            .unwrap();
    }
    let study = folder.study();
    study.check_pictures().unwrap();
    let shown = |level| study.stacks[0].shown(level).unwrap()[0];
    assert!(shown(0) > shown(1) && shown(1) == shown(2), "{} {} {}", shown(0), shown(1), shown(2));
    // Log-average radiance 1 is shown at 0.18/1.18, sRGB-encoded: 0.427.
    assert_eq!(shown(2), 109);
    fs::write(dir.join("20.exr"), fs::read(dir.join("10.exr")).unwrap()).unwrap();
    write_exr(dir.join("10.exr"), &RenderLayers::rgb(64, 32, &vec![[f32::NAN; 3]; 64 * 32])).unwrap();
    assert!(matches!(
        folder.study().check_pictures(),
        Err(StudyError::File { fault: FileFault::NotFinite, .. })
    ));
}

/// Tiles are the picture, cut: put together again, every byte is there.
#[test]
fn tiles_hold_the_picture_unchanged() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    stack(&folder.dir.path().join("wall"), (70, 50), &levels(4, 2.0));
    let study = folder.study();
    let wall = &study.stacks[0];
    let whole = wall.shown(2).unwrap();
    assert_eq!(wall.grid().len(), 4, "six columns are joined to those beside them");
    for (tile, png) in wall.grid().tiles().zip(wall.tile_pngs(2, 0).unwrap()) {
        let path = folder.dir.path().join("tile.png");
        fs::write(&path, &png).unwrap();
        let read = noisefloor_image::read_png(&path).unwrap();
        assert_eq!((read.width, read.height), (tile.width, tile.height));
        let want = tile.rows(70).flatten().map(|i| whole[3 * i]);
        assert!(read.pixels.iter().map(|p| (p[0] * 255.0).round() as u8).eq(want));
    }
}

/// Where tiles stopped becomes the first level at or above; 30 % of it likewise.
#[test]
fn stops_become_levels() {
    let levels = [10, 20, 40, 80, 160, 320];
    let folder = Folder::new("validation", &["wall"], &levels, "");
    let csv = folder.dir.path().join("wall.csv");
    fs::write(&csv, "tile,x,spp\n1,32,5000\n0,0,100\n").unwrap();
    let study = folder.study();
    assert_eq!(study.stacks[0].stops(), Some(&[4, 5][..]));
    assert_eq!(study.stacks[0].noisy(), Some(&[2, 5][..]));
    for (bad, said) in [
        ("tile,spp\n0,100\n", "1 tiles"),
        ("tile,spp\n0,100\n2,100\n", "line 3"),
        ("tile,spp\n0,100\n1,-1\n", "line 3"),
        ("tile,samples\n0,100\n", "spp"),
    ] {
        fs::write(&csv, bad).unwrap();
        let error = Study::open(&folder.file).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

/// A stack with a rate is a loop: a folder of pictures for each frame, all with the same levels, sizes and
/// exposure.
#[test]
fn a_stack_may_be_a_loop_of_frames() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    let dir = folder.dir.path().join("wall");
    let still = folder.study().design();
    assert!(!still.contains("film"), "{still}");
    let text = fs::read_to_string(&folder.file).unwrap();
    let with = |fps: &str| fs::write(&folder.file, text.clone() + &format!("fps = {fps}\n")).unwrap();
    let refused = |said: &str| {
        let error = Study::open(&folder.file).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    };
    with("24");
    refused("0 folders of frames");
    fs::remove_dir_all(&dir).unwrap();
    film(&dir, (64, 32), &levels(4, 2.0), 3);
    for wrong in ["0", "1000", "nan"] {
        with(wrong);
        refused("1 to 240 frames a second");
    }
    with("24");
    let study = folder.study();
    study.check_pictures().unwrap();
    let wall = &study.stacks[0];
    assert_eq!((wall.frames(), wall.fps(), wall.levels().len()), (3, Some(24.0), 4));
    let [first, second] = [0, 1].map(|frame| wall.tile_pngs(0, frame).unwrap());
    assert!(first[0] != second[0] && first[1] != second[1]);
    assert!(study.design().contains("[3,24.0]") && study.design() != still);
    // A frame that lacks a level, and one of another size
    fs::rename(dir.join("0003/00020.png"), dir.join("0003/00021.png")).unwrap();
    refused("whose levels are not those of");
    fs::rename(dir.join("0003/00021.png"), dir.join("0003/00020.png")).unwrap();
    stack(&dir.join("0002"), (32, 32), &[20]);
    assert!(matches!(
        folder.study().check_pictures(),
        Err(StudyError::File { fault: FileFault::Size { .. }, .. })
    ));
}

/// Simulated observers of a still and of a loop with lower thresholds: the analysis finds both, and the
/// corpus for models of stills has the still only.
#[test]
fn thresholds_of_loops_are_found_and_kept_out_of_the_corpus() {
    let folder = Folder::new("acquisition", &["wall", "film"], &levels(14, 1.45), "repeats = 2");
    let dir = folder.dir.path().join("film");
    fs::remove_dir_all(&dir).unwrap();
    film(&dir, (64, 32), &levels(14, 1.45), 2);
    let mut text = fs::read_to_string(&folder.file).unwrap();
    text += "fps = 24\n[screening]\ncatch = 0\n";
    fs::write(&folder.file, text).unwrap();
    let study = folder.study();
    let server = Running::start(study.clone());
    let thresholds = vec![vec![400.0, 500.0], vec![150.0, 200.0]];
    let public = Public { between: 0.25, within: 0.1, ..Public::of(thresholds) };
    for seed in 0..12 {
        drive(&server.url, "", &mut public.draw(seed), |_| ()).unwrap();
    }
    let options = AnalysisOptions { keep_excluded: true, seed: 1, simulated: true };
    let report = analyse(&study, options).unwrap();
    assert_eq!(report.tiles.len(), 4);
    for (tile, truth) in report.tiles.iter().zip(public.thresholds.iter().flatten()) {
        // Twelve observers of scale 0.27 know the median to 0.27·2/√12 = 0.16, times 3
        let off = (tile.median / truth).ln().abs();
        assert!(off < 0.48, "{} {}: {} for {truth}", tile.stack, tile.tile, tile.median);
    }
    let out = folder.dir.path().join("out");
    write(&out, &study, &report, CorpusThreshold::Mean).unwrap();
    let corpus = fs::read_to_string(out.join("corpus-simulated/thresholds.csv")).unwrap();
    assert!(corpus.contains("wall") && !corpus.contains("film"), "{corpus}");
    assert!(!out.join("corpus-simulated/film").exists() && out.join("grid-film.png").exists());
}
