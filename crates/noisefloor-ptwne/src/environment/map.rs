//! An image of all directions, sampled by brightness.

use crate::alias::AliasTable;
use crate::checks::check_radiance;
use crate::error::SceneError;
use crate::math::{self, Vec3};
use crate::texture::MAX_TEXTURE_PIXELS;
use noisefloor::Rgb;
use std::f32::consts::FRAC_1_PI;

/// Light from infinitely far away, as an image of all directions.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// Width in pixels, for 360°.
    pub width: usize,
    /// Height in pixels, from +y at the top to −y at the bottom in equal angles.
    pub height: usize,
    /// Linear radiance, row-major, `width`·`height` pixels, each channel 0…1e12, interpolated between pixels.
    /// The direction (x, y, z) in the map's own axes is at u = atan2(x, −z)/2π of the width and v = acos(y)/π
    /// of the height.
    pub pixels: Vec<Rgb>,
    /// Rows of the rotation from the map's axes to the scene's.
    pub to_world: [[f32; 3]; 3],
    /// Whether the first and the last row show the poles themselves, as in Mitsuba 3, and not what lies half a row
    /// away from them.
    pub poles: bool,
}

impl EnvironmentMap {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let (width, height) = (self.width, self.height);
        let size = width.checked_mul(height).filter(|s| (1..=MAX_TEXTURE_PIXELS).contains(s));
        if size != Some(self.pixels.len()) {
            return Err(SceneError::Image { width, height, found: self.pixels.len() });
        }
        let m = glam::DMat3::from_cols_array_2d(&self.to_world.map(|row| row.map(f64::from)));
        // A rotation, as accurate as six digits in a file
        let off = (m * m.transpose() - glam::DMat3::IDENTITY).to_cols_array();
        if !off.iter().all(|x| x.abs() < 1e-4) {
            return Err(SceneError::Rotation);
        }
        self.pixels.iter().try_for_each(|p| check_radiance(*p))
    }
}

/// An environment map, prepared for lookup and for sampling by brightness.
#[derive(Clone, Debug)]
pub(crate) struct Map {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
    poles: bool,
    /// Rows take the map's axes to the scene's; columns take them back.
    pub(super) to_world: [Vec3; 3],
    /// Cells of the sampling grid, in columns and rows.
    pub(super) cells: [usize; 2],
    /// Chooses a cell, with the probabilities of `pmf`.
    table: AliasTable,
    pub(super) pmf: Vec<f32>,
    /// Mean radiance over the sphere.
    pub(crate) mean: Vec3,
}

/// Most columns and rows of the sampling grid. A cell is 0.7° wide, a little more than the sun. Finer grids
/// do not fit into a processor's cache and cost more time than they save noise.
const MAX_CELLS: [usize; 2] = [512, 256];

impl Map {
    pub(crate) fn new(map: EnvironmentMap) -> Self {
        let EnvironmentMap { width, height, pixels, to_world, poles } = map;
        let cells = [width.min(MAX_CELLS[0]), height.min(MAX_CELLS[1])];
        // A pixel's weight is its solid angle times its mean luminance. The mean of the interpolated image
        // over a pixel is that of nine pixels with weights 1/8, 3/4, 1/8 in each direction
        let at = |x: usize, y: usize| {
            // Where the middle of a row of the grid lies among rows that reach from pole to pole
            let row = if poles { (y as f32 + 0.5) * (1.0 - 1.0 / height as f32) } else { y as f32 };
            let above = row as usize;
            let colour_at = |y: usize| Vec3::from_array(pixels[y.min(height - 1) * width + x]);
            colour_at(above).lerp(colour_at(above + 1), row - above as f32)
        };
        let across = |x: usize, y: usize| {
            0.75 * at(x, y) + 0.125 * (at((x + 1) % width, y) + at((x + width - 1) % width, y))
        };
        let mut weights = vec![0.0; cells[0] * cells[1]];
        let (mut mean, mut total) = (glam::DVec3::ZERO, 0.0);
        for y in 0..height {
            let band = solid_angle(y, height);
            // Cells that a pixel overlaps: more than one where cells are not whole pixels
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
        let pmf = weights.iter().map(|w| if sum > 0.0 { (w / sum) as f32 } else { 0.0 }).collect();
        Self {
            width,
            height,
            cells,
            table: AliasTable::new(&weights),
            pmf,
            mean: (mean / total).as_vec3a(),
            pixels,
            poles,
            to_world: to_world.map(Vec3::from_array),
        }
    }

    /// u and v of `dir` in the map, and its y in the map's axes.
    #[inline]
    pub(super) fn uv(&self, dir: Vec3) -> [f32; 3] {
        let [a, b, c] = self.to_world;
        let local = a * dir.x + b * dir.y + c * dir.z;
        let u = local.x.atan2(-local.z) * (0.5 * FRAC_1_PI);
        let y = local.y.clamp(-1.0, 1.0);
        [if u < 0.0 { u + 1.0 } else { u }, y.acos() * FRAC_1_PI, y]
    }

    /// Radiance from `dir`.
    #[inline]
    pub(crate) fn radiance(&self, dir: Vec3) -> Vec3 {
        let [u, v, _] = self.uv(dir);
        let x = u * self.width as f32 - 0.5;
        let y = if self.poles { v * (self.height - 1) as f32 } else { v * self.height as f32 - 0.5 };
        let (x0, y0) = (x.floor(), y.floor());
        let column = |i: isize| i.rem_euclid(self.width as isize) as usize;
        let row = |i: isize| i.clamp(0, self.height as isize - 1) as usize * self.width;
        let (x1, x2) = (column(x0 as isize), column(x0 as isize + 1));
        let (y1, y2) = (row(y0 as isize), row(y0 as isize + 1));
        let at = |i: usize| Vec3::from_array(self.pixels[i]);
        let (fx, fy) = (x - x0, y - y0);
        at(y1 + x1).lerp(at(y1 + x2), fx).lerp(at(y2 + x1).lerp(at(y2 + x2), fx), fy)
    }

    /// Density of [`Map::sample`] at `dir`, per solid angle.
    #[inline]
    pub(crate) fn pdf(&self, dir: Vec3) -> f32 {
        let [u, v, y] = self.uv(dir);
        let [columns, rows] = self.cells;
        let column = ((u * columns as f32) as usize).min(columns - 1);
        let row = ((v * rows as f32) as usize).min(rows - 1);
        let sin = (1.0 - y * y).max(1e-12).sqrt();
        self.pmf[row * columns + column] * self.per_cell() / sin
    }

    /// Density per solid angle, times the sine of the polar angle, of a direction drawn uniformly in a cell.
    #[inline]
    fn per_cell(&self) -> f32 {
        self.pmf.len() as f32 * (0.5 * FRAC_1_PI * FRAC_1_PI)
    }

    /// A direction and its density per solid angle.
    #[inline]
    pub(crate) fn sample(&self, u: [f32; 2], more: f32) -> Option<(Vec3, f32)> {
        let (index, rest) = self.table.choose(u[0], more);
        (self.pmf[index] > 0.0).then(|| self.direction(index, [rest, u[1]]))
    }

    /// The direction at `at` in the unit square of a cell, and its density.
    #[inline]
    pub(super) fn direction(&self, index: usize, at: [f32; 2]) -> (Vec3, f32) {
        let [columns, rows] = self.cells;
        let x = ((index % columns) as f32 + at[0]) / columns as f32;
        let y = ((index / columns) as f32 + at[1]) / rows as f32;
        let ((sin_u, cos_u), (sin_v, cos_v)) = (math::turn(x), math::turn(0.5 * y));
        let [a, b, c] = self.to_world;
        let local = Vec3::new(sin_u * sin_v, cos_v, -cos_u * sin_v);
        let dir = Vec3::new(a.dot(local), b.dot(local), c.dot(local));
        (dir.normalize(), self.pmf[index] * self.per_cell() / sin_v.max(1e-6))
    }
}

/// Solid angle of a pixel in row `y`, up to a factor common to all.
fn solid_angle(y: usize, height: usize) -> f64 {
    let edge = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).cos();
    edge(y) - edge(y + 1)
}
