//! `noisefloor evaluate`.

use crate::args::{EvaluateArgs, load_model};
use crate::bars::Bars;
use crate::output::{write_csv, write_json};
use crate::train::{descriptor, held_out, load_table, search};
use anyhow::{anyhow, bail};
use noisefloor::Model;
use noisefloor::Scores;
use noisefloor_image::{check_writable, write_atomic};
use noisefloor_lab::rivals::{self, RatedRival};
use noisefloor_lab::{Advance, figures};
use noisefloor_learn::observers_agreeing;
use noisefloor_learn::{
    Prediction, ReliabilityBin, Table, calibration_error, constant_noise_baseline, image_accuracy, predict,
    reliability, scene_median_baseline, score,
};
use serde::Serialize;
use std::io::Write;

/// Scores of one way to predict.
#[derive(Serialize)]
struct Summary {
    #[serde(flatten)]
    scores: Scores,
    /// Of real pictures alone.
    image_accuracy: Option<f64>,
}

#[derive(Serialize)]
struct Baselines {
    constant: Summary,
    scene_median: Summary,
}

#[derive(Serialize)]
struct SceneSummary {
    scene: String,
    #[serde(flatten)]
    summary: Summary,
    baselines: Baselines,
}

#[derive(Serialize)]
struct Report {
    /// `leave-one-scene-out`, or the digest of the model scored.
    predicted_by: String,
    #[serde(flatten)]
    summary: Summary,
    baselines: Baselines,
    scenes: Vec<SceneSummary>,
    /// P against the share of observers who see no difference, as `training::observers_agreeing` has it.
    reliability: Vec<ReliabilityBin>,
    calibration_error: f64,
    /// P against the recorded mean threshold as a step from 0 to 1, which P does not stand for.
    calibration_error_of_step: f64,
    /// Zones whose human threshold is only a lower bound: not in the factors.
    censored_zones: usize,
    /// Zones unlike any that the model which predicts them was tried on.
    unfamiliar_zones: usize,
    levels_real: usize,
    levels_synthesised: usize,
    /// Other criteria on the same zones, if `--rivals` asked for them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    rivals: Vec<RatedRival>,
}

pub fn run(args: &EvaluateArgs) -> anyhow::Result<()> {
    let params = search(&args.search)?;
    for path in args.json.iter().chain(&args.csv) {
        check_writable(path)?;
    }
    let model = if args.leave_one_scene_out { None } else { Some(load_model(args.model.as_deref())?) };
    // A model is scored by its own descriptor and evidence.
    let trained_with = (descriptor(&args.search)?, args.search.evidence.into());
    let (descriptor, evidence) =
        model.as_ref().map_or(trained_with, |m| (m.descriptor().clone(), m.evidence()));
    let table = load_table(&args.data, &descriptor, evidence)?.without(&args.without).map_err(|name| {
        anyhow!("--without {name}: the numbers of the table are {}", descriptor.number_names().join(", "))
    })?;
    let (predicted_by, predictions) = match &model {
        None => ("leave-one-scene-out".to_owned(), held_out(&table, &params, args.threshold)?),
        Some(model) => {
            if (model.descriptor(), model.evidence()) != (&table.descriptor, table.evidence) {
                bail!(
                    "the model goes by the {} descriptor {:?} and {:?} as evidence, the table by {:?} and {:?}",
                    model.descriptor().name(),
                    model.descriptor(),
                    model.evidence(),
                    table.descriptor,
                    table.evidence
                );
            }
            (
                model.digest(),
                table.zones.iter().map(|z| predict(|raw| model.judge(raw), args.threshold, z)).collect(),
            )
        }
    };
    let mut report = Report::new(predicted_by, &table, &predictions, params.spread);
    if !args.rivals.is_empty() {
        let bars = Bars::new(false);
        report.rivals =
            rivals::rate(&args.data.corpus, &args.rivals, &|advance: Advance<'_>| bars.show(advance))?;
        bars.finish();
    }
    if let Some(path) = &args.json {
        write_json(path, &report)?;
    }
    if let Some(path) = &args.csv {
        write_csv(path, predictions.iter())?;
    }
    if let Some(dir) = &args.figures {
        figures::write_figures(dir, &args.data.corpus, &predictions, &report.reliability)?;
        if !args.rivals.is_empty() {
            let plot = rivals::plot_scene_means(&predictions, &report.rivals)?;
            write_atomic(dir.join("rivals.svg"), |to| to.write_all(plot.as_bytes()))?;
        }
    }
    report.print();
    if !args.rivals.is_empty() {
        print_rivals(&predictions, &report.rivals);
    }

    // What flatters a number stands beside it.
    let seen = |m: &Model| -> Vec<String> {
        m.record().scenes.iter().filter(|s| table.scenes().contains(&s.as_str())).cloned().collect()
    };
    let seen = model.as_ref().map(seen).unwrap_or_default();
    if !seen.is_empty() {
        println!("Note: the model was trained on these scenes: {}.", seen.join(", "));
    }
    if table.groups().len() == 1 {
        println!("Note: with one group of scenes, the constant is fitted to the very zones it predicts.");
    }
    Ok(())
}

impl Summary {
    fn of(predictions: &[&Prediction]) -> Self {
        let all = || predictions.iter().copied();
        Self { scores: score(all()), image_accuracy: image_accuracy(all()) }
    }
}

impl Report {
    fn new(predicted_by: String, table: &Table, predictions: &[Prediction], spread: f64) -> Self {
        let (constant, median) = (constant_noise_baseline(table), scene_median_baseline(table));
        let summarise = |of: &[Prediction], keep: &dyn Fn(&Prediction) -> bool| {
            Summary::of(&of.iter().filter(|p| keep(p)).collect::<Vec<_>>())
        };
        let baselines = |keep: &dyn Fn(&Prediction) -> bool| Baselines {
            constant: summarise(&constant, keep),
            scene_median: summarise(&median, keep),
        };
        let scene = |scene: &str| {
            let keep = |p: &Prediction| p.scene == scene;
            SceneSummary {
                scene: scene.into(),
                summary: summarise(predictions, &keep),
                baselines: baselines(&keep),
            }
        };
        let levels = || table.zones.iter().flat_map(|z| &z.levels);
        let real = levels().filter(|l| l.origin == noisefloor_learn::Origin::Real).count();
        let agreeing = |spp: f64, human: f64| observers_agreeing(spp, human, spread);
        let step = |spp: f64, human: f64| f64::from(u8::from(spp >= human));
        let curve = reliability(predictions.iter(), agreeing);
        Self {
            predicted_by,
            calibration_error: calibration_error(&curve),
            calibration_error_of_step: calibration_error(&reliability(predictions.iter(), step)),
            reliability: curve,
            summary: summarise(predictions, &|_| true),
            baselines: baselines(&|_| true),
            scenes: table.scenes().into_iter().map(scene).collect(),
            censored_zones: table.zones.iter().filter(|z| z.censored).count(),
            unfamiliar_zones: predictions.iter().filter(|p| p.unfamiliar).count(),
            levels_real: real,
            levels_synthesised: levels().count() - real,
            rivals: Vec::new(),
        }
    }

    fn print(&self) {
        println!("{:22} zones  error  bias   early  images right    constant noise    scene median", "scene");
        let line = |name: &str, s: &Summary, b: &Baselines| {
            // A scene of one zone has no median of others.
            let factor = |f: f64| if f.is_finite() { format!("×{f:.2}") } else { "–".into() };
            println!(
                "{name:22} {:5}  {:6} {:6} {:3.0} %  {:>12}    {:>14}    {:>12}",
                s.scores.zones,
                factor(s.scores.error_factor),
                factor(s.scores.bias_factor),
                100.0 * s.scores.early_share,
                s.image_accuracy.map_or("–".into(), |a| format!("{:.1} %", 100.0 * a)),
                format!(
                    "{}, {:.0} % early",
                    factor(b.constant.scores.error_factor),
                    100.0 * b.constant.scores.early_share
                ),
                factor(b.scene_median.scores.error_factor),
            );
        };
        for scene in &self.scenes {
            line(&scene.scene, &scene.summary, &scene.baselines);
        }
        line("all", &self.summary, &self.baselines);
        println!(
            "calibration error of P: {:.3} against the share of observers (assumed: logistic around the recorded threshold), {:.3} against \
             the recorded threshold as a step",
            self.calibration_error, self.calibration_error_of_step
        );
        println!(
            "error = exp(mean |ln(predicted/human)|); bias = exp(mean ln(predicted/human)); early = stopped below half the human threshold.\n\
             Thresholds are looked for on {} real and {} synthesised levels; \"images right\" counts real pictures alone. {} censored zones \
             stay out of the factors, {} zones are unfamiliar to the model that predicts them.\nThe scene median knows the scene's other zones, which no predictor of unseen scenes can.",
            self.levels_real, self.levels_synthesised, self.censored_zones, self.unfamiliar_zones
        );
    }
}

/// Says what came out, the model's own predictions first.
fn print_rivals(model: &[Prediction], rated: &[RatedRival]) {
    let known = || model.iter().filter(|p| !p.censored);
    println!(
        "\n{:44} {:>9} {:>9} {:>7} {:>7} {:>7}",
        "who stops", "constant", "mean spp", "error", "bias", "early"
    );
    println!("{:44} {:>9} {:9.0}", "people", "", rivals::mean(known().map(|p| p.human_spp)));
    let line = |name: &str, constant: String, spp: f64, s: &Scores| {
        println!(
            "{name:44} {constant:>9} {spp:9.0} {:>7} {:>7} {:5.0} %",
            format!("×{:.2}", s.error_factor),
            format!("×{:.2}", s.bias_factor),
            100.0 * s.early_share
        );
    };
    line("the model", String::new(), rivals::mean(known().map(|p| p.predicted_spp)), &score(model.iter()));
    for r in rated {
        line(r.title, format!("{:.2e}", r.constant), r.mean_spp, &r.scores);
    }
    println!(
        "Constants are those that agree with people on average; scores are with the constant of the other scenes. Rivals follow a rendering \
         that is synthesised from the pictures (noise ∝ 1/√n)."
    );
}
