//! Train: learns a model from human thresholds, and scores it on scenes it has not seen.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{Model, People, descriptor::Descriptor, evidence::Evidence};
use noisefloor_image::write_atomic;
use noisefloor_learn::{Corpora, describe_corpora, read_table};
use noisefloor_learn::{Prediction, Table, constant_noise_baseline, score};
use noisefloor_learn::{TrainParams, leave_one_scene_out, train};
use std::error::Error;
use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// What people said of the scenes that the bundled model has learned from, with the descriptors of their
/// pictures.
const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/human-table.csv");
const OUT: &str = "out/example.nfm";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    // From the pictures of corpus folders, or from the table that ships, which needs no pictures.
    let folders: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let corpus = match folders.as_slice() {
        [] => "fixtures/human-table.csv".to_owned(),
        folders => folders.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", "),
    };
    let table = match folders.as_slice() {
        [] => match File::open(TABLE) {
            Ok(file) => read_table(BufReader::new(file)).map_err(|error| format!("{TABLE}: {error}"))?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                println!("nothing to train on: {TABLE} is not there, and no corpus folder was named");
                return Ok(());
            }
            Err(error) => return Err(format!("{TABLE}: {error}").into()),
        },
        folders => {
            describe_corpora(Corpora::new(folders), &Descriptor::default(), Evidence::Halves, |done, all| {
                eprintln!("{done} of {all} zones described");
            })?
        }
    };
    println!("{} zones of {} scenes", table.zones.len(), table.scenes().len());

    // How good is it where it matters: on scenes the model has never seen, beside a plain limit on the noise.
    let params = TrainParams::for_descriptor(&table.descriptor);
    let predictions = leave_one_scene_out(&table, &params, People::DEFAULT, |group| {
        eprintln!("training without {group} …");
    })?;
    report(&table, &predictions);

    // The model to use has learned from all scenes.
    let scores = score(predictions.iter());
    let model = train(&table, &params, corpus, Some(scores))?;
    if let Some(folder) = Path::new(OUT).parent() {
        fs::create_dir_all(folder)?;
    }
    write_atomic(OUT, |to| model.write(to))?;

    // Read it back, as `noisefloor render --model` and `Oracle::new(Model::read(…)?, …)` do.
    let read = Model::read(BufReader::new(File::open(OUT)?))?;
    println!("{OUT}: a {}, digest {}", read.classifier().machine.name(), &read.digest()[..12]);
    Ok(())
}

fn report(table: &Table, predictions: &[Prediction]) {
    let baseline = constant_noise_baseline(table);
    println!("{:20} zones   error    bias   stopped early   one noise level for all", "left out");
    let line = |name: &str, of: &dyn Fn(&&Prediction) -> bool| {
        let scores = score(predictions.iter().filter(of));
        let plain = score(baseline.iter().filter(of));
        println!(
            "{name:20} {:5}   ×{:.2}   ×{:.2}   {:11.0} %   ×{:.2}",
            scores.zones,
            scores.error_factor,
            scores.bias_factor,
            100.0 * scores.early_share,
            plain.error_factor
        );
    };
    for scene in table.scenes() {
        line(scene, &|p| p.scene == scene);
    }
    line("all", &|_| true);
    println!(
        "error: how far predictions are off, as a factor; bias: below 1 stops early, above 1 late; early: below half of what\n\
         people needed"
    );
}
