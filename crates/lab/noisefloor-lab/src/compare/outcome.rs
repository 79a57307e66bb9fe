//! What came of a comparison, as data.

use super::denoising::{AfterDenoising, DENOISED_LIMIT};
use super::quality::{Quality, Yardstick};
use super::race::{CurvePoint, Entrant, Race};
use crate::error::LabError;
use serde::Serialize;

/// What a criterion took of a scene's run, and what it left.
#[derive(Clone, Debug, PartialEq)]
pub struct CriterionRun {
    pub taken: Taken,
    pub quality: Quality,
    pub against: AgainstUniform,
    /// `None` where nothing is denoised.
    pub denoised: Option<AfterDenoising>,
}

/// What a criterion took of a scene's run: the first columns of runs.csv.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Taken {
    pub scene: String,
    pub source: String,
    /// The criterion as it was asked for: `cycles:0.01`.
    pub criterion: String,
    /// What the criterion calls itself, with its constant.
    pub name: String,
    /// What it is one of: `cycles`. Runs of one family differ only in their constant.
    pub family: String,
    /// Samples per pixel, on average.
    pub spp_mean: f64,
    /// Samples per pixel of the tile with most.
    pub spp_most: u64,
    pub tiles: usize,
    /// Tiles that the criterion was satisfied with before the limit.
    pub tiles_converged: usize,
    /// Seconds in the source for these samples.
    pub source_seconds: f64,
    pub criterion_seconds: f64,
}

/// Samples that uniform sampling takes until its worst tile is as good, over those of a criterion. `None` if it does
/// not get there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AgainstUniform {
    /// By FLIP.
    pub uniform_over_this: Option<f64>,
    /// The same by FLIP, in seconds of the source, over those of source and criterion.
    pub uniform_over_this_seconds: Option<f64>,
    pub uniform_over_this_butteraugli: Option<f64>,
    pub uniform_over_this_cvvdp: Option<f64>,
}

impl Taken {
    /// Seconds in source and criterion.
    pub fn seconds(&self) -> f64 {
        self.source_seconds + self.criterion_seconds
    }
}

/// Where a criterion stopped a tile, and how that tile looks: a line of tiles.csv.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TileStop {
    pub scene: String,
    /// The criterion as it was asked for.
    pub criterion: String,
    pub tile: usize,
    /// Left edge in pixels.
    pub x: usize,
    /// Top edge in pixels.
    pub y: usize,
    pub spp: u64,
    pub flip: f64,
}

/// What came of the criteria on one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    pub scene: String,
    pub source: String,
    /// Width and height in pixels.
    pub size: (usize, usize),
    /// Where the converged picture comes from, for people.
    pub reference: String,
    /// Whether the run was cancelled: what is here is of the samples until then.
    pub cancelled: bool,
    /// What is likely to be wrong with the samples ([`noisefloor::watch`]), as the criterion that saw the most says.
    pub warnings: Vec<String>,
    /// The criteria, in the order in which they were given.
    pub runs: Vec<CriterionRun>,
    /// Uniform sampling, by increasing samples.
    pub curve: Vec<CurvePoint>,
    pub tiles: Vec<TileStop>,
}

#[derive(Clone, Debug)]
pub struct Labels {
    pub scene: String,
    /// Where the converged picture comes from, for people.
    pub reference: String,
}

impl Comparison {
    /// `flips` are the FLIP errors of each entrant's picture, tile by tile.
    pub(super) fn new(
        labels: Labels,
        source: String,
        race: &Race,
        yardstick: &Yardstick,
        flips: &[Vec<f64>],
    ) -> Result<Self, LabError> {
        let Labels { scene, reference } = labels;
        let grid = yardstick.grid();
        let run = |entrant: &Entrant| criterion_run(entrant, race, yardstick, &scene, &source);
        let runs = race.entrants.iter().map(run).collect::<Result<_, _>>()?;
        let mut tiles = Vec::new();
        for (entrant, flips) in race.entrants.iter().zip(flips) {
            tiles.extend(grid.tiles().zip(flips).map(|(tile, &flip)| TileStop {
                scene: scene.clone(),
                criterion: entrant.spec.clone(),
                tile: tile.index,
                x: tile.x,
                y: tile.y,
                spp: entrant.film().spp(tile.index),
                flip,
            }));
        }
        Ok(Self {
            source: source.clone(),
            size: grid.size(),
            reference,
            cancelled: race.cancelled,
            warnings: race.entrants.iter().map(Entrant::warnings).max_by_key(Vec::len).unwrap_or_default(),
            runs,
            curve: race.curve.clone(),
            tiles,
            scene: scene.clone(),
        })
    }
}

impl Comparison {
    /// Samples per pixel at which uniform sampling is within [`DENOISED_LIMIT`] once it is denoised; `None`
    /// outside its curve, and where nothing is denoised.
    pub(crate) fn uniform_denoised(&self) -> Option<f64> {
        let points = self.curve.iter().map(|p| Some((p.spp as f64, 10.0 - p.denoised?.jod_worst)));
        let points: Vec<(f64, f64)> = points.collect::<Option<_>>()?;
        let (first, lost) = *points.first()?;
        if lost <= DENOISED_LIMIT { Some(first) } else { crossing(&points, DENOISED_LIMIT) }
    }
}

fn criterion_run(
    entrant: &Entrant,
    race: &Race,
    yardstick: &Yardstick,
    scene: &str,
    source: &str,
) -> Result<CriterionRun, LabError> {
    let film = entrant.film();
    let grid = film.grid();
    let spp_mean = film.total_samples() as f64 / (grid.width() * grid.height()) as f64;
    let quality = yardstick.quality(&film.image())?;
    // Between points of the curve
    let uniform = |error: fn(&Quality) -> f64| {
        let points = race.curve.iter().map(|point| (point.spp as f64, error(&point.quality)));
        crossing(&points.collect::<Vec<_>>(), error(&quality))
    };
    let over = |error| Some(uniform(error)? / spp_mean);
    let taken = Taken {
        scene: scene.into(),
        source: source.into(),
        criterion: entrant.spec.clone(),
        name: entrant.name(),
        family: entrant.family.clone(),
        spp_mean,
        spp_most: (0..grid.len()).map(|t| film.spp(t)).max().unwrap_or(0),
        tiles: grid.len(),
        tiles_converged: entrant.converged(),
        source_seconds: race.source_seconds(entrant),
        criterion_seconds: entrant.criterion_seconds,
    };
    let against = AgainstUniform {
        uniform_over_this: over(|q| q.flip_worst),
        uniform_over_this_seconds: uniform(|q| q.flip_worst)
            .map(|spp| spp * race.tile_seconds.iter().sum::<f64>() / taken.seconds()),
        uniform_over_this_butteraugli: over(|q| q.butteraugli_worst),
        uniform_over_this_cvvdp: over(|q| 10.0 - q.cvvdp_jod_worst),
    };
    Ok(CriterionRun { taken, quality, against, denoised: None })
}

/// Where a falling curve first comes down to a value, along straight lines in logarithms; `None` outside the curve.
fn crossing(points: &[(f64, f64)], wanted: f64) -> Option<f64> {
    points.windows(2).find_map(|pair| {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
        (y0 >= wanted && wanted >= y1 && y1 > 0.0).then(|| {
            let place = if y0 > y1 { (y0 / wanted).ln() / (y0 / y1).ln() } else { 0.0 };
            x0 * (x1 / x0).powf(place)
        })
    })
}

/// Names of the families, each once, in the order of the entrants.
pub(super) fn families(runs: &[CriterionRun]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for Taken { family, .. } in runs.iter().map(|run| &run.taken) {
        if !names.contains(&family.as_str()) {
            names.push(family);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_curve_is_crossed_between_its_points() {
        let curve = [(1.0, 1.0), (4.0, 0.5), (16.0, 0.25)];
        assert_eq!(crossing(&curve, 0.5), Some(4.0));
        let middle = crossing(&curve, 0.5 / 2f64.sqrt()).unwrap();
        assert!((middle - 8.0).abs() < 1e-9, "half way in logarithms: {middle}");
        assert_eq!((crossing(&curve, 2.0), crossing(&curve, 0.2)), (None, None), "outside the curve");
    }
}
