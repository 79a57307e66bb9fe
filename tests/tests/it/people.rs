use noisefloor::{
    Model, Oracle, People, Tile,
    evidence::{Samples, TilePlanes, residual_scale},
};
use noisefloor_image::{DisplayImage, Picture, read_picture};
use noisefloor_learn::{Corpus, JudgedZone, ThresholdRow, ZoneImages};
use noisefloor_testkit::require_shared;
use std::path::{Path, PathBuf};

/// A picture as observers saw it, and its samples per pixel.
fn shown(folder: &Path, spp: u64) -> (DisplayImage, f64) {
    match read_picture(folder.join(format!("{spp:05}.png"))).unwrap() {
        Picture::Display(image) => (image, spp as f64),
        Picture::Linear(_) => panic!("a PNG is display-encoded"),
    }
}

/// Which zones of a picture have converged, by the difference to another stage of the same rendering.
fn converged(
    oracle: &Oracle,
    (image, spp): &(DisplayImage, f64),
    (other, of): &(DisplayImage, f64),
    zones: &[Tile],
) -> Vec<bool> {
    let scale = residual_scale(*spp, *of, Samples::Nested).unwrap();
    let rounding = 2.0 * image.step * image.step / 12.0 * scale * scale;
    let describe = |&zone: &Tile| {
        let planes = TilePlanes::gather((image.width, image.height), zone, |x, y| {
            let (a, b) = (image.pixels[y * image.width + x], other.pixels[y * image.width + x]);
            (std::array::from_fn(|c| 0.5 * (a[c] + b[c])), std::array::from_fn(|c| (a[c] - b[c]) * scale))
        });
        oracle.describe(&TilePlanes { rounding, ..planes }, *spp).unwrap()
    };
    let described: Vec<_> = zones.iter().map(describe).collect();
    oracle.judge_described(&described).iter().map(|v| v.converged).collect()
}

/// Of what production renderers made: of the zones for which people asked for at least twice the samples of the first
/// picture, no more than 2 % have converged in it, as the documentation says of stops; in the last pictures most have for
/// half of the people. (Not for 95 % of them: a last picture has noise of its own, which nobody could compare it with.)
#[test]
fn early_pictures_are_noisy_and_last_ones_are_not() {
    let Some(dir) = require_shared("human/lisic9") else { return };
    let corpus = Corpus::open(&dir).unwrap();
    let oracle = Oracle::bundled();
    let for_half = Oracle::new(Model::bundled(), People::new(0.5).unwrap());
    let (mut zones, mut asked, mut early, mut late) = (0, 0, 0, 0);
    for scene in corpus.scenes() {
        let of_scene = || corpus.zones().iter().filter(|z| z.row.scene == scene);
        let ZoneImages::RunningMeans(folder) = &of_scene().next().unwrap().stack else { panic!("{scene}") };
        let name = |path: PathBuf| path.file_stem()?.to_str()?.parse::<u64>().ok();
        let mut spp: Vec<u64> =
            std::fs::read_dir(folder).unwrap().filter_map(|e| name(e.unwrap().path())).collect();
        spp.sort_unstable();
        // The last picture is held against the early one with most samples: the first has too few to say much
        let most_early = *spp.iter().rfind(|&&n| 2 * n <= spp[spp.len() - 1]).unwrap();
        let [first, middle, last] = [spp[0], most_early, spp[spp.len() - 1]].map(|n| shown(folder, n));
        let tile = |z: &JudgedZone| {
            let ThresholdRow { x, y, width, height, .. } = z.row;
            Tile { index: 0, x, y, width, height }
        };
        let tiles: Vec<Tile> = of_scene().map(tile).collect();
        zones += tiles.len();
        let more: Vec<bool> = of_scene().map(|z| z.row.human_spp >= 2.0 * first.1).collect();
        asked += more.iter().filter(|&&more| more).count();
        let in_first = converged(&oracle, &first, &last, &tiles);
        early += in_first.iter().zip(&more).filter(|&(&converged, &more)| converged && more).count();
        late += converged(&for_half, &last, &middle, &tiles).iter().filter(|&&converged| converged).count();
    }
    assert_eq!(zones, 112);
    assert!(asked * 2 > zones, "people asked for more in {asked} of {zones} zones");
    assert!(early * 50 <= asked, "{early} of {asked} zones are said to have converged far too early");
    assert!(late * 10 > zones * 9, "{late} of {zones} zones have converged in the last pictures");
}
