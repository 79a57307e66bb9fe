//! What is said of what a session was fed with, and from which numbers on.

use super::borders::MixUp;
use super::light::ImpossibleLight;
use crate::rgb::Rgb;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// Standard errors that chance does not reach: p < 7·10⁻¹⁰.
pub(super) const CERTAIN: f64 = 6.5;
/// Correlation from which a fault is certain. Running means have at least 0.4.
pub(super) const STRONG: f64 = 0.2;
/// Correlation from which one of neighbours is worth a warning.
pub(super) const NOTABLE: f64 = 0.1;
/// Ratio of two noise energies from which they are worth a warning.
pub(super) const FACTOR: f64 = 1.5;

/// A fault of what a session was fed with that leaves no doubt. Nothing can be judged by such samples.
///
/// Its `Debug` is its text, so that a `main` that returns it prints what to do.
#[derive(Clone, Copy, Error, PartialEq)]
#[non_exhaustive]
pub enum Fault {
    /// Light that cannot be. The batch was refused.
    #[error("tile {tile}: {light}")]
    Light {
        /// The tile.
        tile: usize,
        /// What is wrong with it.
        light: ImpossibleLight,
    },
    /// Batches equal to those before.
    #[error(
        "{tiles} of {of} tiles got the same batch twice, and other ones beside it: \
         give every batch random numbers of its own, such as a seed that counts batches"
    )]
    Repeated {
        /// Tiles that got one twice.
        tiles: usize,
        /// Tiles that got two batches and have noise.
        of: usize,
    },
    /// Batches that contain the ones before.
    #[error(
        "batches contain the samples of the ones before (correlation {correlation:.2}): \
         push means of new samples only, or running means by push_running"
    )]
    Running {
        /// Correlation of what should be independent.
        correlation: f64,
    },
    /// Batches that follow each other are more alike than others.
    #[error(
        "successive batches are alike (correlation {correlation:.2}): they share samples, \
         because seeds repeat or overlap, or the scene changes while it is rendered"
    )]
    Shared {
        /// Correlation of what should be independent.
        correlation: f64,
    },
    /// Pictures of 8 bits a channel.
    #[error(
        "all values are {encoding} of 8 bits: push linear radiance in floating point, before it is converted"
    )]
    Quantised {
        /// What 8-bit numbers they are.
        encoding: Encoding,
    },
    /// Numbers that are too coarse for what they are used for.
    #[error(
        "all values are {0}: means of so few bits end where a batch changes them by less than a step, \
         and integers hold no light above white; add up and push 32-bit floats"
    )]
    Rounded(Precision),
    /// Light too weak for 32-bit floats.
    #[error(
        "the picture has so little light that an exposure of {0:.1e} does not show it: multiply radiance by a constant"
    )]
    Dim(f32),
}

impl fmt::Debug for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// How 8-bit numbers were turned into radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub enum Encoding {
    /// k/255, or k.
    Linear,
    /// The sRGB decoding of k/255.
    Srgb,
}

impl fmt::Display for Encoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Linear => "numbers",
            Self::Srgb => "sRGB-decoded numbers",
        })
    }
}

/// What numbers values are that are none of 32-bit floats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub enum Precision {
    /// Integers, over their largest, sRGB-encoded or not, or as they are.
    Integers {
        /// Their bits.
        bits: u32,
        /// Whether they are whole numbers.
        whole: bool,
    },
    /// Floats, such as half floats, whose significand has 11 bits.
    Floats {
        /// Bits of the significand.
        bits: u32,
    },
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integers { bits, whole: true } => write!(f, "whole numbers of {bits} bits"),
            Self::Integers { bits, whole: false } => {
                write!(f, "integers of {bits} bits over the largest of them")
            }
            Self::Floats { bits: 11 } => f.write_str("half floats"),
            Self::Floats { bits } => write!(f, "floats of {bits} bits"),
        }
    }
}

/// A likely fault of what a session was fed with. Its text has the number that it rests on.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub enum Warning {
    /// Neighbouring pixels share samples.
    #[error(
        "the noise of neighbouring pixels is correlated ({0:.2}): by a pixel filter, a denoiser or splats; \
         verdicts are made for independent pixels, and come too early or too late"
    )]
    Neighbours(f64),
    /// Successive batches are a little alike.
    #[error(
        "successive batches are correlated ({0:.2}): verdicts take noise for smaller than it is, and come too early"
    )]
    Shared(f64),
    /// Whole tiles become brighter or darker.
    #[error(
        "the brightness of whole tiles changes from batch to batch (correlation {0:.2}): \
         if the scene changes, render each state by itself; if a Markov chain does, \
         say that pixels share samples"
    )]
    Changing(f64),
    /// Batches complement each other.
    #[error(
        "successive batches are anticorrelated ({0:.2}), as points of one quasi-random sequence are: \
         verdicts take noise for larger than it is, and come late"
    )]
    Anticorrelated(f64),
    /// Batches of one size have different noise.
    #[error(
        "batches of equal size differ in noise: the earlier has {0:.2} times the energy of the later; \
         verdicts expect it to depend on the number of samples only"
    )]
    Noise(f64),
    /// Noise does not fall with the number of samples.
    #[error(
        "batches that are said to have more samples have {0:.2} times the noise energy that their numbers say: \
         push with each batch the number of its own samples, and not of all so far"
    )]
    Counts(f64),
    /// The brightness depends on the number of samples.
    #[error(
        "batches of more samples are brighter, by {0:.2} %, and means of linear radiance are not: \
         are the values encoded for a screen, tone mapped or clamped, or sums instead of means? \
         no tile is done while they look so"
    )]
    Encoded(f64),
    /// The tiles do not fit together.
    #[error("the borders between tiles do not fit; they would if the tiles were {0}")]
    MixedUp(MixUp),
    /// Noise is cut off at white.
    #[error(
        "no value is above 1, and the noise of {0:.0} % of the noisy pixels ends there: \
         push linear radiance, not what is shown on a screen"
    )]
    Clipped(f64),
    /// Samples that came after their tile had stopped are of other light, and were left out.
    #[error(
        "in {tiles} of {of} tiles, samples that came after the tile had stopped are brighter or darker than those before, \
         by more than noise explains: they are not in the picture; look whether the scene has changed"
    )]
    Late {
        /// How many.
        tiles: usize,
        /// Of how many with such samples.
        of: usize,
    },
    /// The picture has pixels below zero.
    #[error(
        "{0:.0} % of the picture's pixels have negative luminance, which light has not: a black level was taken off, \
         a picture was taken off another, or a filter has negative lobes; \
         verdicts wait long for an exposure of such a picture"
    )]
    Negative(f64),
    /// One value everywhere.
    #[error("every pixel of every batch is {}: is this what was rendered?", colour(.0))]
    Constant(Rgb),
    /// All batches are the same, and nothing says whether they have noise.
    #[error(
        "all batches of {tiles} of {of} tiles are the same picture: either it has no noise, \
         or every batch got the same random numbers; \
         no tile is done before a batch of another number of samples tells"
    )]
    Repeated {
        /// Tiles of which all batches are the same.
        tiles: usize,
        /// Tiles that look noisy.
        of: usize,
    },
    /// Numbers that are coarser than 32-bit floats.
    #[error("all values are {0}: noise below their steps is lost; push 32-bit floats")]
    Rounded(Precision),
    /// What is shown in place of the samples is of another brightness.
    #[error(
        "in {tiles} of {of} tiles the denoised picture is brighter or darker than its samples, by more than noise explains: \
         look whether the denoiser takes linear radiance and returns it; what it makes of these tiles is not shown"
    )]
    Brightness {
        /// How many.
        tiles: usize,
        /// Of how many that were judged.
        of: usize,
    },
    /// Nothing shows whether values are linear.
    #[error(
        "all batches have one size: \
         nothing tells linear radiance from values that are encoded for a screen, \
         by which tiles stop up to twice too early; if these are linear, say so once (set_linear in Rust, \
         nf_session_set_linear in C, linear in Python and JavaScript)"
    )]
    Unsaid,
    /// Running means have more samples than they are said to have.
    #[error(
        "the first running means differ by less than their numbers of samples say (by {0:.2} times as much in those after): \
         the count seems to be behind the picture; \
         wait until the renderer has written all of a pass before you read it, \
         and count the samples that the picture then has"
    )]
    Behind(f64),
    /// Batches of more and more samples look like running means.
    #[error(
        "each batch is said to have more samples than the one before, and seems to contain these (correlation {0:.2}): \
         if they are means of all samples so far, push them by push_running; no tile is done while they look so"
    )]
    Totals(f64),
}

/// A grey as one number, and a colour as three.
fn colour(pixel: &Rgb) -> String {
    let [r, g, b] = pixel;
    if r == g && g == b { r.to_string() } else { format!("({r}, {g}, {b})") }
}
