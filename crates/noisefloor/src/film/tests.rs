use super::*;
use proptest::prelude::*;

fn small() -> Film {
    Film::new(TileGrid::new(24, 16, 16).unwrap())
}

#[test]
fn batches_go_to_the_lighter_half() {
    let mut film = small();
    for n in [50, 50, 100, 30, 30] {
        film.add(1, n, &[[1.0; 3]; 8 * 16]).unwrap();
    }
    // 50|0 → 50|50 → 150|50 → 150|80 → 150|110
    assert_eq!(film.half_counts(1), [150, 110]);
    assert_eq!(film.spp(0), 0);
    assert_eq!(film.total_samples(), 260 * 128);
}

/// No caller can make counts overflow, whatever it claims to have sampled.
#[test]
fn counts_have_a_limit() {
    let grey = [[1.0; 3]; 128];
    let mut film = small();
    film.add(1, (1 << 33) - 1, &grey).unwrap();
    film.add(1, 1 << 33, &grey).unwrap();
    for spp in [1, u64::MAX] {
        assert!(matches!(film.add(1, spp, &grey), Err(FilmError::TooMany { tile: 1, .. })), "{spp}");
    }
    assert_eq!(film.spp(1), (1 << 34) - 1);
}

#[test]
fn non_finite_pixels_are_kept_out_and_counted() {
    let mut film = small();
    let mut first = [[1.0f32; 3]; 128];
    first[3] = [f32::NAN, 1.0, 1.0];
    film.add(1, 10, &first).unwrap();
    film.add(1, 10, &[[2.0; 3]; 128]).unwrap();
    film.add(1, 10, &[[3.0; 3]; 128]).unwrap(); // half A again
    let image = film.image();
    let pixel = |i: usize| image[(i / 8) * 24 + 16 + i % 8][0];
    assert!((pixel(0) - 2.0).abs() < 1e-6);
    assert!((pixel(3) - 2.5).abs() < 1e-6, "mean of the two that count: {}", pixel(3));
    assert_eq!(film.rejected(), 10);
    assert_eq!(film.unsampled_pixels(1), 0);
    assert!(image.iter().flatten().all(|c| c.is_finite()));
}

#[test]
fn refuses_what_does_not_fit() {
    let mut film = small();
    assert_eq!(film.add(2, 1, &[]), Err(FilmError::Tile(2, 2)));
    assert!(matches!(film.add(1, 1, &[[0.0; 3]; 3]), Err(FilmError::Pixels { .. })));
    assert!(matches!(film.add(1, 0, &[[0.0; 3]; 128]), Err(FilmError::NothingNew { .. })));
}

/// The bound that `Half` states: 10⁹ samples in batches of 100 stay within 2.4·10⁻⁶ of the exact mean. Where
/// a plain f32 running mean goes by then is asserted too, so that the test would notice if the carry did
/// nothing.
#[test]
fn stays_accurate_at_a_billion_samples() {
    let mut half = Half::new(1);
    let (mut plain, mut sum) = (0.0f32, 0.0f64);
    let batches = 10_000_000u64;
    for k in 0..batches {
        // Drifts upward, so that late batches matter: 0.5 … 1.5 with a ripple.
        let value = 0.5 + (k as f32) / (batches as f32) + ((k * 7919 % 1000) as f32 / 1000.0 - 0.4995) * 0.5;
        let (mean, carry) = (half.mean.as_flattened_mut(), half.carry.as_flattened_mut());
        add_numbers(mean, carry, &[value; 3], weight(100, k * 100));
        plain += (value - plain) * (1.0 / (k + 1) as f32);
        sum += f64::from(value);
    }
    let exact = sum / batches as f64;
    let error = |x: f32| (f64::from(x) / exact - 1.0).abs();
    assert!(error(half.mean[0][0]) < 2.4e-6, "{}", error(half.mean[0][0]));
    assert!(error(plain) > 2.4e-6, "a plain mean errs by {}", error(plain));
}

#[test]
fn a_film_that_was_kept_goes_on_to_the_bit() {
    let batch = |n: u64| (0..128).map(|i| [0.1 * n as f32, (i as f32).sin(), 1e-3]).collect::<Vec<_>>();
    let mut film = small();
    for n in 1..=9 {
        film.add(1, 10 * n, &batch(n)).unwrap();
    }
    film.add(1, 5, &[[f32::NAN; 3]; 128]).unwrap();
    let bytes = |film: &Film| {
        let mut kept = Vec::new();
        film.write_pixels(&mut kept).unwrap();
        kept
    };
    let mut other = Film::read_pixels(film.head(), &mut &bytes(&film)[..]).unwrap().unwrap();
    for film in [&mut film, &mut other] {
        (10..=20).for_each(|n| film.add(1, n, &batch(n)).unwrap());
    }
    assert_eq!(film.half_counts(1), other.half_counts(1));
    assert!(bytes(&film) == bytes(&other));
}

/// −0, the smallest numbers there are, the largest ones, and negative radiance: the mean is that of f64, to
/// the last bits.
#[test]
fn both_ends_of_f32_are_averaged() {
    for values in [[-0.0, 0.0], [1e-45, 3e-45], [1e-38, 2e-39], [f32::MAX, f32::MAX], [-3.0, 1.0]] {
        let mut film = small();
        for value in values.repeat(4) {
            film.add(0, 7, &[[value; 3]; 16 * 16]).unwrap();
        }
        let mean = 0.5 * (f64::from(values[0]) + f64::from(values[1]));
        let error = (f64::from(film.image()[0][0]) - mean).abs();
        assert!(error <= 1e-6 * mean.abs() + 1.5e-45, "{values:?}: {}", film.image()[0][0]);
    }
}

/// 3.4·10³⁸ and −3.4·10³⁸ have the mean 0, as in f64, though their difference is no f32.
#[test]
fn means_of_huge_values_are_finite() {
    let grid = TileGrid::new(16, 16, 16).unwrap();
    for mut film in [Film::new(grid), Film::without_halves(grid)] {
        film.add(0, 1, &[[3.4e38; 3]; 256]).unwrap();
        film.add(0, 1, &[[-3.4e38; 3]; 256]).unwrap();
        assert!(film.image().iter().all(|pixel| *pixel == [0.0; 3]), "{:?}", film.pixel(0, 0));
    }
    let mut film = Film::new(grid);
    film.add(0, 3, &[[3e38; 3]; 256]).unwrap();
    film.add(0, 1, &[[-3e38; 3]; 256]).unwrap();
    let mean = film.pixel(0, 0)[0];
    assert!((mean / 1.5e38 - 1.0).abs() < 1e-6, "{mean}");
}

/// What [`add_numbers`] does to one number, as its documentation puts it: in f64, with the division and the rounding
/// that it avoids.
fn add_number(mean: f32, carry: i16, value: f32, weight: f64) -> (f32, i16) {
    let old = f64::from(mean) + f64::from(carry) * ulp(mean) / CARRY;
    let new = old + (f64::from(value) - old) * weight;
    let mean = new as f32;
    let step = ulp(mean);
    let rest = if step > 0.0 { (new - f64::from(mean)) / step * CARRY } else { 0.0 };
    (mean, rest.round() as i16)
}

/// A finite number of any size, often a small whole one: ties of roundings are rare among others.
fn any_number() -> impl Strategy<Value = f32> {
    let of_bits = any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite());
    prop_oneof![of_bits, (-9i16..9).prop_map(f32::from), 1e-3f32..10.0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// With whatever instructions this processor has, and whatever the length of the row.
    #[test]
    fn rows_are_added_as_single_numbers_are(
        row in prop::collection::vec((any_number(), any::<i16>(), any_number()), 1..40),
        spp in 1u64..200,
        before in 0u64..2000,
    ) {
        let (mut mean, mut carry): (Vec<f32>, Vec<i16>) = row.iter().map(|n| (n.0, n.1)).unzip();
        let values: Vec<f32> = row.iter().map(|n| n.2).collect();
        let weight = weight(spp, before);
        let expected: Vec<(f32, i16)> = row.iter().map(|&(m, c, v)| add_number(m, c, v, weight)).collect();
        add_numbers(&mut mean, &mut carry, &values, weight);
        let found = mean.into_iter().zip(carry);
        for (found, expected) in found.zip(expected) {
            prop_assert_eq!((found.0.to_bits(), found.1), (expected.0.to_bits(), expected.1));
        }
    }
}
