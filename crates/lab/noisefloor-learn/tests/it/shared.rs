use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_image::StackSource;
use noisefloor_learn::{Corpus, Encoding};
use noisefloor_testkit::require_shared;

#[test]
fn lisic9_is_read() {
    let Some(dir) = require_shared("human/lisic9") else { return };
    let corpus = Corpus::open(&dir).unwrap();
    assert_eq!((corpus.scenes().len(), corpus.zones().len()), (7, 112));
    let levels: Vec<_> = corpus.scene_levels("Selles").unwrap().map(Result::unwrap).collect();
    assert_eq!(levels.len(), 12 * 16);
    assert!(
        levels.iter().all(|l| l.encoding == Encoding::Display && l.patch.inner_pixels().count() == 200 * 200)
    );
    let zone = levels.iter().find(|l| l.zone == 5).unwrap();
    assert_eq!((zone.last, zone.patch.width, zone.patch.height), (50, 216, 216));

    // Played back: the batches, weighted by their samples, add up to the last image
    let mut stack = StackSource::open(dir.join("Selles")).unwrap();
    let (tile, mut sum, mut first) = (TileGrid::new(800, 800, 128).unwrap().tile(10), 0.0, 0);
    loop {
        let batch = stack.sample(&[Request::new(tile, first, 100)]).unwrap().remove(0);
        if batch.spp == 0 {
            break;
        }
        sum += batch.spp as f64 * f64::from(batch.mean[77][1]);
        first += batch.spp;
    }
    assert_eq!(first, 3100);
    let last = noisefloor_image::read_picture(dir.join("Selles/03100.png")).unwrap().into_linear();
    let (x, y) = (tile.x + 77, tile.y);
    let want = f64::from(last.pixels[y * 800 + x][1]);
    // Twelve differences rounded to f32, the largest about 60 times amplified
    assert!((sum / 3100.0 - want).abs() < 1e-5, "{} {want}", sum / 3100.0);
}

#[test]
fn staircase_is_read() {
    let Some(dir) = require_shared("human/sin3d-rerendered/staircase2-view0") else { return };
    let corpus = Corpus::open(&dir).unwrap();
    assert_eq!((corpus.scenes(), corpus.zones().len()), (vec!["staircase2-view0"], 16));
    let mut count = 0;
    for level in corpus.scene_levels("staircase2-view0").unwrap() {
        let level = level.unwrap();
        assert_eq!((level.patch.width, level.patch.height, level.encoding), (128, 128, Encoding::Linear));
        count += 1;
    }
    assert!(count > 16 * 17, "{count}");
    // Played back, a zone ends here: nothing comes after it, and elsewhere a request would be an error
    let mut stack = StackSource::open(dir.join("zone00")).unwrap();
    let tile = TileGrid::new(128, 128, 128).unwrap().tile(0);
    assert_eq!(stack.sample(&[Request::new(tile, 5600, 1)]).unwrap()[0].spp, 0);
}
