//! The halt criterion of LuxCoreRender.

use crate::pixels::{displayed, enough, verdict};
use noisefloor::{
    Rgb, StoppingCriterion, Tile, TileGrid, Verdict,
    criterion::{CriterionError, View},
};

pub(crate) const DEFAULT_SHARE: f64 = 0.31;
/// Default of [`LuxCoreHalt::threshold`]: one step of an 8-bit screen.
const DEFAULT_THRESHOLD: f32 = 1.0 / 256.0;
/// Default of [`LuxCoreHalt::step`] and [`LuxCoreHalt::warmup`] (`batch.haltthreshold.step` and `.warmup` of
/// LuxCoreRender).
const DEFAULT_STEP: f64 = 64.0;

/// The convergence test of LuxCoreRender 2 (`film/convtest/filmconvtest.cpp`).
///
/// The displayed picture is compared with that of the previous test. A pixel has changed if one of its
/// channels has changed by more than `threshold`. The render is done when at most a `share` of all pixels has
/// changed. Tests begin after `warmup` samples per pixel and are `step` apart, both on average over the
/// image.
///
/// It halts the whole picture, as LuxCoreRender does: all tiles are done at once. LuxCoreRender leaves the
/// share to the user.
#[derive(Clone, Debug)]
pub struct LuxCoreHalt {
    /// Largest share of the pixels that may have changed, in [0, 1]. The default of 0.31 agrees with people
    /// on average (`noisefloor-lab evaluate --rivals`).
    pub share: f64,
    /// Samples per pixel between two tests, above 0; 64 by default.
    pub step: f64,
    /// Samples per pixel before the first test, at least 0; 64 by default.
    pub warmup: f64,
    /// Change of a displayed channel above which it counts, at least 0; 1/256 by default, one step of an
    /// 8-bit screen.
    pub threshold: f32,
    /// Picture and samples per pixel at the last test.
    last: Option<(Vec<Rgb>, f64)>,
    halted: bool,
}

impl LuxCoreHalt {
    /// The criterion with this constant, and LuxCoreRender's defaults for the rest.
    pub fn new(share: f64) -> Self {
        Self {
            share,
            step: DEFAULT_STEP,
            warmup: DEFAULT_STEP,
            threshold: DEFAULT_THRESHOLD,
            last: None,
            halted: false,
        }
    }
}

impl StoppingCriterion for LuxCoreHalt {
    fn name(&self) -> String {
        format!("LuxCore, {} of the pixels", self.share)
    }

    fn fingerprint(&self) -> String {
        let Self { step, warmup, threshold, .. } = self;
        format!("{}, step {step}, warmup {warmup}, threshold {threshold}", self.name())
    }

    fn begin(&mut self, _: TileGrid) {
        (self.last, self.halted) = (None, false);
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let grid = view.film.grid();
        let pixels = grid.width() * grid.height();
        let samples = view.film.total_samples() as f64 / pixels as f64;
        let due = self.last.as_ref().is_none_or(|(_, last)| samples - last >= self.step);
        if !self.halted && samples > self.warmup && due {
            let now = displayed(view);
            if let Some((before, _)) = &self.last {
                let same = |(a, b): &(&Rgb, &Rgb)| (0..3).all(|c| (a[c] - b[c]).abs() <= self.threshold);
                let unchanged = now.iter().zip(before).filter(same).count();
                self.halted = enough(unchanged, pixels, 1.0 - self.share);
            }
            self.last = Some((now, samples));
        }
        Ok(vec![verdict(self.halted, None); tiles.len()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{empty, expose, view};
    use noisefloor::{Film, display::Display};
    use noisefloor_testkit::Noise;
    use statrs::distribution::{ContinuousCDF, Normal};

    fn judge(halt: &mut LuxCoreHalt, film: &Film) -> bool {
        let tiles: Vec<Tile> = film.grid().tiles().collect();
        let verdicts = halt.judge(&view(film), &tiles).unwrap();
        assert!(verdicts.iter().all(|v| *v == verdicts[0]));
        verdicts[0].converged
    }

    /// Share of the pixels that change between tests at 100 and 200 samples of grey noise: I₁₀₀ − I₂₀₀ has a
    /// variance of σ²·(1/100 − 1/200), and the screen a slope there.
    #[test]
    fn as_many_pixels_change_as_mathematics_says() {
        let (mean, sigma) = (0.3f64, 0.05);
        let slope = f64::from(Display::SRGB.luma([0.301; 3]) - Display::SRGB.luma([0.299; 3])) / 0.002;
        let deviation = slope * sigma * (1.0f64 / 100.0 - 1.0 / 200.0).sqrt();
        let share = 2.0 * Normal::standard().cdf(-1.0 / 256.0 / deviation);
        // Of 4096 pixels; four deviations to either side.
        let margin = 4.0 * (share * (1.0 - share) / 4096.0).sqrt();
        assert!(share - margin > 0.01);
        for (limit, halts) in [(share - margin, false), (share + margin, true)] {
            let (mut film, mut noise, mut halt) = (empty(), Noise::new(9), LuxCoreHalt::new(limit));
            for expected in [false, halts, halts] {
                expose(&mut film, 50, mean, sigma, &mut noise);
                expose(&mut film, 50, mean, sigma, &mut noise);
                if film.spp(0) < 300 {
                    assert_eq!(judge(&mut halt, &film), expected, "{} {limit}", film.spp(0));
                }
            }
        }
    }

    #[test]
    fn tests_begin_late_and_keep_their_distance() {
        let (mut film, mut noise, mut halt) = (empty(), Noise::new(1), LuxCoreHalt::new(1.0));
        let mut first = 0;
        while first == 0 {
            expose(&mut film, 16, 0.5, 0.1, &mut noise);
            if judge(&mut halt, &film) {
                first = film.spp(0);
            }
        }
        // The first test comes after more than 64 samples, at 80; the second, which halts if everything may
        // change, 64 later.
        assert_eq!(first, 144);
    }
}
