//! Options about the model.

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use noisefloor::{Model, Oracle, People, evidence::Evidence};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Which oracle.
#[derive(Debug, Args)]
pub struct OracleArgs {
    /// Model file [default: the bundled model].
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Share of people who are to see no noise in a tile, on average over scenes like those that people were asked
    /// about: at 95 %, it is expected to be fewer than 84 % in one new scene of ten. More people stop later.
    #[arg(long, default_value_t = People::DEFAULT, value_name = "SHARE")]
    pub people: People,
    #[command(flatten)]
    renamed: Renamed,
}

/// What options were called before.
#[derive(Clone, Debug, Default, PartialEq, Args)]
pub struct Renamed {
    #[arg(long, hide = true, value_parser = threshold)]
    threshold: Option<String>,
}

fn threshold(_: &str) -> Result<String, &'static str> {
    Err(
        "--threshold P is --people SHARE now, and P the share of people who see no noise: --people 95% is the default",
    )
}

/// What a tile is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EvidenceChoice {
    /// The other half of the samples: no reference is needed.
    Halves,
    /// A noise-free reference: SCENE/reference.exr of a corpus, or its most converged picture if there is
    /// none.
    Reference,
}

impl From<EvidenceChoice> for Evidence {
    fn from(choice: EvidenceChoice) -> Self {
        match choice {
            EvidenceChoice::Halves => Self::Halves,
            EvidenceChoice::Reference => Self::Reference,
        }
    }
}

impl OracleArgs {
    /// The oracle, loaded and checked.
    pub fn check(&self) -> anyhow::Result<Oracle> {
        Ok(Oracle::new(load_model(self.model.as_deref())?, self.people))
    }
}

/// Reads a model file, or the bundled model.
pub fn load_model(path: Option<&Path>) -> anyhow::Result<Model> {
    let Some(path) = path else { return Ok(Model::bundled()) };
    let file = File::open(path).with_context(|| format!("{}: cannot be opened", path.display()))?;
    let mut reader = BufReader::new(file);
    let begins = reader.fill_buf().unwrap_or_default();
    if [&b"\x76\x2f\x31\x01"[..], b"\x89PNG", b"PF"].iter().any(|magic| begins.starts_with(magic)) {
        bail!("{}: is a picture, not a model; `noisefloor judge` looks at pictures", path.display());
    }
    Model::read(reader).with_context(|| format!("{}", path.display()))
}
