//! What came of training.

use noisefloor::{Model, model::Scores, svm::Machine};
use noisefloor_cli::say::{NotSaid, say};
use std::path::Path;

pub(super) fn say_model(model: &Model, out: &Path) -> Result<(), NotSaid> {
    say!(
        "{} from {} examples, C = {}, γ = {}; written to {}",
        match &model.classifier().machine {
            Machine::Line(_) => "a line".to_owned(),
            Machine::Svm(svm) => format!("{} support vectors", svm.coefficients.len()),
        },
        model.record().examples,
        model.record().c,
        model.record().gamma,
        out.display()
    )
}

pub(super) fn say_scores(when: &str, s: Scores) -> Result<(), NotSaid> {
    say!(
        "{when}on left-out scenes: error factor {:.3}, bias factor {:.3}, {:.1} % of {} zones stopped below half",
        s.error_factor,
        s.bias_factor,
        100.0 * s.early_share,
        s.zones
    )
}
