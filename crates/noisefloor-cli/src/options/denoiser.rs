//! Options about denoisers.

use clap::ValueEnum;

/// The denoisers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DenoiserChoice {
    /// Open Image Denoise.
    Oidn,
}
