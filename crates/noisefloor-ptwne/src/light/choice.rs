//! Choosing one of many lights.

use super::emitter::Light;
use crate::alias::AliasTable;
use crate::math::Vec3;

/// All lights of a scene, chosen with probability proportional to power.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    pub(crate) all: Vec<Light>,
    table: AliasTable,
}

impl Lights {
    /// The lights of a scene whose bounding box has these corners; `textures` are the means of its emission
    /// textures. Lights that cannot matter, which are black or face away from the whole scene, are never
    /// chosen.
    pub(crate) fn new(mut all: Vec<Light>, [low, high]: [Vec3; 2], textures: &[Vec3]) -> Self {
        let extent = 0.5 * (high - low).length();
        let power = |l: &Light| {
            let texture = textures.get(l.texture as usize).copied().unwrap_or(Vec3::ONE);
            if l.reaches(low, high) { f64::from(l.power(extent, texture)) } else { 0.0 }
        };
        let powers: Vec<f64> = all.iter().map(power).collect();
        let total: f64 = powers.iter().sum();
        for (light, power) in all.iter_mut().zip(&powers) {
            light.pmf = if total > 0.0 { (power / total) as f32 } else { 0.0 };
        }
        Self { table: AliasTable::new(&powers), all }
    }

    /// Chooses a light by two numbers uniform in [0, 1), as in [`AliasTable::choose`]; none if none shines.
    #[inline]
    pub(crate) fn choose(&self, u: f32, more: f32) -> Option<&Light> {
        let light = match self.all.as_slice() {
            [] => return None,
            [only] => only,
            all => &all[self.table.choose(u, more).0],
        };
        (light.pmf > 0.0).then_some(light)
    }
}
