//! Logistic regression: a machine that decides on a straight line, for few numbers that are made to fall
//! together with noise.

use linfa_linalg::cholesky::SolveCInplace;
use ndarray::{Array1, Array2, ArrayView2, Axis};
use noisefloor::svm::Line;

/// Newton steps at most; some ten are enough on the human data.
const STEPS: usize = 50;
/// Halvings of a step at most: one that does not descend then is rounding.
const HALVINGS: i32 = 50;
/// A step smaller than this ends the search.
const SMALL: f64 = 1e-6;

/// A number that a line weighs.
pub(crate) struct Weighed {
    /// Its place in the descriptor.
    pub(crate) number: usize,
    /// By how much it grows with ln(samples), as noise falls: −½ for the logarithm of an amplitude of noise.
    pub(crate) growth: f64,
}

/// Logistic regression on `rows` with the shares `shares`, in [0, 1]: minimises the mean of
/// −y·ln p − (1 − y)·ln(1 − p) with p = 1/(1 + exp(−w·x − b)), by Newton's method.
///
/// How steep the line is in ln(samples) is known, 1/`spread`, since noise falls as 1/√n and the shares were made so;
/// the first of the numbers weighed, the noise of the tile, takes what the others leave of it. These others correct
/// what the vision model says of the tile by itself, and |their weights|²/(2`c`) is added: what is learned is shrunk
/// towards the vision model. Left free, the steepness would be lessened by all that differs between scenes and that no
/// number tells.
pub(crate) fn fit_line(
    rows: ArrayView2<'_, f64>,
    weighed: &[Weighed],
    shares: &[f64],
    (spread, c): (f64, f64),
) -> Line {
    let Some((noise, others)) = weighed.split_first() else { return line(&vec![0.0; rows.ncols() + 1]) };
    let examples = rows.nrows();
    // Nothing is known beforehand of numbers that do not measure noise
    let steepness = if noise.growth == 0.0 { 0.0 } else { 1.0 / (noise.growth * spread) };
    let known = &rows.column(noise.number) * steepness;
    let ratio = |other: &Weighed| if noise.growth == 0.0 { 0.0 } else { other.growth / noise.growth };

    // The other numbers as they differ from the noise, and a last column of ones for b, which is not penalised
    let free = others.len();
    let mut x = Array2::ones((examples, free + 1));
    for (mut column, other) in x.columns_mut().into_iter().zip(others) {
        column.assign(&(&rows.column(other.number) - &(&rows.column(noise.number) * ratio(other))));
    }
    let mut penalty = Array1::from_elem(free + 1, examples as f64 / c);
    penalty[free] = 1e-9;

    let shares = Array1::from(shares.to_vec());
    // What is minimised, ln(1 + exp(z)) − y·z an example, and the penalty
    let loss = |weights: &Array1<f64>| {
        let z = x.dot(weights) + &known;
        let of_one = |(&z, &y): (&f64, &f64)| z.max(0.0) + (-z.abs()).exp().ln_1p() - y * z;
        z.iter().zip(&shares).map(of_one).sum::<f64>() + 0.5 * (&penalty * weights * weights).sum()
    };
    let mut weights = Array1::<f64>::zeros(free + 1);
    for _ in 0..STEPS {
        let p = (x.dot(&weights) + &known).mapv(|f| 1.0 / (1.0 + (-f).exp()));
        let slope = x.t().dot(&(&p - &shares)) + &penalty * &weights;
        let curvature = p.mapv(|p| p * (1.0 - p)).insert_axis(Axis(1));
        let mut hessian = x.t().dot(&(&x * &curvature)) + Array2::from_diag(&penalty);
        // Classes that a line separates, and next to no penalty: as steep as numbers allow
        let Ok(step) = hessian.solvec_into(slope.insert_axis(Axis(1))) else { break };
        let step = step.remove_axis(Axis(1));
        if !step.iter().all(|s| s.is_finite()) {
            break;
        }
        // Where the known part is steep and off, all examples lie where the curve is flat, and whole steps overshoot
        let here = loss(&weights);
        let shorter = |halvings| &step * 0.5f64.powi(halvings);
        let descends = |&halvings: &i32| loss(&(&weights - &shorter(halvings))) < here;
        let Some(halvings) = (0..HALVINGS).find(descends) else { break };
        let step = shorter(halvings);
        weights -= &step;
        if step.iter().all(|s| s.abs() < SMALL) {
            break;
        }
    }

    let mut of_all = vec![0.0; rows.ncols() + 1];
    of_all[noise.number] = steepness;
    for (other, &weight) in others.iter().zip(&weights) {
        of_all[other.number] = weight;
        of_all[noise.number] -= weight * ratio(other);
    }
    of_all[rows.ncols()] = weights[free];
    line(&of_all)
}

/// The line of these weights, the last of which is b.
fn line(weights: &[f64]) -> Line {
    let (bias, weights) = weights.split_last().map_or((0.0, weights), |(b, w)| (*b, w));
    Line { weights: weights.iter().map(|&w| w as f32).collect(), bias: bias as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares that follow a logistic function exactly are found exactly, where nothing is penalised. The first number
    /// falls by ½ with ln(samples), the second by ¼, and shares go from noisy to converged with a spread of ⅔.
    #[test]
    fn finds_the_line_that_shares_follow() {
        let rows = Array2::from_shape_fn((200, 3), |(i, j)| ((i * (7 + 6 * j)) % 41) as f64 / 20.0 - 1.0);
        // ½·2.75 + ¼·0.5 = 3/2
        let line = |r: &[f64]| -2.75 * r[0] - 0.5 * r[1] + 0.75;
        let shares: Vec<f64> =
            rows.rows().into_iter().map(|r| 1.0 / (1.0 + (-line(&[r[0], r[1]])).exp())).collect();
        let weighed = [(0, -0.5), (1, -0.25)].map(|(number, growth)| Weighed { number, growth });
        let fitted = fit_line(rows.view(), &weighed, &shares, (1.0 / 1.5, 1e12));
        // The third number is not weighed
        for x in [[0.5, -0.5, 9.0], [-1.0, 1.0, 0.0], [0.0, 0.0, -9.0]] {
            let f = f64::from(fitted.decision(&[x[0] as f32, x[1] as f32, x[2] as f32]));
            assert!((f - line(&x[..2])).abs() < 0.02, "{f} {}", line(&x[..2]));
        }
        // A start that is far off: the noise says that all is converged, and people that nothing is
        let far = rows.mapv(|v| v - 40.0);
        let never = fit_line(
            far.view(),
            &[(0, -0.5), (1, -0.25)].map(|(number, growth)| Weighed { number, growth }),
            &vec![0.25; 200],
            (1.0 / 1.5, 1e2),
        );
        let mean = far
            .rows()
            .into_iter()
            .map(|r| 1.0 / (1.0 + f64::from(-never.decision(&[r[0] as f32, r[1] as f32, 0.0])).exp()))
            .sum::<f64>()
            / 200.0;
        assert!((mean - 0.25).abs() < 0.01, "{mean}");
        // Nothing is left but the vision model where all else is penalised
        let shrunk = fit_line(rows.view(), &weighed, &shares, (1.0 / 1.5, 1e-6));
        let by_the_second = shrunk.decision(&[0.0, 1.0, 0.0]) - shrunk.decision(&[0.0, 0.0, 0.0]);
        assert!(by_the_second.abs() < 1e-3, "{by_the_second}");
    }
}
