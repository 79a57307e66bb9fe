//! Studies of simulated observers, without a server.
#![allow(clippy::mod_module_files, reason = "a file of examples/ would be an example")]

use noisefloor_image::write_png;
use noisefloor_study::analysis::{AnalysisOptions, Observer, StudyReport, report};
use noisefloor_study::simulated::{Public, run};
use noisefloor_study::{ParticipantSession, Plan, Study, grids};
use std::sync::Arc;
use tempfile::TempDir;

/// A study of one stack with two tiles.
#[allow(dead_code, reason = "not every example has two tiles")]
pub(crate) fn study(protocol: &str, levels: &[u64], extra: &str) -> (TempDir, Arc<Study>) {
    study_of(protocol, levels, 2, extra)
}

/// A study of one stack with so many tiles. The pictures are grey: simulated observers do not look at them.
pub(crate) fn study_of(protocol: &str, levels: &[u64], tiles: usize, extra: &str) -> (TempDir, Arc<Study>) {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let stack = dir.path().join("wall");
    std::fs::create_dir(&stack).expect("a folder for the stack");
    for spp in levels {
        let grey = vec![128; 3 * 16 * tiles * 16];
        write_png(stack.join(format!("{spp:05}.png")), 16 * tiles, 16, &grey).expect("a picture");
    }
    let text = format!(
        "protocol = \"{protocol}\"\ndatabase = \"answers.sqlite\"\ntile = 16\n{extra}\n\
         [text.en]\ntitle = \"Walls\"\nconsent = \"I take part.\"\n\
         [[stack]]\nname = \"wall\"\nfolder = \"wall\"\n"
    );
    let file = dir.path().join("study.toml");
    std::fs::write(&file, text).expect("a study file");
    let study = Study::open(file).expect("a valid study");
    (dir, Arc::new(study))
}

#[allow(dead_code, reason = "not every example has these")]
/// The paper's hundred levels: 100 to 10 000 samples per pixel.
pub(crate) fn papers_levels() -> Vec<u64> {
    (1..=100).map(|i| 100 * i).collect()
}

#[allow(dead_code, reason = "not every example has this")]
/// The analysis of a study by simulated observers, and the observers.
pub(crate) fn simulate(
    study: &Arc<Study>,
    public: &Public,
    observers: u64,
    seed: u64,
) -> (StudyReport, Vec<Observer>) {
    let grids = grids(study);
    let observe = |i: u64| {
        let seed = 1000 * seed + i;
        let mut session = ParticipantSession::new(study.clone(), grids.clone(), Plan::draw(study, seed));
        run(&mut session, &mut public.draw(seed)).expect("simulated observers answer what is asked");
        Observer::of(&format!("simulated {i}"), "", &session)
    };
    let all: Vec<Observer> = (0..observers).map(observe).collect();
    (report(study, &all, AnalysisOptions { keep_excluded: false, seed, simulated: true }), all)
}
