use super::*;
use crate::evidence::HALO;
use crate::tile::TileGrid;
use noisefloor_testkit::Noise;
use noisefloor_vision::Viewing;

/// A grey tile of this brightness with white noise of this standard deviation, in display values.
fn tile(brightness: f32, noise: f32) -> TilePlanes {
    noisy_tile(17, brightness, noise)
}

fn noisy_tile(seed: u64, brightness: f32, noise: f32) -> TilePlanes {
    let tile = TileGrid::new(96, 80, 96).unwrap().tile(0);
    let mut random = Noise::new(seed);
    let values: Vec<f32> = (0..96 * 80).map(|_| noise * random.normal() as f32).collect();
    TilePlanes::gather((96, 80), tile, |x, y| ([brightness; 3], [values[y * 96 + x]; 3]))
}

fn on(viewing: &str, planes: &TilePlanes) -> TilePlanes {
    TilePlanes { viewing: viewing.parse::<Viewing>().unwrap(), ..planes.clone() }
}

fn own(planes: &TilePlanes) -> Vec<f32> {
    Descriptor::visible().describe(planes).unwrap()
}

/// In proportion to its contrast, but for what a stronger residual hides of itself.
#[test]
fn noise_is_as_strong_as_its_contrast() {
    let strength = |noise: f32| amplitude(own(&tile(0.5, noise))[0]);
    let one = strength(0.004);
    for (noise, times) in [(0.002, 0.5), (0.008, 2.0), (0.016, 4.0)] {
        let ratio = strength(noise) / one / times;
        assert!((0.85..1.05).contains(&ratio), "{noise}: {ratio}");
    }
}

/// New in every frame, noise is averaged over, and more so at more frames a second. As a still it counts by 0.578 of what
/// a film does, in differences, which is 0.785 in contrast: what is left of fine noise is less than that.
#[test]
fn noise_of_a_film_is_weaker() {
    let planes = tile(0.5, 0.008);
    let [still, slow, fast] =
        ["desk", "desk,fps=24", "desk,fps=60"].map(|viewing| own(&on(viewing, &planes)));
    let strength = |own: &[f32]| amplitude(own[0]) / amplitude(still[0]);
    assert!((0.6..0.95).contains(&strength(&slow)), "{}", strength(&slow));
    assert!((0.4..0.7).contains(&strength(&fast)), "{}", strength(&fast));
    assert_eq!([&slow[1..], &fast[1..]], [&still[1..]; 2]);
}

/// What people were asked about is seen as greys: in still pictures and in films, colour adds to that, much where greys show next
/// to nothing of it, and takes nothing away where the vision model holds it for hardly visible.
#[test]
fn colour_only_adds_to_what_greys_show() {
    let tile = TileGrid::new(96, 80, 96).unwrap().tile(0);
    let (grey, orange) = ([0.5; 3], [0.74, 0.48, 0.31]);
    for (wall, colour, least) in
        [(grey, [0.0, 0.0, 1.0], 1.2), (grey, [1.0, 0.0, 1.0], 1.03), (orange, [0.0, 0.0, 1.0], 1.0)]
    {
        let mut random = Noise::new(29);
        let values: Vec<f32> = (0..96 * 80).map(|_| 0.05 * random.normal() as f32).collect();
        let noise = |x: usize, y: usize| colour.map(|c: f32| c * values[y * 96 + x]);
        let planes = TilePlanes::gather((96, 80), tile, |x, y| (wall, noise(x, y)));
        assert!(planes.colour.is_some());
        for viewing in ["desk", "desk,fps=24"] {
            let in_colour = on(viewing, &planes);
            let greys = TilePlanes { colour: None, ..in_colour.clone() };
            let [in_colour, greys] =
                [&in_colour, &greys].map(|planes| Descriptor::visible().describe_tile(planes, 50.0).unwrap());
            let pairs = || in_colour.blocks.as_flattened().iter().zip(greys.blocks.as_flattened());
            // But for their rounding
            assert!(
                pairs().all(|(in_colour, greys)| *in_colour >= 0.999 * greys),
                "{wall:?} {colour:?} {viewing}"
            );
            let more = amplitude(in_colour.own[0]) / amplitude(greys.own[0]);
            assert!(more >= least, "{wall:?} {colour:?} {viewing}: {more}");
        }
    }
}

/// Of two halves of a tile, one without noise, the windows in the noisy one count, however large the other is; and a
/// window on the border of two tiles is seen by both.
#[test]
fn the_worst_window_counts_wherever_tiles_end() {
    let mut random = Noise::new(23);
    let values: Vec<f32> = (0..128 * 64).map(|_| 0.02 * random.normal() as f32).collect();
    let descriptor = Descriptor::visible();
    let worst = |columns: std::ops::Range<usize>, edge: usize| -> Vec<f64> {
        let noisy = |x: usize, y: usize| if columns.contains(&x) { values[y * 128 + x] } else { 0.0 };
        let grid = TileGrid::new(128, 64, edge).unwrap();
        let describe = |tile| {
            let planes = TilePlanes::gather((128, 64), tile, |x, y| ([0.5; 3], [noisy(x, y); 3]));
            descriptor.describe_tile(&planes, 50.0).unwrap()
        };
        let tiles: Vec<Described> = grid.tiles().map(describe).collect();
        let numbers = descriptor.in_picture(&tiles);
        // The picture's noise is that of its worst window here, which is smaller than a zone, whatever the tiles; and a
        // quarter more than that of the tile at hand, if that is more
        let of_tiles: Vec<f64> = numbers.iter().map(|raw| amplitude(raw[0])).collect();
        let most = of_tiles.iter().copied().fold(0.0, f64::max);
        for (raw, of_tile) in numbers.iter().zip(&of_tiles) {
            assert!((amplitude(raw[3]) / most.max(1.25 * of_tile) - 1.0).abs() < 1e-3, "{numbers:?}");
        }
        of_tiles
    };
    let everywhere = worst(0..128, 64);
    // Windows of 28 pixels fit into 48 columns; of fewer windows, the worst is a little less bad
    let at_left = worst(0..48, 64);
    assert!((0.85..1.01).contains(&(at_left[0] / everywhere[0])), "{at_left:?} {everywhere:?}");
    // The first columns of the other tile have windows with a few noisy pixels, whose peaks count
    assert!(at_left[1] < 0.12 * at_left[0], "{at_left:?}");
    // Columns 50 to 78 are the middle of the picture
    let middle = worst(50..78, 64);
    assert!((middle[0] / middle[1] - 1.0).abs() < 0.1, "{middle:?}");
    // Whatever the tiles, the worst of all is the same but for their halos
    for columns in [0..128, 0..48, 50..78] {
        let worst = [32, 64, 128].map(|edge| worst(columns.clone(), edge).into_iter().fold(0.0, f64::max));
        assert!(worst.iter().all(|w| (w / worst[2] - 1.0).abs() < 0.05), "{worst:?}");
    }
}

/// Neighbours count with the samples of the tile at hand.
#[test]
fn samples_of_neighbours_are_taken_to_those_of_the_tile() {
    let tiles = |spp: [f64; 2]| -> Vec<Described> {
        let grid = TileGrid::new(128, 64, 64).unwrap();
        let describe = |(tile, spp): (crate::Tile, f64)| {
            let mut random = Noise::new(31 + tile.index as u64);
            let sigma = 0.2 / spp.sqrt();
            let values: Vec<f32> = (0..128 * 64).map(|_| (sigma * random.normal()) as f32).collect();
            let planes = TilePlanes::gather((128, 64), tile, |x, y| ([0.5; 3], [values[y * 128 + x]; 3]));
            Descriptor::visible().describe_tile(&planes, spp).unwrap()
        };
        grid.tiles().zip(spp).map(describe).collect()
    };
    let numbers = |spp| -> Vec<f64> {
        Descriptor::visible().in_picture(&tiles(spp)).iter().map(|raw| amplitude(raw[0])).collect()
    };
    let (even, uneven) = (numbers([100.0, 100.0]), numbers([100.0, 1600.0]));
    assert!((uneven[0] / even[0] - 1.0).abs() < 0.1, "{uneven:?} {even:?}");
    assert!((uneven[1] / even[1] * 4.0 - 1.0).abs() < 0.15, "{uneven:?} {even:?}");
}

#[test]
fn projecting_is_what_more_samples_do() {
    let descriptor = Descriptor::visible();
    for (noise, hidden) in [(0.01, 0.05), (0.04, 0.15)] {
        let (mut noisy, clean) = (own(&tile(0.5, noise)), own(&tile(0.5, noise / 2.0)));
        noisy.extend([0.0; 2]);
        assert!(descriptor.project(&mut noisy, 4.0));
        // Noise is in both pictures and hides a part of itself: of ten and of five steps of 8 bits, 13 % of the contrast
        assert!((noisy[0] - clean[0]).abs() < hidden, "{noisy:?} {clean:?}");
        assert_eq!(noisy[1..3], clean[1..3]);
    }
}

#[test]
fn no_noise_is_the_floor_and_broken_pixels_never_converge() {
    let floor = NOISE_FLOOR.ln() as f32;
    assert!((own(&tile(0.5, 0.0))[0] - floor).abs() < 0.005);
    // Nothing but the rounding of 8-bit pictures
    let mut rounded = tile(0.5, (1.0 / 255.0) / 12f32.sqrt());
    let exact = own(&rounded)[0];
    rounded.rounding = (1.0f32 / 255.0).powi(2) / 12.0 / ROUNDING_LUMINANCE;
    // Its variance is known within 2 % from 7680 pixels, so a seventh of the amplitude can remain
    let left = amplitude(own(&rounded)[0]);
    assert!(left < amplitude(exact) / 7.0, "{left} {exact}");
    let mut broken = tile(0.5, 0.01);
    broken.residual[(20, 20)] = f32::NAN;
    assert!(own(&broken)[0] > 10.0);
}

#[test]
fn distance_hides_noise_and_bright_displays_show_it() {
    let planes = tile(0.4, 0.02);
    let at = |viewing: &str| own(&on(viewing, &planes));
    let desk = at("desk");
    assert_eq!(desk, own(&planes));
    let far = at("desk,distance=1.2");
    assert!(far[0] < desk[0] - 0.3, "{far:?} {desk:?}");
    let bright = at("desk,peak=1000");
    assert!(bright[0] > desk[0] + 0.05, "{bright:?} {desk:?}");
    // What the tile is made of stays
    assert_eq!((&far[1..], &bright[1..]), (&desk[1..], &desk[1..]));
}

#[test]
fn a_picture_is_a_quarter_noisier_than_its_tiles_at_least_and_samples_count() {
    let place = crate::Tile { index: 0, x: 0, y: 0, width: 10, height: 10 };
    let tile = |spp: f64, noise: f64| Described {
        own: vec![noise_number(noise), 1.0, -1.0],
        spp,
        place,
        window: 7,
        blocks: Vec::new(),
    };
    let descriptor = Descriptor::visible();
    let noisier = |numbers: &[f32]| amplitude(numbers[3]) / amplitude(numbers[0]);
    for numbers in descriptor.in_picture(&[tile(64.0, 2.0), tile(64.0, 2.0)]) {
        assert!((noisier(&numbers) - 1.25).abs() < 1e-5 && numbers[2] == numbers[4], "{numbers:?}");
    }
    // The same scene at a quarter of the samples in one of the tiles
    let uneven = descriptor.in_picture(&[tile(16.0, 4.0), tile(64.0, 2.0)]);
    assert!(uneven.iter().all(|numbers| (noisier(numbers) - 1.25).abs() < 1e-5), "{uneven:?}");
    // Seven eighths of the way from 0 to 1
    let half = descriptor.in_picture(&[tile(16.0, 1.0), tile(16.0, 0.0)]);
    assert!((amplitude(half[1][3]) - 0.875).abs() < 1e-3, "{half:?}");
    // For the noisy tile, that is not noisy enough: it is not excused by the clean one
    assert!((noisier(&half[0]) - 1.25).abs() < 1e-5, "{half:?}");
}

/// Quantiles of equal weights are those of numpy's default; a weight counts as many values of a weight of one.
#[test]
fn quantiles_are_linear_between_the_middles_of_weights() {
    let equal: Vec<(f64, f64)> = [1.0, 2.0, 4.0, 8.0].map(|v| (v, 3.0)).to_vec();
    for (q, value) in [(0.0, 1.0), (0.5, 3.0), (0.75, 5.0), (1.0, 8.0)] {
        assert!((quantile(&equal, q) - value).abs() < 1e-12, "{q}");
    }
    assert_eq!(quantile(&[(5.0, 2.0)], 0.875), 5.0);
    // The first value fills nearly all of the picture
    assert!(quantile(&[(1.0, 1000.0), (9.0, 1.0)], 0.4) < 4.3);
    // Half of a tile of the edge counts as half of a tile
    assert!((quantile(&[(1.0, 2.0), (2.0, 2.0), (4.0, 1.0)], 0.5) - 1.875).abs() < 1e-12);
}

/// One of sixteen tiles with noise eight times as strong in 2 % of its pixels waits for itself: what the others need
/// moves by 10 % at most.
#[cfg(feature = "bundled-model")]
#[test]
fn one_bad_spot_does_not_make_the_picture_wait() {
    let model = crate::Model::bundled();
    let even: Vec<TilePlanes> = (0..16).map(|seed| noisy_tile(seed, 0.5, 0.02)).collect();
    let mut spotted = even.clone();
    let mut count = 0;
    let (rows, columns) = spotted[5].residual.size();
    for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
        if y % 10 < 2 && x % 10 == 3 {
            spotted[5].residual[(y, x)] *= 8.0;
            count += 1;
        }
    }
    let share = f64::from(count) / (rows * columns) as f64;
    assert!((0.018..0.022).contains(&share), "{share}");
    let needs = |planes: &[TilePlanes]| -> Vec<f64> {
        let oracle = crate::Oracle::new(model.clone(), crate::People::DEFAULT);
        // Pictures of their own, all in one place: without windows from one into the other
        let apart = |p| Described { blocks: Vec::new(), ..oracle.describe(p, 100.0).unwrap() };
        let tiles: Vec<Described> = planes.iter().map(apart).collect();
        oracle.judge_described(&tiles).iter().map(|v| v.threshold.unwrap().median as f64).collect()
    };
    let (before, after) = (needs(&even), needs(&spotted));
    assert!(after[5] > 1.5 * before[5], "the spot is seen: {} and {}", before[5], after[5]);
    for tile in (0..16).filter(|&tile| tile != 5) {
        assert!(
            (after[tile] / before[tile] - 1.0).abs() < 0.1,
            "{tile}: {} and {}",
            before[tile],
            after[tile]
        );
    }
}

/// The largest value of the map is the tile's number, and it is where the noise is.
#[test]
fn the_map_is_where_the_noise_is() {
    let mut planes = tile(0.5, 0.03);
    let descriptor = Descriptor::visible();
    let map = |planes: &TilePlanes| {
        let described = descriptor.describe_tile(planes, 70.0).unwrap();
        (amplitude(described.own[0]), descriptor.visible_noise(&[described]).unwrap().remove(0))
    };
    let (number, all) = map(&planes);
    assert_eq!(all.size(), (80, 96));
    let largest = all.values().iter().fold(0.0f32, |a, &b| a.max(b));
    assert!((f64::from(largest) / UNIT / number - 1.0).abs() < 1e-4, "{largest} {number}");

    let (_, width) = planes.residual.size();
    planes.residual.values_mut().chunks_exact_mut(width).for_each(|row| row[48 + HALO..].fill(0.0));
    let (_, left) = map(&planes);
    let mean = |columns: std::ops::Range<usize>| {
        let (rows, count) = (left.size().0, columns.len() as f32);
        (0..rows).flat_map(|y| &left.row(y)[columns.clone()]).sum::<f32>() / (rows as f32 * count)
    };
    assert!(mean(0..30) > 20.0 * mean(70..96), "{} {}", mean(0..30), mean(70..96));
    planes.residual.values_mut().fill(0.0);
    assert!(map(&planes).1.values().iter().all(|&v| v == 0.0));
}

#[test]
fn files_name_the_constants() {
    let spec = Descriptor::visible().spec();
    assert_eq!(Descriptor::from_spec(&spec, &[]).unwrap(), Descriptor::visible());
    for (name, wrong) in [("window", 0.0), ("picture_quantile", 1.5), ("window", f64::NAN)] {
        let mut spec = spec.clone();
        spec.parameters.insert(name.into(), wrong);
        let error = Descriptor::from_spec(&spec, &[]).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
}
