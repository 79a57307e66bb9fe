//! A line or a support vector machine trained on the examples of some zones and answers.

use crate::answer::Answer;
use crate::line::{Weighed, fit_line};
use crate::observers::observers_agreeing;
use crate::params::{Learner, TrainError, TrainParams};
use crate::table::Zone;
use ndarray::Array2;
use noisefloor::svm::{Classifier, Machine, Platt, Scaler};
use noisefloor::svm::{SvmParams, check_examples, fit_svm};

/// Machine and scaler, before calibration.
pub(crate) struct Fitted {
    pub(crate) scaler: Scaler,
    machine: Machine,
    /// How many examples one answer counts as.
    weight: usize,
}

impl Fitted {
    pub(crate) fn fit(
        zones: &[&Zone],
        answers: &[&Answer],
        svm: SvmParams,
        params: &TrainParams,
        least_deviation: f64,
        weighed: &[(usize, f64)],
    ) -> Result<Self, TrainError> {
        let range = params.range;
        // What people said, and the share of them who agree that it has converged
        let mut examples: Vec<(&[f32], bool, f64)> = Vec::new();
        for zone in zones {
            let threshold = zone.human_as_noise();
            let agreeing = |spp: f64| observers_agreeing(spp, threshold, params.spread);
            examples
                .extend(self::examples(zone, range).map(|e| (e.descriptor, e.converged, agreeing(e.spp))));
        }
        let scaler = Scaler::fit(examples.iter().map(|e| e.0), least_deviation);
        let weight = answer_weight(examples.len(), zones.len(), range);
        for answer in answers {
            examples.extend(std::iter::repeat_n(
                (&answer.descriptor[..], !answer.sees_noise, f64::from(u8::from(!answer.sees_noise))),
                weight,
            ));
        }

        let dimensions = examples.first().map_or(0, |e| e.0.len());
        let mut rows = Array2::zeros((examples.len(), dimensions));
        for (mut row, (descriptor, ..)) in rows.rows_mut().into_iter().zip(&examples) {
            let scaled = scaler.scaled(descriptor);
            row.iter_mut().zip(&scaled).for_each(|(to, &from)| *to = f64::from(from));
        }
        let labels: Vec<bool> = examples.iter().map(|e| e.1).collect();
        let machine = match params.learner {
            Learner::Svm => Machine::Svm(fit_svm(rows.view(), &labels, svm)?),
            Learner::Line => {
                check_examples(rows.view(), &labels, svm)?;
                let shares: Vec<f64> = examples.iter().map(|e| e.2).collect();
                let scaled = |&(number, growth): &(usize, f64)| Weighed {
                    number,
                    growth: growth * f64::from(scaler.scale[number]),
                };
                let weighed: Vec<Weighed> = weighed.iter().map(scaled).collect();
                Machine::Line(fit_line(rows.view(), &weighed, &shares, (params.spread, svm.c)))
            }
        };
        Ok(Self { scaler, weight, machine })
    }

    fn decide(&self, descriptor: &[f32]) -> f32 {
        self.machine.decision(&self.scaler.scaled(descriptor))
    }

    /// (decision value, 0 or 1) of an answer, as often as it counts.
    pub(crate) fn answered(&self, answer: &Answer) -> impl Iterator<Item = (f32, f64)> {
        let agreeing = f64::from(u8::from(!answer.sees_noise));
        std::iter::repeat_n((self.decide(&answer.descriptor), agreeing), self.weight)
    }

    /// (decision value, 0 or 1) of a zone's examples.
    pub(crate) fn decisions<'a>(
        &'a self,
        zone: &'a Zone,
        params: &'a TrainParams,
    ) -> impl Iterator<Item = (f32, f64)> + 'a {
        examples(zone, params.range).map(|e| (self.decide(e.descriptor), f64::from(u8::from(e.converged))))
    }

    pub(crate) fn calibrated(self, platt: Platt) -> Classifier {
        Classifier { scaler: self.scaler, machine: self.machine, platt }
    }
}

/// An answer is about one number of samples. It counts as much as a zone, whose examples spread over range²
/// in samples, has within a doubling of them.
fn answer_weight(examples: usize, zones: usize, range: f64) -> usize {
    let doublings = 2.0 * range.log2();
    (examples as f64 / zones.max(1) as f64 / doublings).round().max(1.0) as usize
}

pub(crate) struct Example<'a> {
    spp: f64,
    descriptor: &'a [f32],
    converged: bool,
}

/// A zone's levels whose noise is near what people just saw. Of a censored zone, only what is certain: the levels below.
pub(crate) fn examples(zone: &Zone, range: f64) -> impl Iterator<Item = Example<'_>> {
    let threshold = zone.human_as_noise();
    let near = move |spp: f64| (spp / threshold).ln().abs() <= range.ln() * (1.0 + 1e-9);
    let certain = move |spp: f64| !zone.censored || spp < threshold;
    zone.levels.iter().filter(move |l| near(l.spp) && certain(l.spp)).map(move |l| Example {
        spp: l.spp,
        descriptor: &l.descriptor,
        converged: l.spp >= threshold,
    })
}
