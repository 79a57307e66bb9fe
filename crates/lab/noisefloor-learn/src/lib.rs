//! From what people said of pictures to models of [`noisefloor`] and their scores.
//!
//! - [`Corpus`]: thresholds that observers gave, with the images they judged.
//! - [`describe_corpora`], [`describe_pairs`]: a corpus as a [`Table`] of descriptors; [`read_table`] and
//!   [`write_table`] keep it as CSV.
//! - [`train`]: a [`noisefloor::Model`] from a table; [`leave_one_scene_out`]: predictions for scenes that
//!   the model has not seen.
//! - [`score`], [`reliability`], [`constant_noise_baseline`], [`scene_median_baseline`]: how close
//!   predictions come to people.
//! - [`Evaluation`]: all of these scores together.
//! - [`AudienceFit`]: the line from the thresholds of one audience to those of another.

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

mod answer;
mod audience;
mod baselines;
mod choices;
mod corpus;
mod describe;
mod error;
mod evaluation;
mod fit;
mod line;
mod machine;
mod nested;
mod observers;
mod params;
mod predict;
mod score;
mod stimulus;
mod table;
mod table_csv;
mod train;

pub use answer::Answer;
pub use audience::{AudienceFit, AudienceFitError, MAX_PAIRS};
pub use baselines::{constant_noise_baseline, scene_median_baseline};
pub use choices::{Choice, VISIBLE_CHOICES, choices};
pub use corpus::{
    Corpus, CorpusError, Encoding, JudgedImage, JudgedImages, JudgedZone, Patch, ThresholdRow, ZoneImages,
};
pub use describe::{Corpora, combine, describe_corpora, describe_pairs};
pub use error::TableError;
pub use evaluation::{Baselines, Evaluation, PredictionScores, SceneScores};
pub use nested::{Chosen, choose_and_leave_out};

pub use noisefloor::svm::{SvmParams, SvmTrainError, check_examples, fit_svm};
pub use params::{Learner, TrainError, TrainParams};
pub use predict::{Prediction, predict};
pub use score::{ReliabilityBin, calibration_error, error_interval, image_accuracy, reliability, score};
pub use stimulus::{as_difference, as_noise};
pub use table::{Level, Origin, Table, Zone, first_word};
pub use table_csv::{read_table, read_table_with, write_table};
pub use train::{leave_answers_out, leave_one_scene_out, train};
