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

/// A tenth to five times the noise that is too strong: the contrast that is found has the difference that is
/// looked for. Three corrections leave 16 % of the difference at a tenth, where it grows as contrast^2.26: that is 8 %
/// of the contrast. (A mean of order 8 is settled sooner: 8 % and 5 %.)
#[test]
fn noise_is_as_strong_as_its_contrast_says() {
    let visible = Visible::default();
    for (noise, left) in [(0.001, 0.18), (0.004, 0.02), (0.016, 0.02), (0.064, 0.02)] {
        let planes = tile(0.5, noise);
        let amplitude = with_differences(&planes, |differences| visible.noise(differences).0).unwrap();
        let there = |differences: &mut VisibleDifference<'_>| {
            visible.pooled(differences.map_at(1.0 / amplitude as f32))
        };
        let pooled = with_differences(&planes, there).unwrap();
        assert!((pooled / visible.difference - 1.0).abs() < left, "{noise}: {amplitude} {pooled}");
    }
}

#[test]
fn projecting_is_what_more_samples_do() {
    let descriptor = Descriptor::visible();
    for noise in [0.01, 0.04] {
        let (mut noisy, clean) = (own(&tile(0.5, noise)), own(&tile(0.5, noise / 2.0)));
        noisy.extend([0.0; 2]);
        assert!(descriptor.project(&mut noisy, 4.0));
        // A weaker residual hides less of what masks it: 3 % of the contrast here
        assert!((noisy[0] - clean[0]).abs() < 0.05, "{noisy:?} {clean:?}");
        assert_eq!(noisy[1..3], clean[1..3]);
    }
}

#[test]
fn no_noise_is_the_floor_and_broken_pixels_never_converge() {
    let floor = NOISE_FLOOR.ln() as f32;
    // Contrasts end at e⁶
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
fn a_picture_of_equal_tiles_is_as_noisy_as_each_and_samples_count() {
    let tile =
        |spp: f64, noise: f64| Described { own: vec![noise_number(noise), 1.0, -1.0], spp, area: 100.0 };
    let descriptor = Descriptor::visible();
    for numbers in descriptor.in_picture(&[tile(64.0, 2.0), tile(64.0, 2.0)]) {
        assert!((numbers[0] - numbers[3]).abs() < 1e-5 && numbers[2] == numbers[4], "{numbers:?}");
    }
    // The same scene at a quarter of the samples in one of the tiles
    let uneven = descriptor.in_picture(&[tile(16.0, 4.0), tile(64.0, 2.0)]);
    assert!((uneven[0][3] - uneven[0][0]).abs() < 1e-5 && (uneven[1][3] - uneven[1][0]).abs() < 1e-5);
    // Seven eighths of the way from 0 to 1
    let half = descriptor.in_picture(&[tile(16.0, 1.0), tile(16.0, 0.0)]);
    assert!((amplitude(half[0][3]) - 0.875).abs() < 1e-3, "{half:?}");
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
    spotted[5].residual.indexed_iter_mut().filter(|((y, x), _)| y % 10 < 2 && x % 10 == 3).for_each(
        |(_, v)| {
            *v *= 8.0;
            count += 1;
        },
    );
    let share = f64::from(count) / spotted[5].residual.len() as f64;
    assert!((0.018..0.022).contains(&share), "{share}");
    let needs = |planes: &[TilePlanes]| -> Vec<f64> {
        let oracle = crate::Oracle::new(model.clone(), crate::Threshold::PAPER);
        let tiles: Vec<Described> = planes.iter().map(|p| oracle.describe(p, 100.0).unwrap()).collect();
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

/// The map pools to the tile's number, and is where the noise is.
#[test]
fn the_map_is_where_the_noise_is() {
    let mut planes = tile(0.5, 0.03);
    let visible = Visible::default();
    let map = Descriptor::visible().visible_noise(&planes).unwrap();
    assert_eq!(map.dim(), (80, 96));
    let (noise, growth) = with_differences(&planes, |differences| visible.noise(differences)).unwrap();
    let order = visible.order.number() * growth;
    let pooled = map.mapv(|v| f64::from(v).powf(order)).mean().unwrap().powf(order.recip());
    assert!((pooled / noise - 1.0).abs() < 0.02, "{pooled} {noise}");
    assert_eq!(f64::from(own(&planes)[0]), f64::from(noise_number(noise)));

    planes.residual.slice_mut(s![.., 48 + HALO..]).fill(0.0);
    let map = Descriptor::visible().visible_noise(&planes).unwrap();
    let mean = |columns: std::ops::Range<usize>| map.slice(s![.., columns]).mean().unwrap();
    assert!(mean(0..40) > 20.0 * mean(60..96), "{} {}", mean(0..40), mean(60..96));
    planes.residual.fill(0.0);
    assert!(Descriptor::visible().visible_noise(&planes).unwrap().iter().all(|&v| v == 0.0));
}

#[test]
fn files_name_the_constants() {
    let spec = Descriptor::visible().spec();
    assert_eq!(Descriptor::from_spec(&spec, &[]).unwrap(), Descriptor::visible());
    for (name, wrong) in [("order", 3.0), ("picture_quantile", 1.5), ("difference", f64::NAN)] {
        let mut spec = spec.clone();
        spec.parameters.insert(name.into(), wrong);
        let error = Descriptor::from_spec(&spec, &[]).unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
    }
}
