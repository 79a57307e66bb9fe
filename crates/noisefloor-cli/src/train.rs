//! `noisefloor train`, and what it shares with `evaluate`.

use crate::args::{DataArgs, SearchArgs, TrainArgs};
use crate::bars::bar;
use anyhow::{Context, bail};
use noisefloor::{Descriptor, Evidence, Model, NoiseMask, SvmParams};
use noisefloor_image::{check_writable, write_atomic};
use noisefloor_learn::{Corpora, describe_corpora, read_table, write_table};
use noisefloor_learn::{Prediction, Table, score};
use noisefloor_learn::{TrainParams, leave_one_scene_out, train};
use noisefloor_study::explore::{AnswerAgreement, LearnStep, read_answers, retrain};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

pub fn run(args: &TrainArgs) -> anyhow::Result<()> {
    let params = search(&args.search)?;
    for path in args.save_table.iter().chain([&args.out]) {
        check_writable(path)?;
    }
    let table = load_table(&args.data, &descriptor(&args.search)?, args.search.evidence.into())?;
    if let Some(path) = &args.save_table {
        write_atomic(path, |to| write_table(&table, to))?;
        eprintln!("table of {} zones written to {}", table.zones.len(), path.display());
    }

    let corpus = match &args.data.table {
        Some(path) => path.display().to_string(),
        None => args.data.corpus.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", "),
    };
    if let Some(database) = &args.disagreements {
        return with_disagreements(args, &table, &params, database, &corpus);
    }

    // Scores on scenes left out, where there are enough to leave one out and still choose among the others.
    let scores = if args.no_scores || table.groups().len() < 3 {
        None
    } else {
        let predictions = held_out(&table, &params, noisefloor::Threshold::PAPER)?;
        Some(score(predictions.iter()))
    };
    eprintln!("training on all scenes");
    let model = train(&table, &params, corpus, scores)?;
    write_atomic(&args.out, |to| model.write(to))?;

    print_model(&model, &args.out);
    if let Some(s) = scores {
        println!(
            "on left-out scenes: error factor {:.3}, bias factor {:.3}, {:.1} % of {} zones stopped below half",
            s.error_factor,
            s.bias_factor,
            100.0 * s.early_share,
            s.zones
        );
    }
    Ok(())
}

fn print_model(model: &Model, out: &Path) {
    println!(
        "{} support vectors of {} examples, C = {}, γ = {}; written to {}",
        model.classifier().svm.coefficients.len(),
        model.record().examples,
        model.record().c,
        model.record().gamma,
        out.display()
    );
}

/// Trains on a table and on what people said against verdicts, and says what that has changed.
fn with_disagreements(
    args: &TrainArgs,
    table: &Table,
    params: &TrainParams,
    database: &Path,
    corpus: &str,
) -> anyhow::Result<()> {
    let all = read_answers(database)?;
    let fitting = all.iter().filter(|d| d.said.fits(&table.descriptor, table.evidence));
    let answers: Vec<_> = fitting.map(|d| d.said.answer()).collect();
    if answers.is_empty() {
        bail!(
            "{}: none of {} disagreements was described as the table is; disagree with a verdict in `noisefloor explore`, or train without --disagreements",
            database.display(),
            all.len()
        );
    }
    if answers.len() < all.len() {
        eprintln!(
            "note: {} of {} disagreements were described in another way than the table, and are left out",
            all.len() - answers.len(),
            all.len()
        );
    }
    let bar = bar(0, "parts");
    let on_step = |step: LearnStep| {
        bar.set_length(step.of as u64);
        bar.set_position(step.done as u64);
        bar.set_message(step.doing);
    };
    let base = (&Model::bundled(), noisefloor::Threshold::PAPER);
    let (model, learned) = retrain(table, answers, params, base, corpus, on_step)?;
    bar.finish_and_clear();
    write_atomic(&args.out, |to| model.write(to))?;
    print_model(&model, &args.out);
    if let (Some(before), Some(after)) = (learned.before, learned.after) {
        for (name, s) in [("before", before), ("after", after)] {
            println!(
                "{name:6} on left-out scenes: error factor {:.3}, bias factor {:.3}, {:.1} % of {} zones stopped below half",
                s.error_factor,
                s.bias_factor,
                100.0 * s.early_share,
                s.zones
            );
        }
    }
    let AnswerAgreement { of, before, fitted, left_out } = learned.agreement;
    println!(
        "of {of} disagreements, the verdict is right for {before} before, {fitted} after, and {left_out} after with their scene left out"
    );
    if !learned.worse.is_empty() {
        println!("people's thresholds are predicted worse now: {}", learned.worse.join("; "));
    }
    Ok(())
}

/// Predictions on left-out scenes, with a bar.
pub fn held_out(
    table: &Table,
    params: &TrainParams,
    threshold: noisefloor::Threshold,
) -> anyhow::Result<Vec<Prediction>> {
    let bar = bar(table.groups().len() as u64, "scenes left out");
    let mut begun = false;
    let predictions = leave_one_scene_out(table, params, threshold, |group| {
        if begun {
            bar.inc(1);
        }
        begun = true;
        bar.set_message(group.to_owned());
    })?;
    bar.finish_and_clear();
    Ok(predictions)
}

/// The table that was asked for: read, or computed from pictures.
pub fn load_table(data: &DataArgs, descriptor: &Descriptor, evidence: Evidence) -> anyhow::Result<Table> {
    if let Some(path) = &data.table {
        return read_table_file(path);
    }
    let bar = bar(0, "zones described");
    let table = describe_corpora(Corpora::new(&data.corpus), descriptor, evidence, |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    Ok(table)
}

/// A table that `train --save-table` wrote.
pub fn read_table_file(path: &Path) -> anyhow::Result<Table> {
    let file = File::open(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    read_table(BufReader::new(file)).with_context(|| format!("{}", path.display()))
}

/// The descriptor to train with, checked.
pub fn descriptor(args: &SearchArgs) -> anyhow::Result<Descriptor> {
    Ok(Descriptor::compact(NoiseMask::try_from(args.sigma).context("--sigma")?))
}

/// How to train, checked.
pub fn search(args: &SearchArgs) -> anyhow::Result<TrainParams> {
    let mut params = TrainParams::default();
    let given = |values: &[f64], default: fn(&SvmParams) -> f64| -> Vec<f64> {
        if !values.is_empty() {
            return values.to_vec();
        }
        let mut all: Vec<f64> = TrainParams::default().candidates.iter().map(default).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    let (cs, gammas) = (given(&args.c, |p| p.c), given(&args.gamma, |p| p.gamma));
    if let Some(bad) = cs.iter().chain(&gammas).find(|v| !(v.is_finite() && **v > 0.0)) {
        bail!("C and γ must be positive numbers, not {bad}");
    }
    params.candidates =
        cs.iter().flat_map(|&c| gammas.iter().map(move |&gamma| SvmParams { c, gamma })).collect();
    Ok(params)
}
