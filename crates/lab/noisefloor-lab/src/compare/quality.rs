//! How far a picture is from the converged one.

use crate::error::LabError;
use noisefloor::{Rgb, Tile, TileGrid, display::Display};
use noisefloor_rivals::{MetricError, metrics};
use noisefloor_vision::{VisionModel, VisionWorkspace};
use serde::Serialize;

/// Distances of a picture from the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// Of linear radiance.
    pub rel_mse: f64,
    /// Of display values, in dB.
    pub psnr: f64,
    /// Mean FLIP error of display values.
    pub flip: f64,
    /// Mean FLIP error of the worst tile.
    pub flip_worst: f64,
    /// Butteraugli, 3-norm.
    pub butteraugli: f64,
    /// Butteraugli, 3-norm, of the worst tile.
    pub butteraugli_worst: f64,
    /// ColorVideoVDP: just-objectionable differences (JOD), of at most 10.
    pub cvvdp_jod: f64,
    /// ColorVideoVDP of the worst tile, each compared as a picture of its own.
    pub cvvdp_jod_worst: f64,
}

pub(super) struct Eye {
    pub(super) pixels_per_degree: f64,
    pub(super) vision: VisionModel,
}

/// The converged picture, and how it is looked at.
pub(super) struct Yardstick {
    grid: TileGrid,
    display: Display,
    linear: Vec<Rgb>,
    shown: Vec<Rgb>,
    eye: Eye,
}

/// The 3-norm of the values of an area: what the authors of butteraugli pool its map with.
fn norm3(values: &mut dyn Iterator<Item = f32>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + f64::from(v).powi(3), n + 1));
    (sum / count.max(1) as f64).cbrt()
}

fn mean(values: &mut dyn Iterator<Item = f32>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + f64::from(v), n + 1));
    sum / count.max(1) as f64
}

impl Yardstick {
    /// `reference` is linear radiance, row-major over the image of `grid`.
    pub(super) fn new(grid: TileGrid, display: Display, reference: Vec<Rgb>, eye: Eye) -> Self {
        let shown = reference.iter().map(|&p| display.encode(p)).collect();
        Self { grid, display, linear: reference, shown, eye }
    }

    pub(super) fn grid(&self) -> TileGrid {
        self.grid
    }

    /// The converged picture, display-encoded.
    pub(super) fn shown(&self) -> &[Rgb] {
        &self.shown
    }

    /// A picture as it is displayed.
    pub(super) fn encode(&self, image: &[Rgb]) -> Vec<Rgb> {
        image.iter().map(|&p| self.display.encode(p)).collect()
    }

    /// FLIP error of each pixel of a display-encoded picture.
    pub(super) fn flip(&self, shown: &[Rgb]) -> Result<Vec<f32>, LabError> {
        let (width, height) = (self.grid.width(), self.grid.height());
        Ok(metrics::flip(&self.shown, shown, width, height, self.eye.pixels_per_degree)?.values)
    }

    /// Mean over each tile of the FLIP errors of the pixels.
    pub(super) fn flip_of_tiles(&self, errors: &[f32]) -> Vec<f64> {
        self.pooled(errors, mean)
    }

    /// All distances of a picture of linear radiance.
    pub(super) fn quality(&self, image: &[Rgb]) -> Result<Quality, LabError> {
        let shown = self.encode(image);
        let (width, height) = (self.grid.width(), self.grid.height());
        let (flip, butteraugli) =
            rayon::join(|| self.flip(&shown), || metrics::butteraugli(&self.shown, &shown, width, height));
        let (flip, butteraugli) = (flip?, butteraugli?.values);
        let (cvvdp_jod, jods) = self.jods(&shown)?;
        let worst = |places: &[f64]| places.iter().copied().fold(0.0, f64::max);
        Ok(Quality {
            rel_mse: metrics::relative_mse(image, &self.linear)?,
            psnr: metrics::psnr(&shown, &self.shown)?,
            flip: mean(&mut flip.iter().copied()),
            flip_worst: worst(&self.pooled(&flip, mean)),
            butteraugli: norm3(&mut butteraugli.iter().copied()),
            butteraugli_worst: worst(&self.pooled(&butteraugli, norm3)),
            cvvdp_jod,
            cvvdp_jod_worst: jods.into_iter().fold(10.0, f64::min),
        })
    }

    /// JODs of a display-encoded picture, and of each tile.
    pub(super) fn jods(&self, shown: &[Rgb]) -> Result<(f64, Vec<f64>), LabError> {
        let (vision, size) = (&self.eye.vision, (self.grid.width(), self.grid.height()));
        let tiles: Vec<Tile> = self.grid.tiles().collect();
        let jods = metrics::cvvdp_of_tiles(&self.shown, shown, self.grid, &tiles, vision)?;
        let mut workspace = VisionWorkspace::default();
        let whole = vision.compare(shown, &self.shown, size, &mut workspace).map_err(MetricError::from)?;
        Ok((whole.jod(), jods))
    }

    /// Values of pixels, pooled over each tile.
    fn pooled(&self, values: &[f32], pool: fn(&mut dyn Iterator<Item = f32>) -> f64) -> Vec<f64> {
        let width = self.grid.width();
        let pool_tile = |tile: Tile| pool(&mut tile.rows(width).flatten().map(|pixel| values[pixel]));
        self.grid.tiles().map(pool_tile).collect()
    }
}
