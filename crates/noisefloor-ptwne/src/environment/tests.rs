//! Environment maps: densities, orientation, cells and checks.

use super::{Cells, EnvironmentMap, Map};
use crate::error::SceneError;
use crate::math::{self, Vec3};
use crate::rng::{Key, Rng};
use noisefloor::Rgb;

/// A map as it lies.
fn map(width: usize, height: usize, pixels: Vec<Rgb>, poles: bool) -> Map {
    let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Map::new(EnvironmentMap { width, height, pixels, to_world, poles })
}

fn uneven() -> Map {
    let mut rng = Rng::new(Key::new(1), 0, 0);
    let pixels: Vec<Rgb> = (0..16 * 8).map(|_| [rng.one().powi(6); 3]).collect();
    // A turn around (1, 1, 1) by a third
    let to_world = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let map = EnvironmentMap { width: 16, height: 8, pixels, to_world, poles: false };
    map.check().unwrap();
    Map::new(map)
}

/// Samples have the density they report, and the mean of radiance / density over them is ∫L dω, as it is over
/// uniform directions.
#[test]
fn maps_are_sampled_by_brightness() {
    let (map, mut rng) = (uneven(), Rng::new(Key::new(2), 0, 0));
    let n = 40_000;
    let (mut own, mut own2, mut even, mut even2, mut agreed) = (0.0, 0.0, 0.0, 0.0, 0);
    for _ in 0..n {
        let (dir, pdf) = map.sample(rng.two(), rng.one()).unwrap();
        // Rounding may put a direction into the next cell
        agreed += i32::from((pdf - map.pdf(dir)).abs() < 1e-3 * pdf);
        let x = f64::from(map.radiance(dir).x / pdf);
        own += x;
        own2 += x * x;
        let y = f64::from(map.radiance(math::sphere(rng.two()).normalize()).x) * 4.0 * std::f64::consts::PI;
        even += y;
        even2 += y * y;
    }
    assert!(agreed > n - n / 500, "{agreed}");
    let n = f64::from(n);
    let error = ((own2 / n - (own / n).powi(2)) / n + (even2 / n - (even / n).powi(2)) / n).sqrt();
    // Five standard errors
    assert!(((own - even) / n).abs() < 5.0 * error, "{} {} ± {error}", own / n, even / n);
    // Uniform directions are far noisier: what is left here is variation within pixels
    let variance = |sum: f64, squares: f64| squares / n - (sum / n).powi(2);
    let (own, even) = (variance(own, own2), variance(even, even2));
    assert!(own < 0.5 * even, "{own} {even}");
}

#[test]
fn maps_are_the_right_way_round() {
    // Brightest pixel: column 0 of 8, row 0 of 4: toward −z turned a little to +x, and up
    let mut pixels = vec![[0.0; 3]; 32];
    pixels[0] = [1.0; 3];
    let map = map(8, 4, pixels, false);
    let (u, v) = (0.5 / 8.0 * std::f32::consts::TAU, 0.5 / 4.0 * std::f32::consts::PI);
    let dir = Vec3::new(u.sin() * v.sin(), v.cos(), -u.cos() * v.sin());
    assert!((map.radiance(dir).x - 1.0).abs() < 1e-5);
    assert_eq!(map.radiance(-dir).x, 0.0);
}

/// Rows of 0 to 3 from pole to pole: what Mitsuba 3.9.1 shows at sixteenths of the way is 3/16 each. Samples find
/// all of it.
#[test]
fn rows_may_reach_from_pole_to_pole() {
    let pixels = (0..32).map(|i| [(i / 8) as f32; 3]).collect();
    let map = map(8, 4, pixels, true);
    for k in 0..=16 {
        let angle = k as f32 / 16.0 * std::f32::consts::PI;
        let seen = map.radiance(Vec3::new(0.0, angle.cos(), angle.sin())).x;
        assert!((seen - 3.0 * k as f32 / 16.0).abs() < 1e-5, "{k}: {seen}");
    }
    let (mut rng, n) = (Rng::new(Key::new(5), 0, 0), 200_000);
    let sum: f64 = (0..n)
        .map(|_| {
            let (dir, pdf) = map.sample(rng.two(), rng.one()).unwrap();
            f64::from(map.radiance(dir).x / pdf)
        })
        .sum();
    // The mean of a ramp over the sphere is that of its middle. Values vary by less than their mean: five standard
    // errors are below 1.2 %
    let mean = sum / f64::from(n) / (4.0 * std::f64::consts::PI);
    assert!((mean / 1.5 - 1.0).abs() < 0.012, "{mean}");
}

/// A map with more pixels than cells, and not a whole number of pixels per cell: every bright pixel is found.
#[test]
fn large_maps_are_sampled_by_cells() {
    let (width, height) = (1500, 601);
    let mut pixels = vec![[0.0; 3]; width * height];
    pixels[300 * width + 1022] = [1.0; 3];
    let map = map(width, height, pixels, false);
    let mut rng = Rng::new(Key::new(3), 0, 0);
    let n = 100_000;
    let values = (0..n).map(|_| {
        let (dir, pdf) = map.sample(rng.two(), rng.one()).unwrap();
        f64::from(map.radiance(dir).x / pdf)
    });
    let (sum, squares) = values.fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
    // ∫ of a tent over one pixel in each direction, at the equator: the pixel's solid angle
    let exact = std::f64::consts::PI / 601.0 * 2.0 * std::f64::consts::PI / 1500.0;
    let (mean, n) = (sum / f64::from(n), f64::from(n));
    let error = ((squares / n - mean * mean) / n).sqrt();
    assert!((mean - exact).abs() < 5.0 * error + 1e-3 * exact, "{mean} ± {error}, {exact}");
}

/// Cells partition the map, and the density within a cell times the cell's probability is the map's own
/// density.
#[test]
fn cells_partition_their_map() {
    let (small, mut rng) = (uneven(), Rng::new(Key::new(4), 0, 0));
    // 75 and 37 rows and columns do not divide into 32 and 16
    let pixels: Vec<Rgb> = (0..75 * 37).map(|_| [rng.one().powi(6); 3]).collect();
    let to_world = small.to_world.map(|row| row.to_array());
    let large = Map::new(EnvironmentMap { width: 75, height: 37, pixels, to_world, poles: false });
    for map in [small, large] {
        let cells = Cells::new(&map);
        assert!((cells.pmf.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        let (mut same, n) = (0, 20);
        for (cell, p) in cells.pmf.iter().enumerate() {
            for _ in 0..n {
                let (dir, pdf) = cells.sample(cell, rng.two()).unwrap();
                let own = map.pdf(dir);
                // At the poles, f32 does not resolve the sine that the density is divided by
                let known = map.uv(dir)[2].abs() > 0.999 || (pdf * p - own).abs() < 1e-3 * own;
                same += usize::from(cells.cell(dir) == cell && known);
            }
        }
        // Rounding may put a direction into the next cell
        assert!(same > n * cells.pmf.len() * 499 / 500, "{same}");
    }
}

#[test]
fn maps_are_checked() {
    let good = EnvironmentMap {
        width: 2,
        height: 1,
        pixels: vec![[1.0; 3]; 2],
        to_world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        poles: false,
    };
    good.check().unwrap();
    let with = |change: fn(&mut EnvironmentMap)| {
        let mut map = good.clone();
        change(&mut map);
        map.check().unwrap_err()
    };
    assert!(matches!(with(|m| m.width = 3), SceneError::Image { .. }));
    assert!(matches!(with(|m| m.pixels[1][2] = f32::NAN), SceneError::NotFinite { .. }));
    assert_eq!(with(|m| m.to_world[0][0] = 2.0), SceneError::Rotation);
}
