use super::*;
use crate::display::log_average;
use crate::{Film, Tile, TileGrid, ToneMapping};
use noisefloor_testkit::Noise;

const SIZE: (usize, usize) = (128, 96);

/// A picture of one channel.
fn picture(light: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    (0..SIZE.0 * SIZE.1).map(|i| light(i % SIZE.0, i / SIZE.0)).collect()
}

/// Light that changes by a factor of 50, slowly: its geometric mean is that of its logarithm, 1.
fn waves() -> Vec<f64> {
    let turn =
        |at: usize, of: usize, times: f64| std::f64::consts::TAU * times * (at as f64 + 0.5) / of as f64;
    picture(|x, y| (turn(x, SIZE.0, 2.0).sin() + turn(y, SIZE.1, 1.0).cos()).exp())
}

/// A left half of 1/130 of the light, in which only `share` of what the right half's pixels meet is met.
fn dark_half() -> Vec<f64> {
    picture(|x, _| if x < SIZE.0 / 2 { 1.0 / 130.0 } else { 1.0 })
}

/// Two halves of eight samples, a share of which meets the light: of each half, the standard deviation is
/// √((1/share − 1)/8) of the mean.
fn met(truth: &[f64], share: impl Fn(usize) -> f64, seed: u64) -> [Vec<f64>; 2] {
    let mut noise = Noise::keyed(&[47, seed]);
    [0, 1].map(|_| {
        let mut pixel = |(i, light): (usize, &f64)| {
            let hits = (0..8).filter(|_| noise.uniform() < share(i)).count();
            light * hits as f64 / (8.0 * share(i))
        };
        truth.iter().enumerate().map(&mut pixel).collect()
    })
}

fn of_pair([a, b]: &[Vec<f64>; 2]) -> LogAverage {
    let pixel = |x: usize, y: usize| {
        let [a, b] = [a, b].map(|half| ([half[y * SIZE.0 + x] as f32; 3], 8.0));
        of_halves([a, b])
    };
    estimate(SIZE, pixel).unwrap()
}

fn of_one(picture: &[f64]) -> LogAverage {
    let pixel =
        |x: usize, y: usize| Some(NoisyPixel { luminance: picture[y * SIZE.0 + x] as f32, deviation: None });
    estimate(SIZE, pixel).unwrap()
}

fn mean([a, b]: &[Vec<f64>; 2]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect()
}

fn rgb(picture: &[f64]) -> Vec<Rgb> {
    picture.iter().map(|&light| [light as f32; 3]).collect()
}

/// By how much it is wrong.
fn off(found: LogAverage, truth: &[f64]) -> f64 {
    found.value / log_average(&rgb(truth)).unwrap() - 1.0
}

/// Within 5 % where it says that it is known, as sessions ask; else within four of its standard errors:
/// what the picture changes by within blocks is no part of these.
#[track_caller]
fn assert_sound(found: LogAverage, truth: &[f64], what: f64) {
    let off = off(found, truth);
    let allowed = if found.error <= 0.015 { 0.05 } else { 4.0 * found.error };
    assert!(off.abs() < allowed, "{what}: {off} off, {found:?}");
}

#[test]
fn a_picture_without_noise_has_its_log_average() {
    let steep = picture(|x, y| 10f64.powi((x / 16 + y / 16) as i32 - 6));
    let with_black = picture(|x, y| if (x / 8 + y / 8) % 3 == 0 { 0.0 } else { 1.0 + x as f64 });
    for truth in [waves(), dark_half(), steep, with_black] {
        let found = of_pair(&[truth.clone(), truth.clone()]);
        assert!(off(found, &truth).abs() < 1e-3 && found.error < 1e-6, "{found:?}, {}", off(found, &truth));
    }
}

#[test]
fn noise_and_zeros_do_not_bend_it() {
    let truth = waves();
    // Zeros in up to 96 % of the pixels of a half, noise of up to five times the mean
    for (seed, share) in [0.9, 0.5, 0.25, 0.1, 0.05, 0.02, 0.01, 0.005].into_iter().enumerate() {
        let halves = met(&truth, |_| share, seed as u64);
        let found = of_pair(&halves);
        assert_sound(found, &truth, share);
        assert!(found.error < 0.1, "{share}: {found:?}");
        // The mean of the logarithms of pixels is what it is tested against: it is far away
        let naive = log_average(&rgb(&mean(&halves))).unwrap() - 1.0;
        assert!(share > 0.06 || naive.abs() > 0.15, "{share}: {naive}");
    }
}

#[test]
fn noise_of_both_signs_does_not_bend_it() {
    let truth = waves();
    for (seed, deviation) in [0.1, 0.5, 1.0, 2.0, 4.0].into_iter().enumerate() {
        let mut noise = Noise::keyed(&[48, seed as u64]);
        let halves = [0, 1].map(|_| -> Vec<f64> {
            truth.iter().map(|light| light * (1.0 + deviation * noise.normal())).collect()
        });
        assert_sound(of_pair(&halves), &truth, deviation);
    }
}

#[test]
fn a_dark_half_counts_before_its_light_is_met() {
    let truth = dark_half();
    for (seed, share) in [0.3, 0.1, 0.03, 0.01].into_iter().enumerate() {
        let noisy = |i: usize| if i % SIZE.0 < SIZE.0 / 2 { share } else { 0.8 };
        let halves = met(&truth, noisy, 10 + seed as u64);
        assert_sound(of_pair(&halves), &truth, share);
        let naive = log_average(&rgb(&mean(&halves))).unwrap() / log_average(&rgb(&truth)).unwrap();
        assert!(share > 0.02 || naive > 2.0, "{share}: {naive}");
    }
}

#[test]
fn black_is_left_out_and_unmet_light_is_not() {
    // A disc, and nothing around it
    let inside = |i: usize| (i % SIZE.0).abs_diff(64).pow(2) + (i / SIZE.0).abs_diff(48).pow(2) < 1600;
    let truth: Vec<f64> = waves().iter().enumerate().map(|(i, l)| if inside(i) { *l } else { 0.0 }).collect();
    for (seed, share) in [1.0, 0.9, 0.5].into_iter().enumerate() {
        let found = of_pair(&met(&truth, |_| share, 20 + seed as u64));
        assert!(off(found, &truth).abs() < 0.05, "{share}: {}, {found:?}", off(found, &truth));
    }
    // At its edge, black and unmet light are not to be told apart; but it is said that it is not known
    for (seed, share) in [0.1, 0.03].into_iter().enumerate() {
        let found = of_pair(&met(&truth, |_| share, 25 + seed as u64));
        assert!(
            found.error > 0.02 && off(found, &truth).abs() < 0.25,
            "{share}: {}, {found:?}",
            off(found, &truth)
        );
    }
    let black = |_: usize, _: usize| Some(NoisyPixel { luminance: 0.0, deviation: Some(0.0) });
    assert_eq!(estimate(SIZE, black), None);
    assert_eq!(estimate(SIZE, |_, _| None), None);
}

/// A surface beside one that falls off through 26 decades, as a smooth metal does.
#[test]
fn what_no_screen_shows_counts_as_black() {
    let bright = |x: usize| x < SIZE.0 / 2;
    let truth =
        picture(|x, y| if bright(x) { 1.0 } else { 10f64.powf(-0.4 * (x - 64) as f64 - 0.005 * y as f64) });
    let lit = log_average(&rgb(&truth)).unwrap();
    // By NumPy; of all decades, the geometric mean would be 4·10⁻⁷
    assert!((lit / 0.487_783_1 - 1.0).abs() < 1e-4, "{lit}");
    for (seed, share) in [1.0, 0.5, 0.2].into_iter().enumerate() {
        let found = of_pair(&met(&truth, |_| share, 70 + seed as u64));
        assert_sound(found, &truth, share);
        assert!(found.error < 0.1, "{share}: {found:?}");
    }
    // The unit of light does not matter
    let scaled: Vec<f64> = truth.iter().map(|light| light * 1e9).collect();
    assert!((log_average(&rgb(&scaled)).unwrap() / lit / 1e9 - 1.0).abs() < 1e-3);
}

#[test]
fn it_says_how_well_it_is_known() {
    let truth = waves();
    for share in [0.5, 0.02] {
        let found: Vec<LogAverage> =
            (0..40).map(|seed| of_pair(&met(&truth, |_| share, 100 + seed))).collect();
        let logs: Vec<f64> = found.iter().map(|one| one.value.ln()).collect();
        let mean = logs.iter().sum::<f64>() / 40.0;
        let scatter = (logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / 39.0).sqrt();
        let said = found.iter().map(|one| one.error).sum::<f64>() / 40.0;
        // A standard deviation of 40 has a standard error of 11 %; what is said counts more than noise
        assert!((0.3..1.5).contains(&(scatter / said)), "{share}: {scatter} of {said}");
    }
    // One hit in a picture says next to nothing
    let mut one = vec![0.0; truth.len()];
    one[5000] = 7.0;
    let found = of_pair(&[one, vec![0.0; truth.len()]]);
    assert!(found.error >= 1.0, "{found:?}");
}

#[test]
fn fireflies_do_not_lift_it() {
    let (truth, mut noise) = (waves(), Noise::keyed(&[49]));
    let mut halves = met(&truth, |_| 0.9, 30);
    for value in &mut halves[0] {
        if noise.uniform() < 0.002 {
            *value += 1000.0;
        }
    }
    let found = of_pair(&halves);
    assert!(off(found, &truth).abs() < 0.05, "{}, {found:?}", off(found, &truth));
}

#[test]
fn one_picture_alone_does_as_well_without_edges() {
    for truth in [waves(), dark_half()] {
        let found = of_one(&truth);
        assert!(off(found, &truth).abs() < 0.02, "{}, {found:?}", off(found, &truth));
    }
    // Where most of a picture is noise, its own changes are not to be told from it
    let truth = waves();
    for (seed, share) in [0.9, 0.5, 0.25].into_iter().enumerate() {
        assert_sound(of_one(&mean(&met(&truth, |_| share, 40 + seed as u64))), &truth, share);
    }
}

#[test]
fn any_size_and_unit_will_do() {
    for (width, height) in [(1, 1), (2, 1), (7, 8), (9, 16), (17, 3), (64, 65)] {
        for unit in [1e-20, 1.0, 1e20] {
            let pixel = |x: usize, y: usize| {
                let luminance = (unit * (1.0 + (x + y) as f64)) as f32;
                Some(NoisyPixel { luminance, deviation: Some(0.0) })
            };
            let logs: f64 = (0..width * height).map(|i| (1.0 + (i % width + i / width) as f64).ln()).sum();
            let wanted = unit * (logs / (width * height) as f64).exp();
            let found = estimate((width, height), pixel).unwrap();
            assert!((found.value / wanted - 1.0).abs() < 1e-3, "{width}×{height}, {unit}: {found:?}");
        }
    }
}

/// Tiles may have samples of their own numbers, in halves that are uneven, or none.
#[test]
fn a_film_is_settled_from_what_it_has() {
    let (truth, tone) = (waves(), ToneMapping::default());
    let film = |halves: bool, samples: fn(usize) -> Option<[u64; 2]>| {
        let grid = TileGrid::new(SIZE.0, SIZE.1, 32).unwrap();
        let mut film = if halves { Film::new(grid) } else { Film::without_halves(grid) };
        for tile in grid.tiles() {
            for (half, spp) in samples(tile.index).into_iter().flatten().enumerate() {
                film.add(tile.index, spp, &batch(&truth, tile, spp, half as u64)).unwrap();
            }
        }
        tone.settle(&rgb(&truth)).exposure() / film.settle(&tone).display.exposure() - 1.0
    };
    for halves in [true, false] {
        for (limit, samples) in [
            (0.05, (|_| Some([8, 8])) as fn(usize) -> Option<[u64; 2]>),
            (0.05, |tile| Some([4 + tile as u64, 8])),
            // The tiles that have samples are as bright as the others
            (0.05, |tile| (tile % 4 < 2).then_some([8, 8])),
        ] {
            let off = film(halves, samples);
            assert!(off.abs() < limit, "halves {halves}: {off}");
        }
    }
    assert_eq!(Film::new(TileGrid::new(20, 20, 16).unwrap()).settle(&tone).display.exposure(), 1.0);
}

/// Samples that meet the light once in four times.
fn batch(truth: &[f64], tile: Tile, spp: u64, half: u64) -> Vec<Rgb> {
    let mut noise = Noise::keyed(&[50, tile.index as u64, half]);
    let mut met = |light: f64| {
        let hits = (0..spp).filter(|_| noise.uniform() < 0.25).count();
        [(light * 4.0 * hits as f64 / spp as f64) as f32; 3]
    };
    tile.rows(SIZE.0).flatten().map(|pixel| met(truth[pixel])).collect()
}

/// Of a large picture, a sample of blocks is looked at: what is found lies within what it says of itself, and grids
/// and cells miss nothing regular.
#[test]
fn a_sample_of_a_large_picture_is_enough() {
    let size = (1230, 570);
    let regular = |x: usize, y: usize| if (x / 16 + y / 16).is_multiple_of(2) { 1.0 } else { 0.05 };
    let stripes = |x: usize, _: usize| if x % 24 < 8 { 1.0 } else { 0.01 };
    let slow = |x: usize, y: usize| ((x as f64 / 200.0).sin() * 2.0 + (y as f64 / 90.0).cos()).exp();
    let small = |x: usize, y: usize| if (x / 40 % 7, y / 40 % 5) == (3, 2) { 50.0 } else { 0.2 };
    let pictures: [&dyn Fn(usize, usize) -> f64; 4] = [&regular, &stripes, &slow, &small];
    for (kind, light) in pictures.into_iter().enumerate() {
        assert!(!Lattice::is_whole(size, LOOKED_AT));
        let mut noise = Noise::keyed(&[63, kind as u64]);
        let truth: Vec<f64> = (0..size.0 * size.1).map(|i| light(i % size.0, i / size.0)).collect();
        let mut half =
            || -> Vec<f64> { truth.iter().map(|light| light * (1.0 + 0.02 * noise.normal())).collect() };
        let halves = [half(), half()];
        let pixel =
            |x: usize, y: usize| of_halves([0, 1].map(|i| ([halves[i][y * size.0 + x] as f32; 3], 8.0)));
        let found = estimate(size, pixel).unwrap();
        let off = off(found, &truth);
        // Four standard errors, by four grids: as Student's t of three degrees of freedom, 3 in 100 for one picture
        assert!(off.abs() < 4.0 * found.error + 1e-3 && found.error < 0.015, "{kind}: {off} off, {found:?}");
    }
}

/// Light in a corner of a black picture is found, however small a sample misses it.
#[test]
fn a_lamp_that_a_sample_misses_is_found() {
    let size = (1230, 570);
    for edge in [1, 3, 12, 40] {
        let lit = |x: usize, y: usize| (700..700 + edge).contains(&x) && (300..300 + edge).contains(&y);
        let pixel = |x: usize, y: usize| of_halves([([if lit(x, y) { 3.0 } else { 0.0 }; 3], 8.0); 2]);
        let found = estimate(size, pixel).unwrap();
        assert!((found.value / 3.0 - 1.0).abs() < 1e-3 && found.error < 1e-6, "{edge}: {found:?}");
    }
    assert!(estimate(size, |_, _| of_halves([([0.0; 3], 8.0); 2])).is_none());
}

/// Blocks begin in their cells, and no pixel is met more often than others, but for chance.
#[test]
fn blocks_are_all_over_a_large_picture() {
    for size in [(363, 362), (1920, 1080), (65_536, 3), (5, 60_000), (4000, 131)] {
        let mut met = vec![0u32; size.0 * size.1];
        for grid in 0..GRIDS.len() {
            let lattice = Lattice::new(size, grid, LOOKED_AT);
            let (across, down) = lattice.cells;
            assert!(!lattice.whole);
            for (row, column) in (0..down).flat_map(|row| (0..across).map(move |column| (row, column))) {
                let [x, y] = lattice.block(column, row);
                for (at, cell, cells, edge) in [(x, column, across, size.0), (y, row, down, size.1)] {
                    let [from, to] = [cell, cell + 1].map(|cell| (cell * (edge + 7) / cells) as isize - 7);
                    assert!(from <= at && at < to, "{size:?}: {at} in {from}..{to}");
                }
                for pixel in 0..BLOCK * BLOCK {
                    let at = [x + (pixel % BLOCK) as isize, y + (pixel / BLOCK) as isize];
                    let [x, y] = at.map(|at| usize::try_from(at).unwrap_or(usize::MAX));
                    if x < size.0 && y < size.1 {
                        met[y * size.0 + x] += 1;
                    }
                }
            }
        }
        // As many pixels as there may be, but for rounding, or a quarter of them where blocks are cut off
        let all: u32 = met.iter().sum();
        let most = (GRIDS.len() * LOOKED_AT * BLOCK * BLOCK) as u32;
        assert!((most / 4..=most + most / 16).contains(&all), "{size:?}: {all} of {most}");
        // Quarters of the picture are met alike: some thousand blocks each, at 4 standard errors of fewer than 1 in 30
        let quarter = |i: usize| (i % size.0 * 2 / size.0) + 2 * (i / size.0 * 2 / size.1);
        let mut sums = [0u32; 4];
        let mut pixels = [0usize; 4];
        for (i, met) in met.iter().enumerate() {
            sums[quarter(i)] += met;
            pixels[quarter(i)] += 1;
        }
        let share = |i: usize| f64::from(sums[i]) / pixels[i].max(1) as f64;
        let mean = f64::from(all) / met.len() as f64;
        let there = (0..4).filter(|&i| pixels[i] > 0);
        there.for_each(|i| {
            assert!((share(i) / mean - 1.0).abs() < 0.12, "{size:?}: {i} {} of {mean}", share(i))
        });
    }
}
