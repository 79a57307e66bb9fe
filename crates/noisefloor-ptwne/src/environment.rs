//! Light from infinitely far away.

use crate::alias::Alias;
use crate::error::SceneError;
use crate::math::{self, Vec3};
use crate::texture::MAX_TEXTURE_PIXELS;
use noisefloor::Rgb;
use std::f32::consts::FRAC_1_PI;

/// A sky: a smooth dome and, if wanted, a sun. Up is +y. Linear radiance, any non-negative scale.
///
/// The dome is gathered by scattered rays alone (it is too smooth for light sampling to help); the sun is a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Environment {
    /// Radiance straight up.
    pub zenith: Rgb,
    /// Radiance at the horizon. Above it the dome blends to the zenith with the square root of the height.
    pub horizon: Rgb,
    /// Radiance from below.
    pub ground: Rgb,
    /// The sun.
    pub sun: Option<Sun>,
}

/// A disc of light in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Direction towards the sun; need not have length 1.
    pub direction: [f32; 3],
    /// Half of the disc's apparent diameter in degrees, 0.01…30. Seen from the earth: 0.27.
    pub angular_radius: f32,
    /// Radiance of the disc, added to the dome's.
    pub radiance: Rgb,
}

/// Checks that a radiance is finite and not negative.
pub(crate) fn check_radiance(radiance: Rgb) -> Result<(), SceneError> {
    for value in radiance {
        if !value.is_finite() {
            return Err(SceneError::NotFinite { what: "a radiance" });
        }
        if !(0.0..=MAX_RADIANCE).contains(&value) {
            return Err(SceneError::Range { what: "a radiance", value, range: "0…1e12" });
        }
    }
    Ok(())
}

/// Largest radiance that is accepted: sums of products stay far from the limits of f32.
pub(crate) const MAX_RADIANCE: f32 = 1e12;

impl Environment {
    /// The same radiance from everywhere.
    pub fn constant(radiance: Rgb) -> Self {
        Self { zenith: radiance, horizon: radiance, ground: radiance, sun: None }
    }

    pub(crate) fn check(&self) -> Result<(), SceneError> {
        [self.zenith, self.horizon, self.ground].into_iter().try_for_each(check_radiance)?;
        let Some(sun) = self.sun else { return Ok(()) };
        check_radiance(sun.radiance)?;
        if !sun.direction.iter().all(|x| x.is_finite()) || sun.direction == [0.0; 3] {
            return Err(SceneError::NotFinite { what: "the direction of the sun" });
        }
        if !(0.01..=30.0).contains(&sun.angular_radius) {
            let what = "the angular radius of the sun";
            return Err(SceneError::Range { what, value: sun.angular_radius, range: "0.01…30 degrees" });
        }
        Ok(())
    }
}

/// The dome, ready for the inner loop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dome {
    zenith: Vec3,
    horizon: Vec3,
    ground: Vec3,
}

impl Dome {
    pub(crate) fn new(environment: &Environment) -> Self {
        Self {
            zenith: Vec3::from_array(environment.zenith),
            horizon: Vec3::from_array(environment.horizon),
            ground: Vec3::from_array(environment.ground),
        }
    }

    /// Radiance of the dome from `dir`.
    #[inline]
    pub(crate) fn radiance(&self, dir: Vec3) -> Vec3 {
        if dir.y >= 0.0 {
            self.horizon.lerp(self.zenith, dir.y.sqrt().min(1.0))
        } else {
            // A short blend below the horizon hides the edge
            self.horizon.lerp(self.ground, (dir.y * -12.0).min(1.0))
        }
    }
}

/// Light from infinitely far away as an image of all directions.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// Width in pixels: all around.
    pub width: usize,
    /// Height in pixels: from +y at the top to −y at the bottom, by equal angles.
    pub height: usize,
    /// Linear radiance, row-major, `width`·`height` values, each channel 0…1e12. A direction (x, y, z) of the map's own axes
    /// is seen at u = atan2(x, −z)/2π and v = acos(y)/π of the width and height; between pixels it is interpolated.
    pub pixels: Vec<Rgb>,
    /// Rows of the rotation that takes the map's axes to the scene's.
    pub to_world: [[f32; 3]; 3],
}

impl EnvironmentMap {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let (width, height) = (self.width, self.height);
        let size = width.checked_mul(height).filter(|s| (1..=MAX_TEXTURE_PIXELS).contains(s));
        if size != Some(self.pixels.len()) {
            return Err(SceneError::Image { width, height, found: self.pixels.len() });
        }
        let m = glam::DMat3::from_cols_array_2d(&self.to_world.map(|row| row.map(f64::from)));
        // A rotation, to what six digits in a file leave of it
        let off = (m * m.transpose() - glam::DMat3::IDENTITY).to_cols_array();
        if !off.iter().all(|x| x.abs() < 1e-4) {
            return Err(SceneError::Rotation);
        }
        self.pixels.iter().try_for_each(|p| check_radiance(*p))
    }
}

/// An environment map, ready to be looked up and to be sampled by its brightness.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
    /// Rows take the map's axes to the scene's; columns, back.
    to_world: [Vec3; 3],
    /// Cells of the sampling grid, in columns and rows.
    cells: [usize; 2],
    /// Walker's alias table over cells, and each cell's probability.
    table: Alias,
    chance: Vec<f32>,
    /// Mean radiance over the sphere.
    pub(crate) mean: Vec3,
}

/// Most columns and rows of the sampling grid. A cell is 0.7° wide, about the sun; finer grids fall out of a processor's cache and
/// cost more time than they save noise.
const CELLS: [usize; 2] = [512, 256];

impl Map {
    pub(crate) fn new(map: EnvironmentMap) -> Self {
        let EnvironmentMap { width, height, pixels, to_world } = map;
        let cells = [width.min(CELLS[0]), height.min(CELLS[1])];
        // A pixel counts by its solid angle and its mean luminance: of the interpolated image, over a pixel, that is the mean
        // of nine neighbours with the weights 1/8, 3/4, 1/8 in each direction
        let at = |x: usize, y: usize| Vec3::from_array(pixels[y * width + x]);
        let across = |x: usize, y: usize| {
            0.75 * at(x, y) + 0.125 * (at((x + 1) % width, y) + at((x + width - 1) % width, y))
        };
        let mut weights = vec![0.0; cells[0] * cells[1]];
        let (mut mean, mut total) = (glam::DVec3::ZERO, 0.0);
        for y in 0..height {
            let band = solid_angle(y, height);
            // Cells that a pixel lies in, in part: more than one where cells are not whole pixels
            let rows = |i: usize, n: usize, of: usize| i * n / of..=((i + 1) * n - 1) / of;
            for x in 0..width {
                let colour = 0.75 * across(x, y)
                    + 0.125 * (across(x, y.saturating_sub(1)) + across(x, (y + 1).min(height - 1)));
                for row in rows(y, cells[1], height) {
                    for column in rows(x, cells[0], width) {
                        weights[row * cells[0] + column] += f64::from(math::luminance(colour)) * band;
                    }
                }
                mean += colour.as_dvec3() * band;
                total += band;
            }
        }
        let sum: f64 = weights.iter().sum();
        let chance = weights.iter().map(|w| if sum > 0.0 { (w / sum) as f32 } else { 0.0 }).collect();
        Self {
            width,
            height,
            cells,
            table: Alias::new(&weights),
            chance,
            mean: (mean / total).as_vec3a(),
            pixels,
            to_world: to_world.map(Vec3::from_array),
        }
    }

    /// Where in the map `dir` is seen: u and v, and its height above the map's horizon.
    #[inline]
    fn place(&self, dir: Vec3) -> [f32; 3] {
        let [a, b, c] = self.to_world;
        let local = a * dir.x + b * dir.y + c * dir.z;
        let u = local.x.atan2(-local.z) * (0.5 * FRAC_1_PI);
        let y = local.y.clamp(-1.0, 1.0);
        [if u < 0.0 { u + 1.0 } else { u }, y.acos() * FRAC_1_PI, y]
    }

    /// Radiance from `dir`.
    #[inline]
    pub(crate) fn radiance(&self, dir: Vec3) -> Vec3 {
        let [u, v, _] = self.place(dir);
        let (x, y) = (u * self.width as f32 - 0.5, v * self.height as f32 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let column = |i: isize| i.rem_euclid(self.width as isize) as usize;
        let row = |i: isize| i.clamp(0, self.height as isize - 1) as usize * self.width;
        let (x1, x2) = (column(x0 as isize), column(x0 as isize + 1));
        let (y1, y2) = (row(y0 as isize), row(y0 as isize + 1));
        let at = |i: usize| Vec3::from_array(self.pixels[i]);
        let (fx, fy) = (x - x0, y - y0);
        at(y1 + x1).lerp(at(y1 + x2), fx).lerp(at(y2 + x1).lerp(at(y2 + x2), fx), fy)
    }

    /// Density of [`Map::sample`] at `dir`, in solid angle.
    #[inline]
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        let [u, v, y] = self.place(dir);
        let [columns, rows] = self.cells;
        let column = ((u * columns as f32) as usize).min(columns - 1);
        let row = ((v * rows as f32) as usize).min(rows - 1);
        let sin = (1.0 - y * y).max(1e-12).sqrt();
        self.chance[row * columns + column] * self.per_cell() / sin
    }

    /// Density in solid angle, times the sine, of a direction that is uniform in a cell.
    #[inline]
    fn per_cell(&self) -> f32 {
        self.chance.len() as f32 * (0.5 * FRAC_1_PI * FRAC_1_PI)
    }

    /// A direction and its density in solid angle.
    #[inline]
    pub(crate) fn sample(&self, u: [f32; 2], more: f32) -> Option<(Vec3, f32)> {
        let (index, rest) = self.table.choose(u[0], more);
        (self.chance[index] > 0.0).then(|| self.direction(index, [rest, u[1]]))
    }

    /// The direction at `at` in the unit square of a cell, and its density.
    #[inline]
    fn direction(&self, index: usize, at: [f32; 2]) -> (Vec3, f32) {
        let [columns, rows] = self.cells;
        let x = ((index % columns) as f32 + at[0]) / columns as f32;
        let y = ((index / columns) as f32 + at[1]) / rows as f32;
        let ((sin_u, cos_u), (sin_v, cos_v)) = (math::turn(x), math::turn(0.5 * y));
        let [a, b, c] = self.to_world;
        let local = Vec3::new(sin_u * sin_v, cos_v, -cos_u * sin_v);
        let dir = Vec3::new(a.dot(local), b.dot(local), c.dot(local));
        (dir.normalize(), self.chance[index] * self.per_cell() / sin_v.max(1e-6))
    }
}

/// Most columns and rows of [`Cells`].
const COARSE: [usize; 2] = [32, 16];

/// The environment map cut into coarse cells, to be chosen among by other chances than their brightness. Within one, directions
/// are chosen by brightness: rows by one number, columns by the other, so that what is even in the numbers is even in the map.
#[derive(Debug)]
pub(crate) struct Cells<'a> {
    map: &'a Map,
    columns: usize,
    /// Chance of each cell by its brightness, row-major.
    pub(crate) chances: Vec<f32>,
}

impl<'a> Cells<'a> {
    pub(crate) fn new(map: &'a Map) -> Self {
        let [columns, rows]: [usize; 2] = std::array::from_fn(|k| map.cells[k].min(COARSE[k]));
        let mut cells = Self { map, columns, chances: vec![0.0; columns * rows] };
        cells.chances =
            (0..columns * rows).map(|i| cells.rows(i).map(|y| cells.row_chance(i, y)).sum()).collect();
        cells
    }

    /// The map's own rows and columns that cell `index` has.
    fn rows(&self, index: usize) -> std::ops::Range<usize> {
        let n = self.chances.len() / self.columns;
        let (i, of) = (index / self.columns, self.map.cells[1]);
        i * of / n..(i + 1) * of / n
    }

    fn columns(&self, index: usize) -> std::ops::Range<usize> {
        let (i, of) = (index % self.columns, self.map.cells[0]);
        i * of / self.columns..(i + 1) * of / self.columns
    }

    fn row_chance(&self, index: usize, row: usize) -> f32 {
        self.columns(index).map(|x| self.map.chance[row * self.map.cells[0] + x]).sum()
    }

    /// The cell that `dir` lies in.
    pub(crate) fn cell(&self, dir: Vec3) -> usize {
        let [u, v, _] = self.map.place(dir);
        let fine = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        let [columns, rows] = self.map.cells;
        let n = self.chances.len() / self.columns;
        // The last coarse cell that begins no later
        let coarse = |i: usize, n: usize, of: usize| ((i + 1) * n - 1) / of;
        coarse(fine(v, rows), n, rows) * self.columns + coarse(fine(u, columns), self.columns, columns)
    }

    /// A direction within a cell, and its density in solid angle among those of the cell.
    pub(crate) fn sample(&self, index: usize, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let (row, v) = pick(self.rows(index), self.chances[index] * u[0], |y| self.row_chance(index, y))?;
        let at = |x: usize| self.map.chance[row * self.map.cells[0] + x];
        let (column, u) = pick(self.columns(index), self.row_chance(index, row) * u[1], at)?;
        let (dir, pdf) = self.map.direction(row * self.map.cells[0] + column, [u, v]);
        Some((dir, pdf / self.chances[index]))
    }
}

/// The first of `range` whose chances, summed, exceed `u`, and where in its own chance `u` lies, 0…1.
fn pick(range: std::ops::Range<usize>, mut u: f32, chance: impl Fn(usize) -> f32) -> Option<(usize, f32)> {
    let mut last = None;
    for (i, chance) in range.map(|i| (i, chance(i))).filter(|(_, chance)| *chance > 0.0) {
        if u < chance {
            return Some((i, u / chance));
        }
        u -= chance;
        // Rounding may exceed the sum
        last = Some((i, 1.0 - f32::EPSILON));
    }
    last
}

/// Solid angle of a pixel in row `y`, up to what is common to all.
fn solid_angle(y: usize, height: usize) -> f64 {
    let edge = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).cos();
    edge(y) - edge(y + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Key, Rng};

    fn uneven() -> Map {
        let mut rng = Rng::new(Key::new(1), 0, 0);
        let pixels: Vec<Rgb> = (0..16 * 8).map(|_| [rng.one().powi(6); 3]).collect();
        // A turn around (1, 1, 1) by a third
        let to_world = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let map = EnvironmentMap { width: 16, height: 8, pixels, to_world };
        map.check().unwrap();
        Map::new(map)
    }

    /// The density is the one it says, and the mean of radiance / density over the map's own samples is ∫L dω, as it is over
    /// uniform directions.
    #[test]
    fn maps_sample_what_they_show() {
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
            let y =
                f64::from(map.radiance(math::sphere(rng.two()).normalize()).x) * 4.0 * std::f64::consts::PI;
            even += y;
            even2 += y * y;
        }
        assert!(agreed > n - n / 500, "{agreed}");
        let n = f64::from(n);
        let error = ((own2 / n - (own / n).powi(2)) / n + (even2 / n - (even / n).powi(2)) / n).sqrt();
        // Five standard errors
        assert!(((own - even) / n).abs() < 5.0 * error, "{} {} ± {error}", own / n, even / n);
        // Uniform directions are noisier by far: what is left is variation within pixels
        let variance = |sum: f64, squares: f64| squares / n - (sum / n).powi(2);
        let (own, even) = (variance(own, own2), variance(even, even2));
        assert!(own < 0.5 * even, "{own} {even}");
    }

    #[test]
    fn maps_are_the_right_way_round() {
        // Brightest pixel: column 0 of 8, row 0 of 4: toward −z turned a little to +x, and up
        let mut pixels = vec![[0.0; 3]; 32];
        pixels[0] = [1.0; 3];
        let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let map = Map::new(EnvironmentMap { width: 8, height: 4, pixels, to_world });
        let (u, v) = (0.5 / 8.0 * std::f32::consts::TAU, 0.5 / 4.0 * std::f32::consts::PI);
        let dir = Vec3::new(u.sin() * v.sin(), v.cos(), -u.cos() * v.sin());
        assert!((map.radiance(dir).x - 1.0).abs() < 1e-5);
        assert_eq!(map.radiance(-dir).x, 0.0);
    }

    /// A map with more pixels than cells, of a size that does not divide: every bright pixel can be found.
    #[test]
    fn large_maps_are_sampled_by_cells() {
        let (width, height) = (1500, 601);
        let mut pixels = vec![[0.0; 3]; width * height];
        pixels[300 * width + 1022] = [1.0; 3];
        let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let map = Map::new(EnvironmentMap { width, height, pixels, to_world });
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

    /// Cells share the map among them, and what is chosen within one has, times the cell's chance, the density of the map's own choice.
    #[test]
    fn cells_are_parts_of_their_map() {
        let (small, mut rng) = (uneven(), Rng::new(Key::new(4), 0, 0));
        // 75 and 37 rows and columns do not divide into 32 and 16
        let pixels: Vec<Rgb> = (0..75 * 37).map(|_| [rng.one().powi(6); 3]).collect();
        let to_world = small.to_world.map(|row| row.to_array());
        let large = Map::new(EnvironmentMap { width: 75, height: 37, pixels, to_world });
        for map in [small, large] {
            let cells = Cells::new(&map);
            assert!((cells.chances.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            let (mut same, n) = (0, 20);
            for (cell, chance) in cells.chances.iter().enumerate() {
                for _ in 0..n {
                    let (dir, pdf) = cells.sample(cell, rng.two()).unwrap();
                    let own = map.pdf(dir);
                    // At the poles, the sine that the density is divided by is not known to f32
                    let known = map.place(dir)[2].abs() > 0.999 || (pdf * chance - own).abs() < 1e-3 * own;
                    same += usize::from(cells.cell(dir) == cell && known);
                }
            }
            // Rounding may put a direction into the next cell
            assert!(same > n * cells.chances.len() * 499 / 500, "{same}");
        }
    }

    #[test]
    fn maps_are_checked() {
        let good = EnvironmentMap {
            width: 2,
            height: 1,
            pixels: vec![[1.0; 3]; 2],
            to_world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
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
}
