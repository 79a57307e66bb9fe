use crate::kit::{Folder, levels, stack};
use noisefloor_image::{RenderLayers, write_exr, write_png};
use noisefloor_study::{Study, StudyError};
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
    assert!(matches!(Study::open("/nonexistent/study.toml"), Err(StudyError::Io { .. })));
}

#[test]
fn broken_pictures_are_found_before_anyone_looks() {
    let folder = Folder::new("acquisition", &["wall"], &levels(4, 2.0), "");
    folder.study().check_pictures().unwrap();
    let path = folder.dir.path().join("wall/00020.png");
    write_png(&path, 16, 16, &[0; 768]).unwrap();
    assert!(matches!(folder.study().check_pictures(), Err(StudyError::Size { .. })));
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
    assert!(matches!(folder.study().check_pictures(), Err(StudyError::NotFinite { .. })));
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
    for (tile, png) in wall.grid().tiles().zip(wall.tile_pngs(2).unwrap()) {
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
