//! How a model is trained, and why it cannot be.

use crate::choices::VISIBLE_CHOICES;
use noisefloor::svm::{SvmParams, SvmTrainError};
use noisefloor::{descriptor::Descriptor, model::ModelError};
use thiserror::Error;

/// γ of the kernel in which a straight line is kept.
pub(crate) const WIDE: f64 = 1e-4;

/// Numbers of the visible descriptor that decide. Texture and the light of the tile do not help on scenes that were left
/// out.
const WEIGHED: [&str; 3] = ["visible_noise", "picture_noise", "picture_light"];

/// What kind of machine is trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learner {
    /// A support vector machine, on examples that are noisy or converged (Takouachet et al. 2017, §5).
    Svm,
    /// Logistic regression on the share of observers who see no difference: it decides on a straight line. C
    /// is how little its weights are penalised; γ has no effect.
    Line,
}

/// How a model is to be trained.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainParams {
    pub learner: Learner,
    /// Pairs of C and γ to choose from, by leave-one-group-out.
    pub candidates: Vec<SvmParams>,
    /// Levels within this factor of the human threshold are examples; those beyond are clear anyway. Above 1.
    pub range: f64,
    /// How gradually noise disappears in the examples of a line: scale of a logistic function of ln(samples), above 0.
    /// P does not depend on it: its spread is that of predictions for scenes that were left out.
    pub spread: f64,
    /// Which numbers a line weighs, by name, of those that the table has; `None` for all. The others only tell which
    /// tiles are familiar.
    pub weighed: Option<Vec<String>>,
}

impl Default for TrainParams {
    /// Logistic regression, for the visible descriptor.
    fn default() -> Self {
        let candidates = vec![SvmParams { c: 40.0, gamma: WIDE }];
        Self { learner: Learner::Line, candidates, range: 8.0, spread: 0.8, weighed: None }
    }
}

impl TrainParams {
    /// A support vector machine, for descriptors other than the visible one.
    pub fn svm() -> Self {
        let candidates =
            [0.1, 0.3, 1.0].iter().flat_map(|&c| [0.003, 0.01].map(|gamma| SvmParams { c, gamma })).collect();
        Self { learner: Learner::Svm, candidates, ..Self::default() }
    }

    /// What serves a descriptor best: a line for those on the vision model, a machine for all others.
    pub fn for_descriptor(descriptor: &Descriptor) -> Self {
        if [Descriptor::visible().name(), VISIBLE_CHOICES.name].contains(&descriptor.name()) {
            Self { weighed: Some(WEIGHED.map(str::to_owned).to_vec()), ..Self::default() }
        } else {
            Self::svm()
        }
    }
}

/// Why a model could not be trained.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainError {
    #[error(transparent)]
    Svm(#[from] SvmTrainError),
    #[error(
        "all {examples} examples{} are {}, and training needs both: \
         check that every threshold lies between the first and the last level of its zone, \
         and that not all zones are censored",
        without.as_ref().map_or(String::new(), |group| format!(" without those of {group}")),
        if *converged { "converged" } else { "noisy" }
    )]
    Alike {
        /// The group that was left out, if one was.
        without: Option<String>,
        examples: usize,
        converged: bool,
    },
    #[error(
        "what people said does not follow the noise: in {} of {of} groups of scenes ({}), \
         what was learned from the others does not tell noisy examples from converged ones; \
         check that every threshold stands beside its own zone, \
         and that each zone's pictures are in the order of their samples",
        groups.len(),
        groups.join(", ")
    )]
    Unrelated {
        /// The groups of which this is so; of all together it is.
        groups: Vec<String>,
        of: usize,
    },
    #[error("training needs candidates for C and γ, a range above 1 and a spread above 0")]
    Params,
    #[error("an answer has {found} numbers, and the zones have {expected}: it is of another descriptor")]
    Answer { expected: usize, found: usize },
    #[error("leaving scenes out needs at least {needed} groups of scenes; the corpus has {found}: {names}")]
    Groups { needed: usize, found: usize, names: String },
    /// What was trained is not a model: numbers of the descriptor were removed.
    #[error("the result can be scored, but is not a model: {0}")]
    Model(#[from] ModelError),
}
