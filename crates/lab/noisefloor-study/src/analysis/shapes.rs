//! Shapes of the spread of observers: Tukey's g distributions over a normal or a logistic base.
//!
//! A threshold is x = m + S·T(z) in ln(spp), where m is the median, S the distance between the quartiles, and
//! T(z) = (e^{gz} − 1)/g, scaled to quartiles one apart, of a standard variable z (Hoaglin 1985, "Summarizing
//! shape numerically: the g-and-h distributions"). g = 0 is the base itself; a normal base with g > 0 is the
//! lognormal.

use statrs::distribution::{ContinuousCDF, Normal};
use std::sync::LazyLock;

/// Skewness parameters, with their prior weights.
const SKEWS: [(f64, f64); 7] =
    [(-0.5, 0.5), (-0.25, 1.0), (0.0, 1.5), (0.25, 1.5), (0.5, 1.5), (0.75, 1.0), (1.0, 0.5)];
/// The table reaches this far on both sides of the median, in distances between the quartiles.
const REACH: f64 = 12.0;
const STEPS_PER_UNIT: f64 = 200.0;

#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// Logarithm of the prior weight.
    pub(super) ln_prior: f64,
    /// From the median to the 95 % quantile, in distances between the quartiles.
    pub(super) to_level95: f64,
    /// Share below m + S·u, at equal steps of u.
    share: Vec<f32>,
}

pub(super) static SHAPES: LazyLock<Vec<Shape>> = LazyLock::new(|| {
    let bases = [Base::Normal, Base::Logistic];
    bases.into_iter().flat_map(|base| SKEWS.map(|(g, weight)| Shape::new(base, g, weight))).collect()
});

#[derive(Clone, Copy)]
enum Base {
    Normal,
    Logistic,
}

impl Base {
    fn quantile(self, share: f64) -> f64 {
        match self {
            Self::Normal => Normal::standard().inverse_cdf(share),
            Self::Logistic => (share / (1.0 - share)).ln(),
        }
    }

    fn share(self, z: f64) -> f64 {
        match self {
            Self::Normal => Normal::standard().cdf(z),
            Self::Logistic => 1.0 / (1.0 + (-z).exp()),
        }
    }
}

impl Shape {
    fn new(base: Base, g: f64, weight: f64) -> Self {
        // A logistic variable is π/√3 as wide as a normal one: the same g would skew it more
        let unit = base.quantile(0.75) / Base::Normal.quantile(0.75);
        let g = g / unit;
        let skewed = |z: f64| if g == 0.0 { z } else { (g * z).exp_m1() / g };
        let quartiles = skewed(base.quantile(0.75)) - skewed(base.quantile(0.25));
        let share = |u: f64| {
            let y = u * quartiles;
            if g == 0.0 {
                return base.share(y);
            }
            match 1.0 + g * y {
                inside if inside > 0.0 => base.share(inside.ln() / g),
                _ if g > 0.0 => 0.0,
                _ => 1.0,
            }
        };
        let steps = (2.0 * REACH * STEPS_PER_UNIT) as usize;
        Self {
            ln_prior: weight.ln(),
            to_level95: skewed(base.quantile(0.95)) / quartiles,
            share: (0..=steps).map(|i| share(i as f64 / STEPS_PER_UNIT - REACH) as f32).collect(),
        }
    }

    /// Share of observers below `u` distances between the quartiles above the median.
    pub(super) fn share(&self, u: f64) -> f64 {
        let place = ((u + REACH) * STEPS_PER_UNIT).clamp(0.0, (self.share.len() - 1) as f64);
        let (at, part) = (place as usize, place.fract());
        let next = (at + 1).min(self.share.len() - 1);
        f64::from(self.share[at]) * (1.0 - part) + f64::from(self.share[next]) * part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quartiles lie one apart around the median, and the 95 % quantile where it says; known values of the
    /// normal (1.645/1.349), the logistic (ln 19/(2 ln 3)) and the lognormal with σ = ½.
    #[test]
    fn quantiles_are_where_they_should_be() {
        for shape in SHAPES.iter() {
            assert!((shape.share(0.0) - 0.5).abs() < 1e-4);
            assert!((shape.share(shape.to_level95) - 0.95).abs() < 1e-3, "{}", shape.to_level95);
        }
        let near = |shape: usize, value: f64| (SHAPES[shape].to_level95 - value).abs() < 1e-3;
        assert!(near(2, 1.6449 / 1.349) && near(9, 19f64.ln() / (2.0 * 3f64.ln())));
        let lognormal = ((0.5f64 * 1.6449).exp() - 1.0) / (2.0 * (0.5f64 * 0.67449).sinh());
        assert!(near(4, lognormal), "{} {lognormal}", SHAPES[4].to_level95);
    }
}
