//! ColorVideoVDP against the converged picture: a yardstick, not a criterion that a render could have.

use crate::metrics::cvvdp_of_tiles;
use crate::pixels::{displayed, verdict};
use noisefloor::{
    StoppingCriterion, Tile, Verdict,
    criterion::{CriterionError, Needs, View},
};
use noisefloor_vision::VisionModel;

/// Default of [`ConvergedCvvdp::lost`]: agrees with people on average.
pub(crate) const DEFAULT_LOST: f64 = 0.3;

/// A tile is done when ColorVideoVDP (Mantiuk et al. 2024) finds that it has lost at most so many
/// just-objectionable differences (JOD) against the converged picture, which takes the place of
/// [`View::reference`]. Each tile is compared as a picture of its own, by
/// [`cvvdp_of_tiles`](crate::metrics::cvvdp_of_tiles).
///
/// The probability of a verdict is one minus the JODs lost, or 0: it tells by what limit the tile would be done.
///
/// For comparison only: whoever has the converged picture need not render. It tells what a published vision
/// model makes of noise if it is given what no criterion has.
#[derive(Clone, Debug)]
pub struct ConvergedCvvdp {
    /// Most JODs that a tile may have lost, above 0: it is done at a quality of at least 10 − `lost`.
    pub lost: f64,
    /// Of the viewing conditions of the last look.
    model: Option<VisionModel>,
}

impl ConvergedCvvdp {
    /// The criterion with this constant. Viewing conditions are those of the session.
    pub fn new(lost: f64) -> Self {
        Self { lost, model: None }
    }
}

impl StoppingCriterion for ConvergedCvvdp {
    fn name(&self) -> String {
        format!("ColorVideoVDP against the converged picture, {} JOD", self.lost)
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn needs(&self) -> Needs {
        Needs::REFERENCE
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let converged = view.reference.ok_or_else(|| CriterionError::NoReference(self.name()))?;
        let (shown, grid) = (displayed(view), view.film.grid());
        // Films and references are finite and of one size; what could not be compared would stay open
        let model = match self.model.take() {
            Some(model) if *model.viewing() == view.viewing => model,
            _ => VisionModel::new(&view.viewing),
        };
        let jods = cvvdp_of_tiles(converged, &shown, grid, tiles, self.model.insert(model));
        let jods = jods.unwrap_or_else(|_| vec![0.0; tiles.len()]);
        let judge = |jod: f64| {
            let lost = 10.0 - jod;
            verdict(lost <= self.lost, None).with_probability((1.0 - lost).max(0.0) as f32)
        };
        Ok(jods.into_iter().map(judge).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{constant, empty, expose};
    use noisefloor::{Film, Viewing, display::Display};
    use noisefloor_testkit::Noise;

    fn judge_on(viewing: &str, film: &Film, lost: f64) -> Result<Vec<Verdict>, CriterionError> {
        let grey = vec![Display::SRGB.encode([0.2; 3]); 64 * 64];
        let tiles: Vec<Tile> = film.grid().tiles().collect();
        let viewing: Viewing = viewing.parse().unwrap();
        let view = View::new(film, &Display::SRGB).seen_on(viewing).beside(&grey);
        ConvergedCvvdp::new(lost).judge(&view, &tiles)
    }

    fn judge(film: &Film, lost: f64) -> Result<Vec<Verdict>, CriterionError> {
        judge_on("desk", film, lost)
    }

    /// The same noise is seen on a desk, and not from four times as far.
    #[test]
    fn it_sits_where_the_session_says() {
        let (mut noisy, mut noise) = (empty(), Noise::new(4));
        expose(&mut noisy, 100, 0.2, 0.05, &mut noise);
        // About 0.3 JOD are lost on the desk, and 0.02 from there
        let done = |viewing: &str| judge_on(viewing, &noisy, 0.1).unwrap().iter().all(|v| v.converged);
        assert!(!done("desk") && done("desk,distance=2.4"));
    }

    #[test]
    fn the_converged_picture_is_done_and_a_noisy_one_is_not() {
        assert!(judge(&constant(0.2, 100), 1e-3).unwrap().iter().all(|v| v.converged));
        let (mut noisy, mut noise) = (empty(), Noise::new(4));
        expose(&mut noisy, 100, 0.2, 0.5, &mut noise);
        assert!(judge(&noisy, 0.1).unwrap().iter().all(|v| !v.converged));
        // Nothing is worse than 10 JOD
        assert!(judge(&noisy, 10.0).unwrap().iter().all(|v| v.converged));
    }

    /// What differs in colour alone, at the same luminance, differs all the same.
    #[test]
    fn colour_counts() {
        let mut film = empty();
        for tile in film.grid().tiles() {
            // Rec.709 luminance 0.2, as the grey
            film.add(tile.index, 10, &vec![[0.45, 0.146_7, 0.011_4]; tile.pixels()]).unwrap();
        }
        assert!(judge(&film, 0.5).unwrap().iter().all(|v| !v.converged));
    }

    #[test]
    fn without_a_converged_picture_it_says_so() {
        let film = constant(0.2, 100);
        let tiles: Vec<Tile> = film.grid().tiles().collect();
        let outcome = ConvergedCvvdp::new(0.1).judge(&crate::testing::view(&film), &tiles);
        assert!(matches!(outcome, Err(CriterionError::NoReference(_))));
    }
}
