use crate::util::flat_exr;
use noisefloor::{ProgressiveSource, Request, SourceError, Tile, TileGrid};
use noisefloor_image::{
    PictureFault, RenderLayers, StackError, StackFault, StackSource, batches, running_means, write_exr,
    write_png,
};
use std::path::Path;

const SIZE: (usize, usize) = (48, 20);

/// Two tiles: 32 and 8 pixels wide.
fn tiles() -> Vec<Tile> {
    TileGrid::new(SIZE.0, SIZE.1, 32).unwrap().tiles().collect()
}

fn batch(dir: &Path, first: u64, last: u64, value: f32) {
    flat_exr(&dir.join(format!("batch_{first:05}_{last:05}.exr")), SIZE, value);
}

fn fault<T>(opened: Result<T, StackError>) -> StackFault {
    opened.map(drop).unwrap_err().fault
}

fn cause(error: SourceError) -> StackError {
    match error {
        SourceError::Failed { cause, .. } => *cause.downcast().unwrap(),
        other => panic!("{other}"),
    }
}

/// A picture that differs in every pixel.
fn ramp(scale: f32) -> Vec<[f32; 3]> {
    (0..SIZE.0 * SIZE.1).map(|i| [i as f32 * scale, 1.0 - scale, (i % 7) as f32]).collect()
}

#[test]
fn running_means_give_the_batches_back() {
    let folder = tempfile::tempdir().unwrap();
    let batches = [(0u64, 10u64, ramp(0.5)), (10, 30, ramp(2.0)), (30, 100, ramp(-1.0))];
    let mut sum = vec![[0.0f64; 3]; SIZE.0 * SIZE.1];
    for (first, last, mean) in &batches {
        for (sum, mean) in sum.iter_mut().flatten().zip(mean.iter().flatten()) {
            *sum += (last - first) as f64 * f64::from(*mean);
        }
        let running: Vec<[f32; 3]> = sum.iter().map(|s| s.map(|s| (s / *last as f64) as f32)).collect();
        write_exr(folder.path().join(format!("{last:05}.exr")), &RenderLayers::rgb(SIZE.0, SIZE.1, &running))
            .unwrap();
    }
    std::fs::write(folder.path().join("notes.txt"), "left alone").unwrap();

    let mut stack = StackSource::open(folder.path()).unwrap();
    let info = stack.info();
    assert_eq!((info.width, info.height, info.aims), (SIZE.0, SIZE.1, true));
    for (first, last, mean) in &batches {
        for tile in tiles() {
            let got = stack.sample(&[Request::new(tile, *first, 1)]).unwrap().remove(0);
            assert_eq!((got.tile, got.spp), (tile, last - first));
            let want = tile.rows(SIZE.0).flat_map(|row| mean[row].to_vec());
            for (got, want) in got.mean.iter().flatten().zip(want.flatten()) {
                // Running means are stored in f32: half an ulp of values up to 1600, times at most 100/70 +
                // 30/70
                assert!((got - want).abs() < 2e-3, "{got} {want}");
            }
        }
    }
}

#[test]
fn pngs_are_linearised_before_the_difference() {
    let folder = tempfile::tempdir().unwrap();
    let encode = |linear: f32| (noisefloor::display::srgb_encode(linear) * 255.0).round() as u8;
    let (early, late) = (encode(0.2), encode(0.4));
    for (name, code) in [("00010.png", early), ("00020.png", late)] {
        write_png(folder.path().join(name), SIZE.0, SIZE.1, &vec![code; SIZE.0 * SIZE.1 * 3]).unwrap();
    }
    let mut stack = StackSource::open(folder.path()).unwrap();
    let got = stack.sample(&[Request::new(tiles()[0], 10, 10)]).unwrap().remove(0);
    let linear = |code: u8| noisefloor::display::srgb_decode(f32::from(code) / 255.0);
    let want = 2.0 * linear(late) - linear(early);
    assert!((got.mean[0][0] - want).abs() < 1e-6 && (want - 0.6).abs() < 0.01);
}

#[test]
fn batches_are_handed_out_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    batch(folder.path(), 0, 20, 1.0);
    batch(folder.path(), 20, 60, 2.0);
    batch(folder.path(), 60, 61, f32::NAN);
    let mut stack = StackSource::open(folder.path()).unwrap();
    let tiles = tiles();
    let ask = |tile: usize, first, samples| Request::new(tiles[tile], first, samples);

    // Tiles at different depths, answered in the order of the requests; the end is an empty batch
    let got = stack.sample(&[ask(1, 60, 5), ask(0, 0, 1000), ask(1, 20, 1), ask(0, 61, 1)]).unwrap();
    assert_eq!(
        got.iter().map(|b| (b.tile.index, b.spp)).collect::<Vec<_>>(),
        [(1, 1), (0, 20), (1, 40), (0, 0)]
    );
    assert_eq!(got.iter().map(|b| b.mean.len()).collect::<Vec<_>>(), [16 * 20, 32 * 20, 16 * 20, 0]);
    assert!(got[0].mean[0][0].is_nan());
    assert_eq!((got[1].mean[0], got[2].mean[0]), ([1.0; 3], [2.0; 3]));

    // Again, and the same
    assert_eq!(stack.sample(&[ask(0, 0, 1000)]).unwrap()[0], got[1]);
    assert_eq!(stack.sample(&[]).unwrap(), []);
}

#[test]
fn requests_that_cannot_be_met() {
    let folder = tempfile::tempdir().unwrap();
    batch(folder.path(), 0, 20, 1.0);
    batch(folder.path(), 20, 60, 2.0);
    let mut stack = StackSource::open(folder.path()).unwrap();
    for (first, nearest) in [(7, 0), (15, 20), (1000, 60)] {
        let error = cause(stack.sample(&[Request::new(tiles()[0], first, 1)]).unwrap_err());
        assert!(matches!(error.fault, StackFault::Boundary { near, .. } if near == nearest), "{error}");
    }
    let tile = Tile { x: usize::MAX, ..tiles()[0] };
    let error = cause(stack.sample(&[Request::new(tile, 0, 1)]).unwrap_err());
    assert!(matches!(error.fault, StackFault::Tile { .. }), "{error}");
    // What failed before does not spoil what comes after
    assert_eq!(stack.sample(&[Request::new(tiles()[0], 0, 1)]).unwrap()[0].spp, 20);
}

#[test]
fn gaps_and_overlaps_name_both_files() {
    let folder = tempfile::tempdir().unwrap();
    batch(folder.path(), 0, 20, 1.0);
    batch(folder.path(), 40, 60, 1.0);
    let error = StackSource::open(folder.path()).unwrap_err();
    assert!(matches!(error.fault, StackFault::Gap { from: 20, to: 40, .. }), "{error}");
    let said = error.to_string();
    assert!(said.contains("batch_00000_00020.exr") && said.contains("batch_00040_00060.exr"), "{said}");

    batch(folder.path(), 20, 50, 1.0);
    let error = StackSource::open(folder.path()).unwrap_err();
    assert!(matches!(error.fault, StackFault::Overlap(_)), "{error}");

    let folder = tempfile::tempdir().unwrap();
    batch(folder.path(), 20, 40, 1.0);
    assert!(matches!(fault(StackSource::open(folder.path())), StackFault::Start(20)));
}

#[test]
fn folders_that_are_no_stack() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    assert!(matches!(fault(StackSource::open(dir.join("absent"))), StackFault::Folder(_)));
    assert!(matches!(fault(StackSource::open(dir)), StackFault::Nothing));
    assert!(matches!(fault(running_means(dir)), StackFault::Nothing));
    assert!(matches!(fault(batches(dir)), StackFault::Nothing));

    for name in [
        "batch_0_x.exr",
        "batch_20_20.exr",
        "batch_+1_+2.exr",
        "batch_0_99999999999.exr",
        "00000.png",
        "99999999999.exr",
    ] {
        std::fs::write(dir.join(name), "").unwrap();
        assert!(matches!(fault(StackSource::open(dir)), StackFault::Name(_)), "{name}");
        std::fs::remove_file(dir.join(name)).unwrap();
    }

    flat_exr(&dir.join("00010.exr"), SIZE, 1.0);
    batch(dir, 0, 20, 1.0);
    assert!(matches!(fault(StackSource::open(dir)), StackFault::Ambiguous));
    std::fs::remove_file(dir.join("batch_00000_00020.exr")).unwrap();
    flat_exr(&dir.join("10.exr"), SIZE, 1.0);
    assert!(matches!(fault(StackSource::open(dir)), StackFault::Overlap(_)));
}

#[test]
fn odd_images_are_named_when_they_are_reached() {
    let folder = tempfile::tempdir().unwrap();
    batch(folder.path(), 0, 20, 1.0);
    flat_exr(&folder.path().join("batch_00020_00040.exr"), (8, 8), 1.0);
    std::fs::write(folder.path().join("batch_00040_00060.exr"), "not an image").unwrap();
    let mut stack = StackSource::open(folder.path()).unwrap();
    let error = cause(stack.sample(&[Request::new(tiles()[0], 20, 1)]).unwrap_err());
    assert!(
        matches!(error.fault, StackFault::Size { .. }) && error.path.ends_with("batch_00020_00040.exr"),
        "{error}"
    );
    let error = cause(stack.sample(&[Request::new(tiles()[0], 40, 1)]).unwrap_err());
    assert!(matches!(error.fault, StackFault::Picture(PictureFault::Foreign { .. })), "{error}");
}

#[test]
fn the_identity_of_a_stack_is_what_is_in_its_pictures() {
    let folder = tempfile::tempdir().unwrap();
    batch(folder.path(), 0, 10, 0.5);
    batch(folder.path(), 10, 20, 0.5);
    let identity = || StackSource::open(folder.path()).unwrap().identity().unwrap();
    let before = identity();
    assert_eq!(before, identity());
    batch(folder.path(), 10, 20, 0.25);
    let change = identity().change_since(&before).unwrap().to_string();
    assert_eq!(change, "`batch_00010_00020.exr` has changed");
}
