//! Which lights a part of the picture sees, learned from samples, for the ray-traced reference.

use crate::environment::Cells;
use crate::light::{Aim, Light};
use crate::math::Vec3;
use crate::scene::Scene;

/// Share of the points that goes by power, whatever was learned: lights that no sample found may still be seen.
const DEFENCE: f64 = 0.1;

/// What there is to choose among: each light is one part, but the environment map, if there is one, is many. They come last.
#[derive(Debug)]
pub(crate) struct Parts<'a> {
    scene: &'a Scene,
    /// Chance of each part by its power.
    powers: Vec<f64>,
    cells: Option<Cells<'a>>,
}

impl<'a> Parts<'a> {
    pub(crate) fn new(scene: &'a Scene) -> Self {
        let cells = scene.map().map(Cells::new);
        let mut powers: Vec<f64> = scene.lights.all.iter().map(|l| f64::from(l.chance)).collect();
        if let Some(cells) = &cells {
            let map = powers.pop().unwrap_or(0.0);
            powers.extend(cells.chances.iter().map(|c| f64::from(*c) * map));
        }
        Self { scene, powers, cells }
    }

    pub(crate) fn len(&self) -> usize {
        self.powers.len()
    }

    /// The first part that is one of the map's.
    fn first_cell(&self) -> usize {
        self.powers.len() - self.cells.as_ref().map_or(0, |c| c.chances.len())
    }

    /// The part that is seen far away in direction `dir`: of the map, or the sun, which is then the last light.
    pub(crate) fn far(&self, dir: Vec3) -> usize {
        match &self.cells {
            Some(cells) => self.first_cell() + cells.cell(dir),
            None => self.len() - 1,
        }
    }
}

/// The light that samples found to come from each part.
#[derive(Debug)]
pub(crate) struct Found(Vec<f64>);

impl Found {
    pub(crate) fn new(parts: &Parts<'_>) -> Self {
        Self(vec![0.0; parts.len()])
    }

    /// Notes what a sample says of the light from a part.
    pub(crate) fn note(&mut self, part: usize, light: Vec3) {
        self.0[part] += f64::from(crate::math::luminance(light));
    }
}

/// Chances of all parts.
#[derive(Debug)]
pub(crate) struct Guide<'a> {
    pub(crate) parts: &'a Parts<'a>,
    /// Sums of the chances up to and with each.
    sums: Vec<f64>,
}

/// A point on a light, chosen by a guide.
pub(crate) struct Choice<'a> {
    pub(crate) light: &'a Light,
    /// Its density is that among all points of all lights.
    pub(crate) aim: Aim,
    pub(crate) part: usize,
}

impl<'a> Guide<'a> {
    /// By power alone.
    pub(crate) fn by_power(parts: &'a Parts<'a>) -> Self {
        Self::new(parts, parts.powers.iter().copied())
    }

    /// In proportion to the light that came from each part, but for a share that goes by power.
    pub(crate) fn learned(parts: &'a Parts<'a>, found: &Found) -> Self {
        let total: f64 = found.0.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return Self::by_power(parts);
        }
        let chance = |(found, power): (&f64, &f64)| (1.0 - DEFENCE) * found / total + DEFENCE * power;
        Self::new(parts, found.0.iter().zip(&parts.powers).map(chance))
    }

    fn new(parts: &'a Parts<'a>, chances: impl Iterator<Item = f64>) -> Self {
        let sums = chances.scan(0.0, |sum, chance| {
            *sum += chance;
            Some(*sum)
        });
        Self { parts, sums: sums.collect() }
    }

    /// A point on a light as seen from `from`, for numbers uniform in the unit square.
    pub(crate) fn aim(&self, from: Vec3, [u, v]: [f32; 2]) -> Option<Choice<'a>> {
        let target = f64::from(u) * self.sums.last()?;
        let part = self.sums.partition_point(|sum| *sum <= target);
        let chance = self.chance(part)?;
        let below = if part > 0 { self.sums[part - 1] } else { 0.0 };
        let rest = (((target - below) / f64::from(chance)) as f32).clamp(0.0, 1.0 - f32::EPSILON);
        let Parts { scene, cells, .. } = self.parts;
        let (light, aim) = match (cells, part.checked_sub(self.parts.first_cell())) {
            (Some(cells), Some(cell)) => {
                let (dir, pdf) = cells.sample(cell, [rest, v])?;
                (scene.lights.all.last()?, Aim::far(dir, pdf))
            }
            _ => {
                let light = &scene.lights.all[part];
                (light, scene.aim::<true>(light, from, [rest, v, 0.0])?)
            }
        };
        let aim = Aim { value: aim.value / chance, pdf: aim.pdf * chance, ..aim };
        Some(Choice { light, aim, part })
    }

    /// Chance of a part; none if it is never chosen.
    fn chance(&self, part: usize) -> Option<f32> {
        let below = if part > 0 { self.sums[part - 1] } else { 0.0 };
        Some((self.sums.get(part)? - below) as f32).filter(|chance| *chance > 0.0)
    }

    /// Density of [`Guide::aim`] at a point of a part. `own` is that of the part's light there, by the light's own choice.
    pub(crate) fn density(&self, part: usize, own: f32) -> f32 {
        let Some(chance) = self.chance(part) else { return 0.0 };
        match (&self.parts.cells, part.checked_sub(self.parts.first_cell())) {
            (Some(cells), Some(cell)) if cells.chances[cell] > 0.0 => own * (chance / cells.chances[cell]),
            (Some(_), Some(_)) => 0.0,
            _ => own * chance,
        }
    }
}
