//! Learns which lights a block of the ray-traced reference sees, from its samples.

use crate::environment::Cells;
use crate::light::{Light, LightSample};
use crate::math::Vec3;
use crate::scene::Scene;

/// Share of the light samples that goes by power, whatever was learned: lights that no sample found may be
/// visible.
const DEFENSIVE_SHARE: f64 = 0.1;

/// The strata of all lights: each light is one, but the environment map, which comes last, is many.
#[derive(Debug)]
pub(crate) struct LightStrata<'a> {
    scene: &'a Scene,
    /// Probability of each stratum by its power.
    by_power: Vec<f64>,
    cells: Option<Cells<'a>>,
}

impl<'a> LightStrata<'a> {
    pub(crate) fn new(scene: &'a Scene) -> Self {
        let cells = scene.map().map(Cells::new);
        let mut by_power: Vec<f64> = scene.lights.all.iter().map(|l| f64::from(l.power_pmf)).collect();
        if let Some(cells) = &cells {
            let map = by_power.pop().unwrap_or(0.0);
            by_power.extend(cells.pmf.iter().map(|c| f64::from(*c) * map));
        }
        Self { scene, by_power, cells }
    }

    pub(crate) fn len(&self) -> usize {
        self.by_power.len()
    }

    /// The first stratum of the environment map.
    fn first_cell(&self) -> usize {
        self.by_power.len() - self.cells.as_ref().map_or(0, |c| c.pmf.len())
    }

    /// The stratum infinitely far away in direction `dir`: of the map, or the sun, which is then the last
    /// light.
    pub(crate) fn far(&self, dir: Vec3) -> usize {
        match &self.cells {
            Some(cells) => self.first_cell() + cells.cell(dir),
            None => self.len() - 1,
        }
    }
}

/// The light that samples found from each stratum.
#[derive(Debug)]
pub(crate) struct Contributions(Vec<f64>);

impl Contributions {
    pub(crate) fn new(strata: &LightStrata<'_>) -> Self {
        Self(vec![0.0; strata.len()])
    }

    /// Adds the light that a sample found from a stratum.
    pub(crate) fn note(&mut self, stratum: usize, light: Vec3) {
        self.0[stratum] += f64::from(crate::math::luminance(light));
    }
}

/// Chooses strata with probabilities.
#[derive(Debug)]
pub(crate) struct Guide<'a> {
    pub(crate) strata: &'a LightStrata<'a>,
    sums: Vec<f64>,
}

/// A light sample chosen by a guide.
pub(crate) struct GuidedSample<'a> {
    pub(crate) light: &'a Light,
    /// Its density is that among all lights.
    pub(crate) sample: LightSample,
    pub(crate) stratum: usize,
}

impl<'a> Guide<'a> {
    pub(crate) fn by_power(strata: &'a LightStrata<'a>) -> Self {
        Self::new(strata, strata.by_power.iter().copied())
    }

    /// In proportion to the light found from each stratum, with [`DEFENSIVE_SHARE`] by power.
    pub(crate) fn learned(strata: &'a LightStrata<'a>, found: &Contributions) -> Self {
        let total: f64 = found.0.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return Self::by_power(strata);
        }
        let probability =
            |(found, power): (&f64, &f64)| (1.0 - DEFENSIVE_SHARE) * found / total + DEFENSIVE_SHARE * power;
        Self::new(strata, found.0.iter().zip(&strata.by_power).map(probability))
    }

    fn new(strata: &'a LightStrata<'a>, probabilities: impl Iterator<Item = f64>) -> Self {
        let sums = probabilities.scan(0.0, |sum, probability| {
            *sum += probability;
            Some(*sum)
        });
        Self { strata, sums: sums.collect() }
    }

    /// A light sample as seen from `from`, by numbers uniform in the unit square.
    pub(crate) fn sample(&self, from: Vec3, [u, v]: [f32; 2]) -> Option<GuidedSample<'a>> {
        let target = f64::from(u) * self.sums.last()?;
        let stratum = self.sums.partition_point(|sum| *sum <= target);
        let pmf = self.pmf(stratum)?;
        let below = if stratum > 0 { self.sums[stratum - 1] } else { 0.0 };
        let rest = (((target - below) / f64::from(pmf)) as f32).clamp(0.0, 1.0 - f32::EPSILON);
        let LightStrata { scene, cells, .. } = self.strata;
        let (light, sample) = match (cells, stratum.checked_sub(self.strata.first_cell())) {
            (Some(cells), Some(cell)) => {
                let (dir, pdf) = cells.sample(cell, [rest, v])?;
                (scene.lights.all.last()?, LightSample::far(dir, pdf))
            }
            _ => {
                let light = &scene.lights.all[stratum];
                (light, scene.sample_light(light, from, [rest, v, 0.0])?)
            }
        };
        let sample = LightSample { value: sample.value / pmf, pdf: sample.pdf * pmf, ..sample };
        Some(GuidedSample { light, sample, stratum })
    }

    /// Probability of a stratum; none if it is never chosen.
    fn pmf(&self, stratum: usize) -> Option<f32> {
        let below = if stratum > 0 { self.sums[stratum - 1] } else { 0.0 };
        Some((self.sums.get(stratum)? - below) as f32).filter(|pmf| *pmf > 0.0)
    }

    /// Density of [`Guide::sample`] at a point of a stratum, where the light's own samples have density
    /// `own`.
    pub(crate) fn density(&self, stratum: usize, own: f32) -> f32 {
        let Some(pmf) = self.pmf(stratum) else { return 0.0 };
        match (&self.strata.cells, stratum.checked_sub(self.strata.first_cell())) {
            (Some(cells), Some(cell)) if cells.pmf[cell] > 0.0 => own * (pmf / cells.pmf[cell]),
            (Some(_), Some(_)) => 0.0,
            _ => own * pmf,
        }
    }
}
