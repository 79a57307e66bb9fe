//! Learning a model from a table of human thresholds, and scoring it on scenes it has not seen.

use crate::fit::{familiarity, fit_groups, parts, predict_without};
use crate::machine::examples;
use crate::params::{TrainError, TrainParams};
use crate::predict::Prediction;
use crate::table::Table;
use noisefloor::svm::SvmParams;
use noisefloor::{
    Model, People,
    model::{Scores, TrainingRecord},
};

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

/// Predicts every zone, at that share of people, by a model that has seen nothing of its group, not even to choose
/// C, γ or the sigmoid. `on_fold` is called before each group with its name.
pub fn leave_one_scene_out(
    table: &Table,
    params: &TrainParams,
    people: People,
    mut on_fold: impl FnMut(&str),
) -> Result<Vec<Prediction>, TrainError> {
    check(table, params, 3)?;
    let groups = table.groups();
    let mut predictions = Vec::new();
    for &left_out in &groups {
        on_fold(left_out);
        let others: Vec<&str> = groups.iter().copied().filter(|&g| g != left_out).collect();
        predictions.extend(predict_without(table, left_out, &others, params, people)?.0);
    }
    Ok(predictions)
}

/// P of each of the table's answers, in their order, by a model that has learned nothing of its group,
/// neither answers nor zones. `on_fold` is called before each group of answers with its name.
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

/// Trains a model on all of a table. `corpus` says in words where it comes from; `leave_one_scene_out` are
/// the scores of
/// [`leave_one_scene_out`], where they were computed.
pub fn train(
    table: &Table,
    params: &TrainParams,
    corpus: String,
    leave_one_scene_out: Option<Scores>,
) -> Result<Model, TrainError> {
    check(table, params, 2)?;
    let (classifier, SvmParams { c, gamma }) = fit_groups(table, &table.groups(), params)?;
    let known = familiarity(table, &table.groups(), &classifier.scaler);
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
    Ok(Model::new(parts(table, classifier, known, record))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::Answer;
    use crate::table::{Level, Origin, Zone};
    use noisefloor::{descriptor::Descriptor, evidence::Evidence};

    /// Scenes where people stop at noise 0.01, whatever else: the first number is ln(noise), the others
    /// distract.
    fn table(scenes: usize) -> Table {
        let dimensions = Descriptor::default().dimensions();
        // Not the testkit's `Noise`: the bounds below were measured with this sequence, and are not those of every other
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
                        // In a unit in which people stop at 1: the descriptor has a floor of noise
                        descriptor[0] = (100.0 * noise).ln();
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
                    reference_spp: f64::INFINITY,
                    levels,
                });
            }
        }
        Table::new(Descriptor::default(), Evidence::Halves, zones)
    }

    #[test]
    fn finds_the_rule_that_people_follow_on_scenes_it_has_not_seen() {
        for params in [TrainParams::default(), TrainParams::svm()] {
            let predictions = leave_one_scene_out(&table(4), &params, People::DEFAULT, |_| ()).unwrap();
            assert_eq!(predictions.len(), 24);
            let errors = predictions.iter().map(|p| (p.predicted_spp / p.human_spp).ln().abs());
            let error_factor = (errors.sum::<f64>() / 24.0).exp();
            assert!(error_factor < 1.2, "{error_factor}");
        }
    }

    /// The rule is noise 0.01: who still sees noise at half of that, in a picture of a group of its own,
    /// lowers P there, and who sees none at twice as much raises it there; a model that has left that picture
    /// out is as if nothing had been said.
    #[test]
    fn answers_move_p_their_way_and_are_left_out_with_their_picture() {
        let plain = table(4);
        let params = TrainParams::default();
        let before = train(&plain, &params, String::new(), None).unwrap();
        for (noise, sees_noise) in [(0.005f32, true), (0.02, false)] {
            let mut descriptor = vec![0.5; Descriptor::default().dimensions()];
            descriptor[0] = (100.0 * noise).ln();
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
            let predictions = |table: &Table| {
                let all = leave_one_scene_out(table, &params, People::DEFAULT, |_| ()).unwrap();
                all.into_iter().filter(|p| p.scene == "scene0").collect::<Vec<_>>()
            };
            assert_eq!(predictions(&same), predictions(&plain));
            assert_ne!(predictions(&told), predictions(&plain));
        }
        let short = Answer { group: "mine".into(), spp: 1.0, descriptor: vec![0.0], sees_noise: true };
        let error =
            train(&Table { answers: vec![short], ..plain }, &params, String::new(), None).unwrap_err();
        assert!(matches!(error, TrainError::Answer { expected: 5, found: 1 }), "{error}");
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
        let scaler = noisefloor::svm::Scaler::identity(table.descriptor.dimensions());
        let known = familiarity(&table, &table.groups(), &scaler).unwrap();
        assert_eq!(known.reach, 1.0);
        let includes = |texture: f32| {
            let mut numbers = vec![0.0; table.descriptor.texture().len()];
            numbers[0] = texture;
            known.includes(&numbers)
        };
        assert!(includes(-1.0) && includes(18.9) && includes(30.5));
        assert!(!includes(-1.1) && !includes(25.0) && !includes(40.0));
    }

    #[test]
    fn too_few_groups_are_an_error() {
        let params = TrainParams::default();
        let left_out = leave_one_scene_out(&table(2), &params, People::DEFAULT, |_| ());
        assert!(matches!(left_out, Err(TrainError::Groups { .. })));
        let trained = train(&table(1), &params, String::new(), None);
        assert!(matches!(trained, Err(TrainError::Groups { .. })));
    }

    #[test]
    fn thresholds_beyond_all_levels_teach_nothing() {
        for params in [TrainParams::default(), TrainParams::svm()] {
            let mut beyond = table(4);
            beyond.zones.iter_mut().for_each(|zone| zone.human_spp = 1e9);
            let error = train(&beyond, &params, String::new(), None).unwrap_err().to_string();
            assert!(error.contains("there are no examples; do all thresholds lie outside"), "{error}");
        }
    }

    /// Machines of both kinds say what is wrong with what people are said to have seen, and not what a solver met.
    #[test]
    fn thresholds_that_have_nothing_to_do_with_the_noise_are_an_error_in_words() {
        for params in [TrainParams::default(), TrainParams::svm()] {
            let refuse = |table: &Table, words: &[&str]| {
                let error = train(table, &params, String::new(), None).unwrap_err();
                let said = error.to_string();
                assert!(words.iter().all(|word| said.contains(word)), "{said}");
                // Nor in what a command prints after it
                assert!(std::error::Error::source(&error).is_none(), "{error:?}");
            };

            // Nobody has reached a threshold
            let mut censored = table(4);
            censored.zones.iter_mut().for_each(|zone| zone.censored = true);
            refuse(&censored, &["examples without those of scene0 are noisy", "not all zones are censored"]);
            // The first level is clean enough for all
            let mut clean = table(4);
            clean.zones.iter_mut().for_each(|zone| zone.human_spp = 20.0);
            refuse(&clean, &["are converged", "between the first and the last level"]);
            // In no order, with one threshold for all
            for seed in 0..4 {
                let mut mixed = table(4);
                let mut random = noisefloor_testkit::Noise::new(seed);
                for zone in &mut mixed.zones {
                    zone.human_spp = 400.0;
                    for i in (1..zone.levels.len()).rev() {
                        let j = (random.uniform() * (i + 1) as f64) as usize;
                        let other = zone.levels[j].descriptor.clone();
                        zone.levels[j].descriptor = std::mem::replace(&mut zone.levels[i].descriptor, other);
                    }
                }
                refuse(
                    &mixed,
                    &["does not follow the noise", "of 4 groups of scenes (scene", "its own zone"],
                );
            }
        }
    }

    /// A line separates these classes, and nothing holds it back: it is steep, and still a model.
    #[test]
    fn next_to_no_penalty_is_survived() {
        let candidates = vec![SvmParams { c: 1e300, gamma: 1e-4 }];
        let model =
            train(&table(3), &TrainParams { candidates, ..TrainParams::default() }, String::new(), None);
        let clean = table(3).zones[0].levels.last().map(|level| level.descriptor.clone()).unwrap();
        assert!(model.unwrap().judge(&clean).probability > 0.9);
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
}
