//! Options about the model, and about the way from radiance to the screen.

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use noisefloor::{DEFAULT_KEY, Evidence, Model, Oracle, Threshold, ToneMapping};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Which oracle.
#[derive(Debug, Args)]
pub struct OracleArgs {
    /// Model file [default: the bundled model].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// A tile has converged when the probability that an observer sees no noise reaches P; higher values
    /// stop later.
    #[arg(long, default_value_t = Threshold::PAPER, value_name = "P")]
    pub threshold: Threshold,
}

/// From radiance to the screen.
#[derive(Debug, Args)]
pub struct ToneArgs {
    /// Tone mapping of linear pictures.
    #[arg(long, value_enum, default_value_t = ToneChoice::Reinhard)]
    tone_mapping: ToneChoice,
    /// Reinhard: what the log-average luminance becomes [default: 0.18].
    #[arg(long)]
    key: Option<f32>,
    /// Reinhard: the smallest luminance, after exposure, that becomes white [default: none burns out].
    #[arg(long)]
    white: Option<f32>,
    /// sRGB: factor on radiance [default: 1].
    #[arg(long)]
    exposure: Option<f32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ToneChoice {
    /// Reinhard et al. 2002, global operator.
    Reinhard,
    /// Multiply, clamp, encode.
    Srgb,
}

/// What a tile is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EvidenceChoice {
    /// The other half of the samples: no reference is needed.
    Halves,
    /// A noise-free reference: SCENE/reference.exr of a corpus, or its most converged picture if there is
    /// none.
    Reference,
    /// Nothing but the picture itself. For comparison.
    Alone,
}

impl From<EvidenceChoice> for Evidence {
    fn from(choice: EvidenceChoice) -> Self {
        match choice {
            EvidenceChoice::Halves => Self::Halves,
            EvidenceChoice::Reference => Self::Reference,
            EvidenceChoice::Alone => Self::Alone,
        }
    }
}

impl OracleArgs {
    /// The oracle, loaded and checked.
    pub fn check(&self) -> anyhow::Result<Oracle> {
        Ok(Oracle::new(load_model(self.model.as_deref())?, self.threshold))
    }
}

/// Reads a model file, or the bundled model.
pub(super) fn load_model(path: Option<&Path>) -> anyhow::Result<Model> {
    let Some(path) = path else { return Ok(Model::bundled()) };
    let file = File::open(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    Model::read(BufReader::new(file)).with_context(|| format!("{}", path.display()))
}

impl ToneArgs {
    /// The tone mapping, checked.
    pub fn check(&self) -> anyhow::Result<ToneMapping> {
        let (other, ignored) = match self.tone_mapping {
            ToneChoice::Reinhard => ("srgb", [("--exposure", self.exposure.is_some()), ("", false)]),
            ToneChoice::Srgb => {
                ("reinhard", [("--key", self.key.is_some()), ("--white", self.white.is_some())])
            }
        };
        if let Some((option, _)) = ignored.iter().find(|(_, given)| *given) {
            bail!("{option} needs --tone-mapping {other}");
        }
        let tone = match self.tone_mapping {
            ToneChoice::Reinhard => {
                ToneMapping::Reinhard { key: self.key.unwrap_or(DEFAULT_KEY), white: self.white }
            }
            ToneChoice::Srgb => ToneMapping::Srgb { exposure: self.exposure.unwrap_or(1.0) },
        };
        tone.check()?;
        Ok(tone)
    }
}
