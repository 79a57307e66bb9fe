//! Criteria by visible differences between stages of one rendering.

use crate::picture::DisplayPixels;
use crate::pixels::{displayed, verdict};
use crate::vdp::{Response, Vdp};
use noisefloor::{
    Film, StoppingCriterion, Tile, TileGrid, Verdict,
    criterion::{CriterionError, View},
};

/// Default of [`Myszkowski1998::probability`]: agrees with people on average.
pub(crate) const DEFAULT_SEEN: f64 = 0.94;
/// Default of [`Takouachet2007::probability`]: agrees with people on average.
pub(crate) const DEFAULT_GROWTH: f64 = 0.74;
/// Default share of a tile's pixels that may differ.
const DEFAULT_SHARE: f64 = 0.01;
/// Ratio of samples between stages that are kept.
const SPACING: f64 = 1.1;

/// Earlier stages of a rendering, spaced by samples.
#[derive(Clone, Debug)]
struct Stages<T> {
    /// Samples per pixel, and the stage.
    kept: Vec<(u64, T)>,
}

impl<T> Stages<T> {
    fn new() -> Self {
        Self { kept: Vec::new() }
    }

    /// The latest stage with at most half of `samples`.
    fn half_way(&self, samples: u64) -> Option<&T> {
        self.kept.iter().rev().find(|(n, _)| 2 * n <= samples).map(|(_, stage)| stage)
    }

    /// Keeps a stage if it is late enough, and drops those no longer needed.
    fn keep(&mut self, samples: u64, stage: T) {
        if self.kept.last().is_none_or(|(n, _)| samples as f64 >= SPACING * *n as f64) {
            self.kept.push((samples, stage));
        }
        let needed = self.kept.iter().rposition(|(n, _)| 2 * n <= samples).unwrap_or(0);
        self.kept.drain(..needed);
    }
}

/// The stage of the computation: the largest number of samples per pixel of any tile.
fn stage_of(film: &Film) -> u64 {
    film.grid().tiles().map(|t| film.spp(t.index)).max().unwrap_or(0)
}

/// The response of the eye to the displayed picture.
fn response(vdp: &Vdp, view: &View<'_>) -> Response {
    let (grid, pixels) = (view.film.grid(), displayed(view));
    let image = DisplayPixels::new(grid.width(), grid.height(), &pixels).expect("a film's size is in range");
    vdp.respond(&image)
}

/// A tile is done if at most a share of its pixels lies above a limit; no tile is if there is no map. The
/// probability of a verdict is one minus the smallest limit at which the tile would be done.
fn verdicts(map: Option<&[f32]>, width: usize, tiles: &[Tile], limit: f64, share: f64) -> Vec<Verdict> {
    let judge = |tile: &Tile| {
        let Some(map) = map else { return verdict(false, None) };
        let mut values: Vec<f32> = tile.rows(width).flat_map(|row| &map[row]).copied().collect();
        let within = ((1.0 - share) * values.len() as f64).ceil() as usize;
        let place = within.clamp(1, values.len()) - 1;
        let (_, &mut least, _) = values.select_nth_unstable_by(place, f32::total_cmp);
        verdict(f64::from(least) <= limit, None).with_probability(1.0 - least)
    };
    tiles.iter().map(judge).collect()
}

/// Visible differences between successive stages, after Myszkowski 1998, "The Visible Differences Predictor:
/// applications to global illumination problems".
///
/// A tile is done when at most a `share` of its pixels differs visibly from the stage with half of the
/// samples, or slightly fewer: with more than `probability`, by [`Vdp`]. A stage is kept every 10 % of
/// samples. The paper leaves the choice of stages to the rendering algorithm. Here, half of the samples make
/// the difference as large as the remaining noise: with independent samples, Var(Iₙ − I₂ₙ) = σ²/2n =
/// Var(I₂ₙ).
///
/// The paper judges the whole picture. Here each call compares the whole picture once, and each tile takes
/// its verdict from the map. Memory: 4 bytes per pixel for each of up to ten stages.
#[derive(Clone, Debug)]
pub struct Myszkowski1998 {
    /// Probability of detection above which a pixel differs visibly, in (0, 1). The default of 0.94
    /// agrees with people on average, on synthesised renderings.
    pub probability: f64,
    /// Share of a tile's pixels that may do so, in [0, 1]; 0.01 by default.
    pub share: f64,
    vdp: Vdp,
    stages: Stages<Response>,
}

impl Myszkowski1998 {
    /// The criterion with this constant, 1 % of a tile's pixels, and the default viewing condition.
    pub fn new(probability: f64) -> Self {
        Self { probability, share: DEFAULT_SHARE, vdp: Vdp::default(), stages: Stages::new() }
    }
}

impl StoppingCriterion for Myszkowski1998 {
    fn name(&self) -> String {
        format!("Myszkowski 1998, P {}", self.probability)
    }

    fn fingerprint(&self) -> String {
        format!("{}, share {}, {:?}", self.name(), self.share, self.vdp)
    }

    fn begin(&mut self, _: TileGrid) {
        self.stages.kept.clear();
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let samples = stage_of(view.film);
        let now = response(&self.vdp, view);
        let map = self.stages.half_way(samples).map(|before| self.vdp.detect(before, &now));
        self.stages.keep(samples, now);
        Ok(verdicts(map.as_deref(), view.film.grid().width(), tiles, self.probability, self.share))
    }
}

/// Visible differences from the first, noisy picture, after Takouachet, Delepoulle, Renaud 2007, "A
/// perceptual stopping condition for global illumination computations".
///
/// The predictor compares the first judged picture with the current one (Takouachet et al. 2017, §2). As
/// noise decreases, it masks their difference less and less, and they differ more and more visibly, until the
/// noise is gone. A tile is done when at most a `share` of its pixels has a probability of detection that
/// differs by more than `probability` from that of the stage with half of the samples. The later paper does
/// not say how it detects the end of this growth; this is our reading, with a constant fitted to data.
///
/// As with [`Myszkowski1998`], each call compares the whole picture once, and each tile takes its verdict
/// from the map. If the first picture shows no noise, it never differs: such a tile is done at the first
/// opportunity.
#[derive(Clone, Debug)]
pub struct Takouachet2007 {
    /// Change of the probability of detection above which a pixel has changed, in (0, 1). The default of 0.74
    /// agrees with people on average, on synthesised renderings.
    pub probability: f64,
    /// Share of a tile's pixels that may do so, in [0, 1]; 0.01 by default.
    pub share: f64,
    vdp: Vdp,
    first: Option<Response>,
    stages: Stages<Vec<f32>>,
}

impl Takouachet2007 {
    /// The criterion with this constant, 1 % of a tile's pixels, and the default viewing condition.
    pub fn new(probability: f64) -> Self {
        Self { probability, share: DEFAULT_SHARE, vdp: Vdp::default(), first: None, stages: Stages::new() }
    }
}

impl StoppingCriterion for Takouachet2007 {
    fn name(&self) -> String {
        format!("Takouachet et al. 2007, P {}", self.probability)
    }

    fn fingerprint(&self) -> String {
        format!("{}, share {}, {:?}", self.name(), self.share, self.vdp)
    }

    fn begin(&mut self, _: TileGrid) {
        self.stages.kept.clear();
        self.first = None;
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let samples = stage_of(view.film);
        let now = response(&self.vdp, view);
        let Some(first) = &self.first else {
            self.first = Some(now);
            return Ok(vec![verdict(false, None); tiles.len()]);
        };
        let map = self.vdp.detect(first, &now);
        let change: Option<Vec<f32>> = self
            .stages
            .half_way(samples)
            .map(|before| map.iter().zip(before).map(|(now, before)| (now - before).abs()).collect());
        self.stages.keep(samples, map);
        Ok(verdicts(change.as_deref(), view.film.grid().width(), tiles, self.probability, self.share))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{constant, empty, expose, view};
    use noisefloor_testkit::Noise;

    #[test]
    fn stages_thin_out_and_go() {
        let mut stages = Stages::new();
        for n in 1..=400u64 {
            if n > 1 {
                let half = *stages.half_way(10 * n).unwrap();
                assert!(
                    2 * half <= 10 * n && 2.3 * half as f64 >= (10 * n) as f64 - 20.0,
                    "{half} at {}",
                    10 * n
                );
            }
            stages.keep(10 * n, 10 * n);
            assert!(stages.kept.len() <= 10, "{:?}", stages.kept);
        }
    }

    /// Verdicts on the first tile at each number of samples.
    fn run(criterion: &mut dyn StoppingCriterion, sigma: f64, counts: &[u64]) -> Vec<bool> {
        let (mut film, mut noise) = (empty(), Noise::new(8));
        let judge = |&samples: &u64| {
            let half = (samples - film.spp(0)) / 2;
            (0..2).for_each(|_| expose(&mut film, half, 0.2, sigma, &mut noise));
            let tiles: Vec<Tile> = film.grid().tiles().collect();
            criterion.judge(&view(&film), &tiles).unwrap()[0].converged
        };
        counts.iter().map(judge).collect()
    }

    #[test]
    fn a_clean_picture_is_done_once_it_can_be_told() {
        let counts = [100, 200, 300, 400];
        assert_eq!(run(&mut Myszkowski1998::new(DEFAULT_SEEN), 0.0, &counts), [false, true, true, true]);
        assert_eq!(run(&mut Takouachet2007::new(DEFAULT_GROWTH), 0.0, &counts), [false, false, false, true]);
    }

    #[test]
    fn noise_keeps_on_until_it_is_gone() {
        // σ/√n is 0.1 of a grey of 0.2 at 100 samples and 0.001 at 10⁶.
        let counts = [100, 200, 400, 1_000_000, 2_000_000, 4_000_000];
        // Stricter than the default, by which σ of 0.05 passes now and then
        let mut strict = Myszkowski1998::new(0.55);
        let myszkowski = run(&mut strict, 0.2, &counts);
        assert_eq!(myszkowski, [false, false, false, false, true, true]);
        let takouachet = run(&mut Takouachet2007::new(DEFAULT_GROWTH), 0.2, &counts);
        assert_eq!(takouachet[..3], [false; 3]);
        assert!(takouachet[5]);
    }

    #[test]
    fn another_film_is_another_run() {
        let mut criterion = Myszkowski1998::new(DEFAULT_SEEN);
        let judge = |criterion: &mut Myszkowski1998, film: &Film| {
            let tiles: Vec<Tile> = film.grid().tiles().collect();
            criterion.judge(&view(film), &tiles).unwrap()[0].converged
        };
        assert!(!judge(&mut criterion, &constant(0.5, 200)));
        assert!(judge(&mut criterion, &constant(0.5, 400)));
        assert!(!judge(&mut criterion, &constant(0.5, 100)));
    }
}
