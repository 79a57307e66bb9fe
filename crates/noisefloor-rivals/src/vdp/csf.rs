//! Viewing conditions and contrast sensitivity.

/// P: sensitivity at the peak, about.
const PEAK: f64 = 250.0;
/// ε: scale of frequency.
const EPSILON: f64 = 0.9;
/// ob: resolution along the diagonals, relative to that along the axes.
const OBLIQUE: f64 = 0.78;

/// The viewing condition of [`Vdp`](crate::Vdp).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VdpViewing {
    /// Distance of the eye from the screen, in metres.
    pub(super) distance: f64,
    /// Pixels of the screen per inch, above 0.
    pub(super) dpi: f64,
    /// Luminance of white, in cd/m², above 0; black is 0.
    pub(super) peak: f64,
    /// Luminance to which the eye is adapted, in cd/m², above 0. A constant of the condition rather than of
    /// the picture, so that all stages of a rendering are seen alike.
    pub(super) adaptation: f64,
}

impl Default for VdpViewing {
    /// An office: 0.6 m from a screen of 96 dpi (40 pixels per degree) with a white of 100 cd/m², adapted to
    /// a middle grey of 18 %.
    fn default() -> Self {
        Self { distance: 0.6, dpi: 96.0, peak: 100.0, adaptation: 18.0 }
    }
}

impl VdpViewing {
    /// Pixels of the screen per degree of the visual field.
    pub(super) fn pixels_per_degree(&self) -> f64 {
        self.distance * 1f64.to_radians().tan() * self.dpi / 0.0254
    }

    /// Contrast sensitivity, the inverse of the threshold contrast of a grating: of `frequency` cycles per
    /// degree, above 0, at `angle` radians from the horizontal, on a picture of `area` square degrees, above
    /// 0 (Daly 1993).
    ///
    /// S = P·min(S₁(ρ/(r_a·r_θ)), S₁(ρ)) with r_a = 0.856·d^0.14 for the accommodation to distance d and r_θ
    /// = ((1 − ob)·cos 4θ + 1 + ob)/2 for the oblique effect, ob = 0.78; eccentricity is 0, as if the eye
    /// looked everywhere. S₁(ρ) = ((3.23·(ρ²i²)^−0.3)⁵ + 1)^−⅕ · A·ερ·e^−Bερ·√(1 + 0.06·e^Bερ), A = 0.801·(1
    /// + 0.7/l)^−0.2, B = 0.3·(1 + 100/l)^0.15, i² the area, l the adaptation luminance, ε = 0.9, P = 250.
    pub(super) fn sensitivity(&self, frequency: f64, angle: f64, area: f64) -> f64 {
        let l = self.adaptation;
        let (a, b) = (0.801 * (1.0 + 0.7 / l).powf(-0.2), 0.3 * (1.0 + 100.0 / l).powf(0.15));
        let s1 = |rho: f64| {
            let size = ((3.23 * (rho * rho * area).powf(-0.3)).powi(5) + 1.0).powf(-0.2);
            let x = EPSILON * rho;
            size * a * x * (-b * x).exp() * (1.0 + 0.06 * (b * x).exp()).sqrt()
        };
        let accommodation = 0.856 * self.distance.powf(0.14);
        let oblique = 0.5 * ((1.0 - OBLIQUE) * (4.0 * angle).cos() + 1.0 + OBLIQUE);
        let s = PEAK * s1(frequency / (accommodation * oblique)).min(s1(frequency));
        if s.is_finite() { s } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapted(l: f64) -> VdpViewing {
        VdpViewing { adaptation: l, ..VdpViewing::default() }
    }

    /// Peak frequency, peak sensitivity and cut-off, where the sensitivity is 1, by a fine search.
    fn shape(viewing: VdpViewing) -> (f64, f64, f64) {
        let at = |f: f64| viewing.sensitivity(f, 0.0, 100.0);
        let scan: Vec<f64> = (1..=10_000).map(|i| f64::from(i) * 0.01).collect();
        let peak = scan.iter().copied().max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap();
        let cut = scan.iter().copied().filter(|&f| at(f) > 1.0).fold(0.0, f64::max);
        (peak, at(peak), cut)
    }

    #[test]
    fn peak_and_cut_off_are_those_of_people() {
        // At photopic levels people see gratings of 2…5 cycles per degree best, at contrasts of about 0.5 %,
        // and none of more than 40…60 (Campbell & Robson 1968; van Nes & Bouman 1967). In the dark all of
        // that falls.
        let (peak, height, cut) = shape(adapted(100.0));
        assert!((2.0..5.0).contains(&peak) && (150.0..300.0).contains(&height), "{peak} {height}");
        assert!((35.0..60.0).contains(&cut), "{cut}");
        let (dark_peak, dark_height, dark_cut) = shape(adapted(0.1));
        assert!(
            dark_peak < peak && dark_height < 0.6 * height && dark_cut < 0.7 * cut,
            "{dark_peak} {dark_height} {dark_cut}"
        );
    }

    #[test]
    fn diagonals_are_seen_worse_and_small_pictures_too() {
        let viewing = adapted(100.0);
        let diagonal = std::f64::consts::FRAC_PI_4;
        assert!(viewing.sensitivity(16.0, diagonal, 100.0) < 0.7 * viewing.sensitivity(16.0, 0.0, 100.0));
        assert!(viewing.sensitivity(1.0, 0.0, 0.1) < 0.6 * viewing.sensitivity(1.0, 0.0, 100.0));
        assert_eq!(viewing.sensitivity(0.0, 0.0, 100.0), 0.0);
    }

    #[test]
    fn a_worked_example() {
        // In double precision elsewhere, for l = 100, ρ = 4, i² = 100, θ = 0, d = 0.6: r_a = 0.79692, ρ/r_a =
        // 5.01932, A = 0.79988, B = 0.33287, S₁(4) = 0.95019, S₁(5.01932) = 0.90470.
        let s = adapted(100.0).sensitivity(4.0, 0.0, 100.0);
        assert!((s - 250.0 * 0.904_703).abs() < 0.001, "{s}");
    }

    #[test]
    fn degrees_have_pixels() {
        assert!((VdpViewing::default().pixels_per_degree() - 39.58).abs() < 0.01);
    }
}
