//! One person's own line, T′ = aT + b, on top of the model: learned from their answers in milliseconds.
//!
//! Somebody who sees noise for longer, or for less long, than the observers of the training data is described
//! by the line from those observers' thresholds to their own, as any audience is (Takouachet et al. 2017,
//! §7.3). The line is the mean of its posterior: with few answers it stays near the model, with many it
//! follows the person.

use noisefloor::{Audience, Model, People};
use noisefloor_learn::Answer;
use serde::Serialize;

/// Prior standard deviation of ln a: two people of three need between half and twice the samples of the
/// observers.
const LN_SLOPE_SD: f64 = 0.7;
/// Prior standard deviation of b, in the geometric mean of the samples that were asked about.
const OFFSET_SD: f64 = 0.1;
/// Share of answers that may be slips: one alone about the noisiest tile must not decide everything.
const SLIPS: f64 = 0.05;
/// The grid of the posterior: values on each side of the middle, and their distance.
const SLOPES: (i32, f64) = (32, 0.08);
const OFFSETS: (i32, f64) = (6, 0.04);
/// P is computed at this many factors of samples on each side of 1, a tenth apart in ln, and interpolated.
const FACTORS: (i32, f64) = (36, 0.1);

/// What was learned about one person.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PersonalLine {
    pub slope: f64,
    /// Offset b, in samples per pixel.
    pub offset: f64,
    pub answers: usize,
    /// Answers that the verdicts of the model agree with.
    pub agreed_before: usize,
    /// Answers that the verdicts for this line agree with.
    pub agree_now: usize,
}

/// One answer, with what the model says of the tile at other numbers of samples.
struct Curve<'a> {
    answer: &'a Answer,
    /// logit P by ln(factor).
    logits: Vec<f64>,
}

impl Curve<'_> {
    /// logit P of a person with this line.
    fn logit(&self, line: Audience) -> f64 {
        let seen_as = line.seen_as(self.answer.spp);
        let (reach, step) = FACTORS;
        let ln = (seen_as / self.answer.spp).max(1e-6).ln();
        let place = (ln / step + f64::from(reach)).clamp(0.0, f64::from(2 * reach));
        let (at, part) = (place as usize, place.fract());
        let next = (at + 1).min(self.logits.len() - 1);
        self.logits[at] * (1.0 - part) + self.logits[next] * part
    }

    fn says_none(&self, line: Audience, threshold: f64) -> bool {
        self.logit(line) >= threshold
    }
}

fn logit(p: f64) -> f64 {
    let p = p.clamp(1e-6, 1.0 - 1e-6);
    (p / (1.0 - p)).ln()
}

/// Learns the line of one person from answers whose descriptors are the model's. `None` without answers, or
/// if the descriptor does not tell noise from picture.
pub fn fit_line(model: &Model, people: People, answers: &[Answer]) -> Option<PersonalLine> {
    let curves: Vec<Curve<'_>> = answers.iter().map(|answer| curve(model, answer)).collect::<Option<_>>()?;
    let n = curves.len() as f64;
    let middle = (answers.iter().map(|a| a.spp.ln()).sum::<f64>() / n).exp();
    let threshold = logit(f64::from(people.share()));
    if curves.is_empty() {
        return None;
    }
    let line = |slope: i32, offset: i32| Audience {
        slope: (f64::from(slope) * SLOPES.1).exp(),
        offset: f64::from(offset) * OFFSETS.1 * middle,
    };

    // The posterior on a grid; the mean of ln a and b
    let (mut total, mut ln_slope, mut offset_sum) = (0.0, 0.0, 0.0);
    let mut all = Vec::new();
    for slope in -SLOPES.0..=SLOPES.0 {
        for offset in -OFFSETS.0..=OFFSETS.0 {
            let (own, base) = (line(slope, offset), model.audience());
            let [a, b] =
                [f64::from(slope) * SLOPES.1 / LN_SLOPE_SD, f64::from(offset) * OFFSETS.1 / OFFSET_SD];
            let mut ln_posterior = -0.5 * (a * a + b * b);
            for curve in &curves {
                // A verdict at the threshold is an even chance; the further beyond, the likelier the answer
                let towards = curve.logit(base.then(own)) - threshold;
                let agrees = if curve.answer.sees_noise { -towards } else { towards };
                let likelihood = 0.5 * SLIPS + (1.0 - SLIPS) / (1.0 + (-agrees).exp());
                ln_posterior += likelihood.ln();
            }
            all.push((ln_posterior, own));
        }
    }
    let best = all.iter().map(|(l, _)| *l).fold(f64::NEG_INFINITY, f64::max);
    for (ln_posterior, own) in all {
        let weight = (ln_posterior - best).exp();
        total += weight;
        ln_slope += weight * own.slope.ln();
        offset_sum += weight * own.offset;
    }
    let own = Audience { slope: (ln_slope / total).exp(), offset: offset_sum / total };
    let agree = |line: Audience| {
        let same =
            |c: &&Curve<'_>| c.says_none(model.audience().then(line), threshold) != c.answer.sees_noise;
        curves.iter().filter(same).count()
    };
    Some(PersonalLine {
        slope: own.slope,
        offset: own.offset,
        answers: answers.len(),
        agreed_before: agree(Audience::TRAINED),
        agree_now: agree(own),
    })
}

fn curve<'a>(model: &Model, answer: &'a Answer) -> Option<Curve<'a>> {
    let (reach, step) = FACTORS;
    let logits = (-reach..=reach).map(|i| {
        let mut raw = answer.descriptor.clone();
        let factor = (f64::from(i) * step).exp() as f32;
        let projected = model.descriptor().project(&mut raw, factor);
        projected.then(|| logit(f64::from(model.judge(&raw).probability)))
    });
    Some(Curve { answer, logits: logits.collect::<Option<_>>()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers of a person whose thresholds are `slope` times those of the observers, about tiles of the mean
    /// texture of the training data around the observers' threshold.
    fn answers(model: &Model, people: People, slope: f32, count: usize) -> Vec<Answer> {
        let at = |factor: f32| {
            let mut raw = model.classifier().scaler.mean.clone();
            assert!(model.descriptor().project(&mut raw, factor));
            raw
        };
        let none = |factor: f32| people.are_satisfied_by(model.judge(&at(factor)).probability);
        let just = (-200..200).map(|i| (i as f32 * 0.05).exp()).find(|f| none(*f)).unwrap();
        let answer = |i: usize| {
            // From an eighth of the observers' threshold to eight times
            let factor = just * (8f32.ln() * (2.0 * i as f32 / (count - 1) as f32 - 1.0)).exp();
            let (group, spp) = ("wall".to_owned(), 100.0 * f64::from(factor / just));
            Answer { group, spp, descriptor: at(factor), sees_noise: !none(factor / slope) }
        };
        (0..count).map(answer).collect()
    }

    #[test]
    fn a_persons_line_is_learned_and_shrunk() {
        let (model, people) = (Model::bundled(), People::DEFAULT);
        for slope in [0.4f32, 1.0, 2.5] {
            let fit = |count| fit_line(&model, people, &answers(&model, people, slope, count)).unwrap();
            let [few, many] = [fit(4), fit(40)];
            let truth = f64::from(slope).ln();
            assert!((many.slope.ln() - truth).abs() < 0.35, "{slope}: {many:?}");
            assert!(few.slope.ln().abs() < many.slope.ln().abs() + 0.2, "{slope}: {few:?} {many:?}");
            assert!(many.agree_now >= many.agreed_before && many.agree_now >= 37, "{slope}: {many:?}");
        }
        assert_eq!(fit_line(&model, people, &[]), None);
    }

    /// Forty answers of simulated people, yes or no, about tiles of random noise around the observers' threshold:
    /// beside the figures of calibrations (`calibrate/simulate.rs`), which choose the noise and ask which of four.
    /// Offset and slope trade places, so what counts is the need at the middle of what was asked. Of 200 people, a
    /// share near 0.75 errs by 0.03.
    #[test]
    fn forty_answers_give_a_rough_factor() {
        let (model, people) = (Model::bundled(), People::DEFAULT);
        let mut errors = Vec::new();
        for seed in 0..200 {
            let mut random = noisefloor_pages::random::seeded(seed);
            let factor = 0.5 * 6f64.powf(random.f64());
            let scale = (0.15 + 0.35 * random.f64()) * 3f64.sqrt() / std::f64::consts::PI;
            let slips = 0.05 * random.f64();
            let mut asked = answers(&model, people, 1.0, 201);
            random.shuffle(&mut asked);
            asked.truncate(40);
            for answer in &mut asked {
                let u = random.f64().clamp(1e-9, 1.0 - 1e-9);
                let own = (100.0 * factor).ln() + scale * (u / (1.0 - u)).ln();
                answer.sees_noise = if random.f64() < slips { random.bool() } else { answer.spp.ln() < own };
            }
            let line = fit_line(&model, people, &asked).unwrap();
            let need = line.slope * 100.0 + line.offset;
            errors.push((need / (100.0 * factor)).ln());
        }
        let n = errors.len() as f64;
        let within = errors.iter().filter(|e| e.abs() <= 1.25f64.ln()).count() as f64 / n;
        let bias = (errors.iter().sum::<f64>() / n).exp();
        println!("explore, 40 answers: within {within:.2}, bias {bias:.3}");
        assert!(within > 0.6 && (0.85..1.15).contains(&bias), "{within} {bias}");
    }

    /// Twelve times "I see none" of tiles that the model calls noisy: verdicts turn.
    #[test]
    fn a_dozen_answers_turn_verdicts() {
        let (model, people) = (Model::bundled(), People::DEFAULT);
        let all = answers(&model, people, 1.0, 25);
        let mut twelve: Vec<Answer> = all.into_iter().filter(|a| a.sees_noise).collect();
        twelve.truncate(12);
        twelve.iter_mut().for_each(|a| a.sees_noise = false);
        assert_eq!(twelve.len(), 12);
        let line = fit_line(&model, people, &twelve).unwrap();
        assert!(line.agreed_before == 0 && line.agree_now >= 8 && line.slope < 0.5, "{line:?}");
    }
}
