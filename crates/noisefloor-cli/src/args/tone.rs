//! Options about the way from radiance to the screen.

use anyhow::bail;
use clap::Args;
use noisefloor::{ToneMapping, display::DEFAULT_KEY};
use noisefloor_image::{LutInput, read_cube};
use std::path::PathBuf;

/// From radiance to the screen.
#[derive(Debug, Args)]
pub struct ToneArgs {
    /// Tone mapping of linear pictures: `reinhard` (Reinhard et al. 2002, global operator), `srgb` (multiply,
    /// clamp, encode), or `lut:FILE.cube` (multiply, then a LUT whose output the screen shows: ACES, AgX,
    /// Filmic; see --lut-input).
    #[arg(long, default_value = "reinhard", value_name = "HOW", value_parser = tone)]
    tone_mapping: ToneChoice,
    /// Reinhard: what the log-average luminance becomes [default: 0.18].
    #[arg(long)]
    key: Option<f32>,
    /// Reinhard: the smallest luminance, after exposure, that becomes white [default: none burns out].
    #[arg(long)]
    white: Option<f32>,
    /// sRGB and LUT: factor on radiance [default: 1].
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
    /// The tone mapping, read and checked.
    pub fn check(&self) -> anyhow::Result<ToneMapping> {
        let reinhard = self.tone_mapping == ToneChoice::Reinhard;
        let lut = matches!(self.tone_mapping, ToneChoice::Lut(_));
        for (option, given, fits, wanted) in [
            ("--key", self.key.is_some(), reinhard, "reinhard"),
            ("--white", self.white.is_some(), reinhard, "reinhard"),
            ("--exposure", self.exposure.is_some(), !reinhard, "srgb"),
            ("--lut-input", self.lut_input.is_some(), lut, "lut:FILE.cube"),
        ] {
            if given && !fits {
                bail!("{option} needs --tone-mapping {wanted}");
            }
        }
        let exposure = self.exposure.unwrap_or(1.0);
        let tone = match &self.tone_mapping {
            ToneChoice::Reinhard => {
                ToneMapping::Reinhard { key: self.key.unwrap_or(DEFAULT_KEY), white: self.white }
            }
            ToneChoice::Srgb => ToneMapping::Srgb { exposure },
            ToneChoice::Lut(path) => {
                let curve = read_cube(path)?.into_tone_curve(self.lut_input.unwrap_or_default());
                ToneMapping::Custom { exposure, curve }
            }
        };
        tone.check()?;
        Ok(tone)
    }
}
