//! Options about the way from radiance to the screen.

use crate::refuse;
use crate::spell::{JobPath, as_typed};
use anyhow::Context;
use clap::Args;
use noisefloor::display::LutInput;
use noisefloor::{ToneMapping, display::DEFAULT_KEY};
use noisefloor_image::read_cube;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// From radiance to the screen.
#[derive(Debug, Args)]
pub struct ToneArgs {
    /// Tone mapping of linear pictures: `reinhard` (Reinhard et al. 2002, global operator), `srgb`
    /// (multiply, clamp, encode), or `lut:FILE.cube` (multiply, then a LUT whose output the screen shows:
    /// ACES, AgX, Filmic; see --lut-input).
    #[arg(long, default_value = "reinhard", value_name = "HOW", value_parser = tone)]
    tone_mapping: ToneChoice,
    /// Reinhard: what the log-average luminance becomes [default: 0.18].
    #[arg(long)]
    key: Option<f32>,
    /// Reinhard: the smallest luminance, after exposure, that becomes white [default: none burns out].
    #[arg(long)]
    white: Option<f32>,
    /// Factor on radiance [default: 1 for sRGB and LUT; for Reinhard, what brings the log-average luminance to
    /// --key].
    #[arg(long)]
    exposure: Option<f32>,
    /// LUT: how radiance (Rec.709 primaries) is encoded before it: `linear` within the domain of the file,
    /// `srgb`, `acescct`, or `log2:LOW,HIGH` in stops from middle grey (0.18), as AgX and Filmic want it
    /// [default: linear].
    #[arg(long, value_name = "ENCODING")]
    lut_input: Option<LutInput>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum ToneChoice {
    Reinhard,
    Srgb,
    Lut(PathBuf),
}

fn tone(text: &str) -> Result<ToneChoice, String> {
    match (text, text.strip_prefix("lut:")) {
        ("reinhard", _) => Ok(ToneChoice::Reinhard),
        ("srgb", _) => Ok(ToneChoice::Srgb),
        (_, Some(path)) if !path.is_empty() => Ok(ToneChoice::Lut(path.into())),
        _ => Err("expected reinhard, srgb, or lut:FILE.cube".into()),
    }
}

impl ToneArgs {
    /// What was typed, checked.
    pub fn check(&self) -> anyhow::Result<Tone> {
        let reinhard = self.tone_mapping == ToneChoice::Reinhard;
        let lut = matches!(self.tone_mapping, ToneChoice::Lut(_));
        for (option, given, fits, wanted) in [
            ("--key", self.key.is_some(), reinhard, "reinhard"),
            ("--white", self.white.is_some(), reinhard, "reinhard"),
            ("--lut-input", self.lut_input.is_some(), lut, "lut:FILE.cube"),
        ] {
            if given && !fits {
                refuse!("{option} needs --tone-mapping {wanted}");
            }
        }
        if self.key.is_some() && self.exposure.is_some() {
            refuse!(
                "give either --key or --exposure, not both: the exposure of Reinhard's operator follows from the key"
            );
        }
        let exposure = self.exposure.unwrap_or(1.0);
        Ok(match &self.tone_mapping {
            ToneChoice::Reinhard if self.exposure.is_some() => {
                Tone::ReinhardAt { exposure, white: self.white }
            }
            ToneChoice::Reinhard => {
                Tone::Reinhard { key: self.key.unwrap_or(DEFAULT_KEY), white: self.white }
            }
            ToneChoice::Srgb => Tone::Srgb { exposure },
            ToneChoice::Lut(file) => {
                let (file, input) = (JobPath::from(file), self.lut_input.unwrap_or_default());
                Tone::Lut { file, input, exposure }
            }
        })
    }
}

/// A tone mapping as a value: a LUT is a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    Reinhard {
        key: f32,
        white: Option<f32>,
    },
    ReinhardAt {
        exposure: f32,
        white: Option<f32>,
    },
    Srgb {
        exposure: f32,
    },
    Lut {
        file: JobPath,
        #[serde(with = "as_typed")]
        input: LutInput,
        exposure: f32,
    },
}

impl Tone {
    /// The same from whatever folder it is read.
    pub fn absolute(&self) -> anyhow::Result<Self> {
        let mut tone = self.clone();
        if let Self::Lut { file, .. } = &mut tone {
            *file = file.absolute().context("the current folder")?;
        }
        Ok(tone)
    }

    /// The same, of which the exposure does not hang on the picture.
    #[must_use]
    pub fn exposed_as(&self, exposure: f32) -> Self {
        match *self {
            Self::Reinhard { white, .. } => Self::ReinhardAt { exposure, white },
            ref known => known.clone(),
        }
    }

    /// As it is typed.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Reinhard { .. } | Self::ReinhardAt { .. } => "reinhard",
            Self::Srgb { .. } => "srgb",
            Self::Lut { .. } => "lut:FILE.cube",
        }
    }

    /// Whether each picture has an exposure of its own.
    pub fn settles(&self) -> bool {
        matches!(self, Self::Reinhard { .. })
    }

    /// The tone mapping, read and checked.
    pub fn load(&self) -> anyhow::Result<ToneMapping> {
        let tone = match self {
            Self::Reinhard { key, white } => ToneMapping::Reinhard { key: *key, white: *white },
            Self::ReinhardAt { exposure, white } => {
                ToneMapping::ReinhardAt { exposure: *exposure, white: *white }
            }
            Self::Srgb { exposure } => ToneMapping::Srgb { exposure: *exposure },
            Self::Lut { file, input, exposure } => ToneMapping::Custom {
                exposure: *exposure,
                curve: read_cube(&**file)?.into_tone_curve(*input),
            },
        };
        tone.check()?;
        Ok(tone)
    }
}
