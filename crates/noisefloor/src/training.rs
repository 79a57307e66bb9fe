//! Learning a model from a table of human thresholds, and scoring it on scenes it has not seen.

use crate::answer::Answer;
use crate::evaluation::{Prediction, Scores, Table, Zone, predict, score};
use crate::familiarity::{Familiarity, nearest};
use crate::model::{Model, TrainingRecord};
use crate::oracle::DEFAULT_THRESHOLD;
use crate::params::Audience;
use crate::svm::{Platt, Scaler, Svm, SvmParams, SvmTrainError, fit_platt, fit_svm};
use ndarray::Array2;
use rayon::prelude::*;
use std::collections::BTreeSet;
use thiserror::Error;

/// Share of observers who see no difference at the recorded threshold, as it is read here (Takouachet et al. 2017, §4.2.2:
/// "identical to the reference one by 95% of the observers"). The human data call it a mean over observers and give no spread,
/// so that this share and [`TrainParams::spread`] are one assumption together: they place P = 0.9 where predictions on left-out
/// scenes are neither early nor late.
pub const OBSERVERS_AT_THRESHOLD: f64 = 0.95;

/// How a model is to be trained.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainParams {
    /// Pairs of C and γ to choose from, by leave-one-group-out.
    pub candidates: Vec<SvmParams>,
    /// Levels within this factor of the human threshold are examples; those beyond are clear anyway. Above 1.
    pub range: f64,
    /// Spread of the observers of one zone: scale of the logistic distribution of their thresholds in ln(samples), above 0. The
    /// human data give means alone; the default is where thresholds predicted on left-out scenes are neither early nor late,
    /// and amounts to a standard deviation of 0.29 in ln(contrast).
    pub spread: f64,
}

impl Default for TrainParams {
    /// For the compact descriptor.
    fn default() -> Self {
        let candidates =
            [0.1, 0.3, 1.0].iter().flat_map(|&c| [0.003, 0.01].map(|gamma| SvmParams { c, gamma })).collect();
        Self { candidates, range: 8.0, spread: 0.32 }
    }
}

impl TrainParams {
    /// For the paper's descriptor: its C and γ, [`SvmParams::PAPER`].
    pub fn paper() -> Self {
        Self { candidates: vec![SvmParams::PAPER], ..Self::default() }
    }
}

/// Why a model could not be trained.
#[derive(Debug, Error)]
pub enum TrainError {
    /// The machine.
    #[error(transparent)]
    Svm(#[from] SvmTrainError),
    /// A parameter out of range.
    #[error("training needs candidates for C and γ, a range above 1 and a spread above 0")]
    Params,
    /// Answers that are not described as the zones are.
    #[error("an answer has {found} numbers, and the zones have {expected}: it is of another descriptor")]
    Answer {
        /// Numbers of a zone.
        expected: usize,
        /// Numbers of the answer.
        found: usize,
    },
    /// Leaving groups out needs groups.
    #[error("leaving scenes out needs at least {needed} groups of scenes; the corpus has {found}: {names}")]
    Groups {
        /// Groups needed.
        needed: usize,
        /// Groups found.
        found: usize,
        /// Their names.
        names: String,
    },
}

/// Share of observers who see no difference at `spp` samples in a zone with the recorded threshold `human`: a logistic
/// psychometric function of ln(spp), which is [`OBSERVERS_AT_THRESHOLD`] at the threshold.
pub fn observers_agreeing(spp: f64, human: f64, spread: f64) -> f64 {
    let at_threshold = (OBSERVERS_AT_THRESHOLD / (1.0 - OBSERVERS_AT_THRESHOLD)).ln();
    1.0 / (1.0 + (-(spp / human).ln() / spread - at_threshold).exp())
}

/// Machine and scaler, before calibration.
struct Machine {
    scaler: Scaler,
    svm: Svm,
    /// Examples that an answer counts as.
    weight: usize,
}

impl Machine {
    fn fit<'a>(
        (zones, answers): (&[&'a Zone], &[&'a Answer]),
        svm: SvmParams,
        range: f64,
        least_deviation: f64,
    ) -> Result<Self, TrainError> {
        let mut examples: Vec<(&[f32], bool)> =
            zones.iter().flat_map(|z| examples(z, range)).map(|e| (e.descriptor, e.converged)).collect();
        let scaler = Scaler::fit(examples.iter().map(|e| e.0), least_deviation);
        let weight = answer_weight(examples.len(), zones.len(), range);
        let answer = |a: &&'a Answer| std::iter::repeat_n((&a.descriptor[..], !a.sees_noise), weight);
        examples.extend(answers.iter().flat_map(answer));
        let dimensions = examples.first().map_or(0, |e| e.0.len());
        let mut rows = Array2::zeros((examples.len(), dimensions));
        let mut scaled = Vec::new();
        for (mut row, (descriptor, _)) in rows.rows_mut().into_iter().zip(&examples) {
            scaled.clear();
            scaled.extend_from_slice(descriptor);
            scaler.apply(&mut scaled);
            row.iter_mut().zip(&scaled).for_each(|(to, &from)| *to = f64::from(from));
        }
        let labels: Vec<bool> = examples.iter().map(|e| e.1).collect();
        Ok(Self { scaler, weight, svm: fit_svm(rows.view(), &labels, svm)? })
    }

    fn decide(&self, descriptor: &[f32]) -> f32 {
        let mut scaled = descriptor.to_vec();
        self.scaler.apply(&mut scaled);
        self.svm.decision(&scaled)
    }

    /// (decision value, 0 or 1) of an answer, as often as it weighs.
    fn answered(&self, answer: &Answer) -> impl Iterator<Item = (f32, f64)> {
        let agreeing = f64::from(u8::from(!answer.sees_noise));
        std::iter::repeat_n((self.decide(&answer.descriptor), agreeing), self.weight)
    }

    /// (decision value, share of observers that agree) of a zone's examples.
    fn decisions<'a>(
        &'a self,
        zone: &'a Zone,
        params: &'a TrainParams,
    ) -> impl Iterator<Item = (f32, f64)> + 'a {
        examples(zone, params.range)
            .map(|e| (self.decide(e.descriptor), observers_agreeing(e.spp, zone.human_spp, params.spread)))
    }

    fn into_model(
        self,
        table: &Table,
        platt: Platt,
        familiarity: Option<Familiarity>,
        record: TrainingRecord,
    ) -> Model {
        Model {
            descriptor: table.descriptor,
            descriptor_version: table.descriptor.version(),
            evidence: table.evidence,
            tone_mapping: table.tone_mapping,
            scaler: self.scaler,
            svm: self.svm,
            platt,
            familiarity,
            audience: Audience::TRAINED,
            record,
        }
    }
}

/// An answer is about one number of samples. It weighs as much as what a zone, whose examples spread over range² in samples, has within a
/// doubling of them.
fn answer_weight(examples: usize, zones: usize, range: f64) -> usize {
    let doublings = 2.0 * range.log2();
    (examples as f64 / zones.max(1) as f64 / doublings).round().max(1.0) as usize
}

struct Example<'a> {
    spp: f64,
    descriptor: &'a [f32],
    converged: bool,
}

/// A zone's levels near its threshold. Of a censored zone only what is certain: the levels below.
fn examples(zone: &Zone, range: f64) -> impl Iterator<Item = Example<'_>> {
    let near = move |spp: f64| (spp / zone.human_spp).ln().abs() <= range.ln() * (1.0 + 1e-9);
    let certain = move |spp: f64| !zone.censored || spp < zone.human_spp;
    zone.levels.iter().filter(move |l| near(l.spp) && certain(l.spp)).map(|l| Example {
        spp: l.spp,
        descriptor: &l.descriptor,
        converged: l.spp >= zone.human_spp,
    })
}

/// Trains on the zones of `groups`, at least two, with C and γ chosen, and P calibrated, by leaving each group out in turn.
fn fit_groups(
    table: &Table,
    groups: &[&str],
    params: &TrainParams,
) -> Result<(Machine, Platt, SvmParams), TrainError> {
    let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<&Zone> {
        table.zones.iter().filter(|z| groups.contains(&z.group.as_str()) && wanted(&z.group)).collect()
    };
    let all = table.groups();
    let known = |a: &&Answer| groups.contains(&a.group.as_str()) || !all.contains(&a.group.as_str());
    let answers: Vec<&Answer> = table.answers.iter().filter(known).collect();
    let fit = |wanted: &dyn Fn(&str) -> bool, answers: &[&Answer], svm: SvmParams| {
        let told: Vec<&Answer> = answers.iter().copied().filter(|a| wanted(&a.group)).collect();
        Machine::fit((&of(wanted), &told), svm, params.range, table.descriptor.least_deviation())
    };

    // Machines that have not seen one group judge that group; one sigmoid over all of it.
    let folds = |svm: SvmParams, answers: &[&Answer]| -> Result<_, TrainError> {
        let mut folds = Vec::new();
        let mut decisions = Vec::new();
        let everyone: BTreeSet<&str> =
            groups.iter().copied().chain(answers.iter().map(|a| a.group.as_str())).collect();
        for group in everyone {
            let machine = fit(&|g| g != group, answers, svm)?;
            let zones = of(&|g| g == group);
            zones.iter().for_each(|z| decisions.extend(machine.decisions(z, params)));
            let asked = answers.iter().filter(|a| a.group == group);
            asked.for_each(|a| decisions.extend(machine.answered(a)));
            folds.push((machine, zones));
        }
        Ok((folds, fit_platt(&decisions)?))
    };

    // Thresholds choose C and γ. Answers are none.
    let held_out = |&candidate: &SvmParams| -> Result<(f64, Platt), TrainError> {
        let (folds, platt) = folds(candidate, &[])?;
        let record = TrainingRecord::default();
        let predictions: Vec<Prediction> = folds
            .into_iter()
            .flat_map(|(machine, zones)| {
                let model = machine.into_model(table, platt, None, record.clone());
                zones.into_iter().map(|z| predict(&model, DEFAULT_THRESHOLD, z)).collect::<Vec<_>>()
            })
            .collect();
        Ok((score(predictions.iter()).error_factor, platt))
    };
    let outcomes: Vec<(f64, Platt)> = params.candidates.par_iter().map(held_out).collect::<Result<_, _>>()?;
    let best = (0..outcomes.len())
        .min_by(|&i, &j| outcomes[i].0.total_cmp(&outcomes[j].0))
        .ok_or(TrainError::Params)?;

    // All groups train the machine; the sigmoid stays that of held-out decision values.
    let chosen = params.candidates[best];
    let platt = if answers.is_empty() { outcomes[best].1 } else { folds(chosen, &answers)?.1 };
    Ok((fit(&|_| true, &answers, chosen)?, platt, chosen))
}

/// Share of the zones of left-out scenes that are familiar to the others.
const FAMILIAR: f64 = 0.95;

/// What pictures the zones of `groups` show, and how far from those of the others the zones of each group lie. `None` if the
/// descriptor does not tell noise from picture.
fn familiarity(table: &Table, groups: &[&str], scaler: &Scaler) -> Option<Familiarity> {
    let whole = table.descriptor.len();
    if table.descriptor.texture_numbers() == 0 {
        return None;
    }
    let known: Vec<(&str, Vec<f32>)> = table
        .zones
        .iter()
        .filter(|zone| groups.contains(&zone.group.as_str()))
        .filter_map(|zone| {
            // A descriptor of which numbers were taken away does not say which are left.
            let mut numbers = zone.at_threshold()?.descriptor.clone();
            (numbers.len() == whole).then(|| {
                scaler.apply(&mut numbers);
                (zone.group.as_str(), table.descriptor.texture_of(&numbers))
            })
        })
        .collect();
    let others = |group| known.iter().filter(move |(of, _)| *of != group).map(|(_, numbers)| numbers);
    let mut distances: Vec<f32> =
        known.iter().map(|(group, numbers)| nearest(others(*group), numbers)).collect();
    distances.sort_by(f32::total_cmp);
    let within = (FAMILIAR * distances.len() as f64).ceil() as usize;
    let reach = *distances.get(within.checked_sub(1)?)?;
    Some(Familiarity { zones: known.into_iter().map(|(_, numbers)| numbers).collect(), reach })
}

fn check(table: &Table, params: &TrainParams, needed: usize) -> Result<(), TrainError> {
    let sound = params.range > 1.0 && params.spread > 0.0 && !params.candidates.is_empty();
    if !sound {
        return Err(TrainError::Params);
    }
    let groups = table.groups();
    if groups.len() < needed {
        return Err(TrainError::Groups { needed, found: groups.len(), names: groups.join(", ") });
    }
    let expected = table.zones.iter().flat_map(|z| &z.levels).map(|l| l.descriptor.len()).next().unwrap_or(0);
    match table.answers.iter().map(|a| a.descriptor.len()).find(|&found| found != expected) {
        Some(found) => Err(TrainError::Answer { expected, found }),
        None => Ok(()),
    }
}

/// Predicts every zone, at P = `threshold`, by a model that has seen nothing of its group, not even to choose C, γ or the
/// sigmoid. `on_fold` is called before each group with its name.
///
/// # Errors
/// [`TrainError`] if the table has fewer than three groups, or training fails.
pub fn leave_one_scene_out(
    table: &Table,
    params: &TrainParams,
    threshold: f32,
    mut on_fold: impl FnMut(&str),
) -> Result<Vec<Prediction>, TrainError> {
    check(table, params, 3)?;
    let groups = table.groups();
    let mut predictions = Vec::new();
    for &left_out in &groups {
        on_fold(left_out);
        let others: Vec<&str> = groups.iter().copied().filter(|&g| g != left_out).collect();
        let (machine, platt, _) = fit_groups(table, &others, params)?;
        let known = familiarity(table, &others, &machine.scaler);
        let model = machine.into_model(table, platt, known, TrainingRecord::default());
        let zones = table.zones.iter().filter(|z| z.group == left_out);
        predictions.extend(zones.map(|z| predict(&model, threshold, z)));
    }
    Ok(predictions)
}

/// P of each of the table's answers, in their order, by a model that has learned nothing of its group, neither answers nor zones. `on_fold` is
/// called before each group of answers with its name.
///
/// # Errors
/// [`TrainError`] if fewer than two groups of zones are left, or training fails.
pub fn leave_answers_out(
    table: &Table,
    params: &TrainParams,
    mut on_fold: impl FnMut(&str),
) -> Result<Vec<f32>, TrainError> {
    let mut probabilities = vec![0.0; table.answers.len()];
    for group in table.answer_groups() {
        on_fold(group);
        let mut rest = table.clone();
        rest.zones.retain(|z| z.group != group);
        rest.answers.retain(|a| a.group != group);
        let model = train(&rest, params, String::new(), None)?;
        for (p, answer) in probabilities.iter_mut().zip(&table.answers) {
            if answer.group == group {
                *p = answer.probability(&model);
            }
        }
    }
    Ok(probabilities)
}

/// Trains a model on all of a table. `corpus` says in words where it comes from; `leave_one_scene_out` are the scores of
/// [`leave_one_scene_out`], where they were computed.
///
/// # Errors
/// [`TrainError`] if the table has fewer than two groups, or training fails.
pub fn train(
    table: &Table,
    params: &TrainParams,
    corpus: String,
    leave_one_scene_out: Option<Scores>,
) -> Result<Model, TrainError> {
    check(table, params, 2)?;
    let (machine, platt, SvmParams { c, gamma }) = fit_groups(table, &table.groups(), params)?;
    let known = familiarity(table, &table.groups(), &machine.scaler);
    let record = TrainingRecord {
        corpus,
        table_digest: table.digest(),
        scenes: table.scenes().into_iter().map(str::to_owned).collect(),
        examples: table.zones.iter().map(|z| examples(z, params.range).count()).sum::<usize>()
            + table.answers.len(),
        c,
        gamma,
        leave_one_scene_out,
    };
    Ok(machine.into_model(table, platt, known, record))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::Descriptor;
    use crate::display::ToneMapping;
    use crate::evaluation::{Level, Origin};
    use crate::evidence::Evidence;

    /// Scenes where people stop at noise 0.01, whatever else: the first number is ln(noise), the others distract.
    fn table(scenes: usize) -> Table {
        let dimensions = Descriptor::default().len();
        let mut state = 9u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let mut zones = Vec::new();
        for scene in 0..scenes {
            for zone in 0..6u32 {
                let noise_at_one = 0.1 + 0.3 * uniform();
                let human_spp = f64::from(noise_at_one / 0.01).powi(2);
                let levels = (0..24)
                    .map(|i| {
                        let spp = 20.0 * 1.3f64.powi(i);
                        let noise = noise_at_one / (spp as f32).sqrt();
                        let mut descriptor: Vec<f32> = (0..dimensions).map(|_| uniform()).collect();
                        descriptor[0] = noise.ln();
                        Level { spp, origin: Origin::Real, noise, descriptor }
                    })
                    .collect();
                let (scene, group) = (format!("scene{scene}"), format!("scene{scene}"));
                zones.push(Zone {
                    scene,
                    group,
                    zone,
                    human_spp,
                    censored: false,
                    first_spp: 20.0,
                    last_spp: 8000.0,
                    levels,
                });
            }
        }
        let tone_mapping = ToneMapping::Srgb { exposure: 1.0 };
        Table {
            descriptor: Descriptor::default(),
            evidence: Evidence::Halves,
            tone_mapping,
            zones,
            answers: Vec::new(),
        }
    }

    #[test]
    fn finds_the_rule_that_people_follow_on_scenes_it_has_not_seen() {
        let predictions =
            leave_one_scene_out(&table(4), &TrainParams::default(), DEFAULT_THRESHOLD, |_| ()).unwrap();
        assert_eq!(predictions.len(), 24);
        // P = 0.9 is where nine in ten agree: by the psychometric function, a little before the recorded threshold of 95 %.
        let params = TrainParams::default();
        let nine_in_ten = (-params.spread * (19.0f64 / 9.0).ln()).exp();
        assert!((observers_agreeing(nine_in_ten, 1.0, params.spread) - 0.9).abs() < 1e-9);
        let errors = predictions.iter().map(|p| (p.predicted_spp / p.human_spp / nine_in_ten).ln().abs());
        let error_factor = (errors.sum::<f64>() / 24.0).exp();
        assert!(error_factor < 1.2, "{error_factor}");
    }

    /// The rule is noise 0.01: who still sees noise at half of that, in a picture of a group of its own, lowers P there, and who sees none at
    /// twice as much raises it there; a model that has left that picture out is as if nothing had been said.
    #[test]
    fn answers_move_p_their_way_and_are_left_out_with_their_picture() {
        let plain = table(4);
        let params = TrainParams::default();
        let before = train(&plain, &params, String::new(), None).unwrap();
        for (noise, sees_noise) in [(0.005f32, true), (0.02, false)] {
            let mut descriptor = vec![0.5; Descriptor::default().len()];
            descriptor[0] = noise.ln();
            let answer = Answer { group: "mine".into(), spp: 100.0, descriptor, sees_noise };
            let told = Table { answers: vec![answer.clone(); 3], ..plain.clone() };
            assert_ne!(told.digest(), plain.digest());
            let after = train(&told, &params, String::new(), None).unwrap();
            let (p, q) = (answer.probability(&before), answer.probability(&after));
            assert!(
                if sees_noise { q < p - 0.01 } else { q > p + 0.01 },
                "{sees_noise}: {p} before, {q} after"
            );
            let mut asked = Vec::new();
            let left_out = leave_answers_out(&told, &params, |group| asked.push(group.to_owned())).unwrap();
            assert_eq!((left_out, asked), (vec![p; 3], vec!["mine".to_owned()]));

            // Of a group of zones, answers are left out with them.
            let same = Table {
                answers: vec![Answer { group: "scene0".into(), ..answer.clone() }; 3],
                ..plain.clone()
            };
            let of = |table: &Table| {
                let all = leave_one_scene_out(table, &params, DEFAULT_THRESHOLD, |_| ()).unwrap();
                all.into_iter().filter(|p| p.scene == "scene0").collect::<Vec<_>>()
            };
            assert_eq!(of(&same), of(&plain));
            assert_ne!(of(&told), of(&plain));
        }
        let short = Answer { group: "mine".into(), spp: 1.0, descriptor: vec![0.0], sees_noise: true };
        let error =
            train(&Table { answers: vec![short], ..plain }, &params, String::new(), None).unwrap_err();
        assert!(matches!(error, TrainError::Answer { expected: 6, found: 1 }), "{error}");
    }

    /// Zones at 0, 1, 2, … in one number of texture, each of a group of its own: all are 1 from the next.
    #[test]
    fn what_scenes_have_in_common_is_familiar() {
        let mut table = table(4);
        table.zones.truncate(20);
        for (i, zone) in table.zones.iter_mut().enumerate() {
            zone.group = format!("{i}");
            for level in &mut zone.levels {
                level.descriptor[1..].fill(0.0);
                level.descriptor[1] = i as f32;
            }
        }
        // One lies apart: it is the one in twenty that is not familiar to the others.
        table.zones[19].levels.iter_mut().for_each(|level| level.descriptor[1] = 30.0);
        let scaler = Scaler::identity(table.descriptor.len());
        let known = familiarity(&table, &table.groups(), &scaler).unwrap();
        assert_eq!(known.reach, 1.0);
        let includes = |texture: f32| {
            let mut numbers = vec![0.0; table.descriptor.texture_numbers()];
            numbers[0] = texture;
            known.includes(&numbers)
        };
        assert!(includes(-1.0) && includes(18.9) && includes(30.5));
        assert!(!includes(-1.1) && !includes(25.0) && !includes(40.0));
    }

    #[test]
    fn too_few_groups_are_an_error() {
        assert!(matches!(
            leave_one_scene_out(&table(2), &TrainParams::default(), DEFAULT_THRESHOLD, |_| ()),
            Err(TrainError::Groups { .. })
        ));
        assert!(matches!(
            train(&table(1), &TrainParams::default(), String::new(), None),
            Err(TrainError::Groups { .. })
        ));
    }

    #[test]
    fn training_is_deterministic_and_survives_the_file() {
        let params =
            TrainParams { candidates: vec![SvmParams { c: 1.0, gamma: 0.01 }], ..TrainParams::default() };
        let one = train(&table(3), &params, "synthetic".into(), None).unwrap();
        let two = train(&table(3), &params, "synthetic".into(), None).unwrap();
        assert_eq!(one, two);
        let mut file = Vec::new();
        one.write(&mut file).unwrap();
        assert_eq!(Model::read(&file[..]).unwrap(), one);
    }

    #[test]
    fn the_recorded_threshold_is_the_95th_percentile() {
        assert!((observers_agreeing(300.0, 300.0, 0.3) - 0.95).abs() < 1e-12);
        assert!(observers_agreeing(30.0, 300.0, 0.3) < 0.02);
    }
}
