//! What criteria by pixel have in common.

use noisefloor::{Film, Rgb, Verdict, criterion::View};
use rayon::prelude::*;

/// Share of a tile's pixels that must meet a condition.
pub(crate) const DEFAULT_SHARE: f64 = 0.95;

/// A verdict without a probability.
pub(crate) fn verdict(converged: bool, expected_spp: Option<u64>) -> Verdict {
    Verdict::new(converged).expecting(expected_spp)
}

/// Whether `passed` of `pixels` are at least the share.
pub(crate) fn enough(passed: usize, pixels: usize, share: f64) -> bool {
    passed as f64 >= share * pixels as f64
}

/// Σ|I − A| and ΣI over the channels of one pixel, both times `exposure`: I is the mean of all samples, A
/// that of half of them (Dammertz et al. 2010, §2.1). `None` if a half has no valid sample: the error is unknown.
///
/// Of even halves, |I − A| = |A − B|/2, whichever is taken. Of uneven ones, |A − B|·√(n_A·n_B)/n has the same noise.
pub(crate) fn half_difference(film: &Film, tile: usize, pixel: usize, exposure: f64) -> Option<(f64, f64)> {
    let [(a, na), (b, nb)] = film.pixel_halves(tile, pixel);
    if na == 0 || nb == 0 {
        return None;
    }
    let (na, nb) = (na as f64, nb as f64);
    let all = na + nb;
    let channels = || a.into_iter().zip(b).map(|(a, b)| (f64::from(a), f64::from(b)));
    let difference: f64 = channels().map(|(a, b)| (a - b).abs()).sum();
    let sum: f64 = channels().map(|(a, b)| (a * na + b * nb) / all).sum();
    Some((difference * (na * nb).sqrt() / all * exposure, sum * exposure))
}

/// The number of samples that is enough for a share of a tile's pixels; `None` if some of these need
/// infinitely many.
pub(crate) fn need_of_share(mut needs: Vec<f64>, share: f64) -> Option<u64> {
    let place = ((share * needs.len() as f64).ceil() as usize).clamp(1, needs.len()) - 1;
    let (_, &mut need, _) = needs.select_nth_unstable_by(place, f64::total_cmp);
    need.is_finite().then(|| need.ceil() as u64)
}

/// The picture as it is displayed, row-major.
pub(crate) fn displayed(view: &View<'_>) -> Vec<Rgb> {
    view.film.image().into_par_iter().map(|pixel| view.display.encode(pixel)).collect()
}
