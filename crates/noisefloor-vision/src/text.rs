//! Viewing conditions as text: `desk`, `standard_4k`, `ppd=60,peak=300,black=0.3,ambient=100`,
//! `tv,distance=2`.

use crate::presets::{PRESETS, ViewingPreset};
use crate::screen::Screen;
use crate::viewing::{Eotf, Primaries, Viewing, ViewingError, ViewingParams};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The keys of the text form.
const KEYS: &str =
    "ppd, resolution, diagonal, distance, peak, black, contrast, ambient, reflectivity, eotf, primaries";

/// Text that names no viewing conditions.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ViewingTextError {
    /// No such preset.
    #[error(
        "no viewing conditions are called {0:?}; try desk, laptop, tv, phone, cinema, or ppd=60,peak=300"
    )]
    Preset(String),
    /// No such key.
    #[error("viewing conditions have no {0:?}; they have {KEYS}")]
    Key(String),
    /// A key was given twice.
    #[error("{0} is given twice")]
    Twice(String),
    /// Two keys that say the same thing.
    #[error("give either {0} or {1}, not both")]
    Both(&'static str, &'static str),
    /// A value is no such thing.
    #[error("{key}={value}: expected {expected}")]
    Value {
        /// The key.
        key: String,
        /// What it was given.
        value: String,
        /// What it takes.
        expected: &'static str,
    },
    /// The values are out of range.
    #[error(transparent)]
    Range(#[from] ViewingError),
}

/// What was typed, key by key.
#[derive(Default)]
struct Typed {
    ppd: Option<f64>,
    resolution: Option<(u32, u32)>,
    diagonal: Option<f64>,
    distance: Option<f64>,
    peak: Option<f64>,
    black: Option<f64>,
    contrast: Option<f64>,
    ambient: Option<f64>,
    reflectivity: Option<f64>,
    eotf: Option<Eotf>,
    primaries: Option<Primaries>,
}

impl Typed {
    fn read(&mut self, key: &str, value: &str) -> Result<(), ViewingTextError> {
        match key {
            "ppd" => number(&mut self.ppd, key, value),
            "diagonal" => number(&mut self.diagonal, key, value),
            "distance" => number(&mut self.distance, key, value),
            "peak" => number(&mut self.peak, key, value),
            "black" => number(&mut self.black, key, value),
            "contrast" => number(&mut self.contrast, key, value),
            "ambient" => number(&mut self.ambient, key, value),
            "reflectivity" => number(&mut self.reflectivity, key, value),
            "resolution" => set(&mut self.resolution, (key, value), "such as 1920x1080", resolution(value)),
            "eotf" => {
                set(&mut self.eotf, (key, value), "srgb, pq, hlg, linear, or such as gamma2.2", eotf(value))
            }
            "primaries" => set(&mut self.primaries, (key, value), "rec709 or rec2020", primaries(value)),
            _ => Err(ViewingTextError::Key(key.into())),
        }
    }

    /// The preset with what was typed in place of its own values.
    fn over(self, base: &ViewingPreset) -> Result<ViewingParams, ViewingTextError> {
        let moved = self.resolution.is_some() || self.diagonal.is_some() || self.distance.is_some();
        if self.ppd.is_some() && moved {
            return Err(ViewingTextError::Both("ppd", "a screen (resolution, diagonal, distance)"));
        }
        if self.black.is_some() && self.contrast.is_some() {
            return Err(ViewingTextError::Both("black", "contrast"));
        }
        let screen = Screen {
            resolution: self.resolution.unwrap_or(base.screen.resolution),
            diagonal: self.diagonal.unwrap_or(base.screen.diagonal),
            distance: self.distance.unwrap_or(base.screen.distance),
        };
        // A display of another peak keeps its contrast
        let peak = self.peak.unwrap_or(base.peak);
        let kept = if self.peak.is_none() { base.black } else { peak * (base.black / base.peak) };
        let black = self.black.or(self.contrast.map(|contrast| peak / contrast)).unwrap_or(kept);
        let of_base = base.params();
        Ok(ViewingParams {
            pixels_per_degree: self.ppd.unwrap_or_else(|| screen.pixels_per_degree()),
            peak,
            black,
            ambient: self.ambient.unwrap_or(base.ambient),
            reflectivity: self.reflectivity.unwrap_or(of_base.reflectivity),
            eotf: self.eotf.unwrap_or(base.eotf),
            primaries: self.primaries.unwrap_or(base.primaries),
        })
    }
}

fn set<T>(
    field: &mut Option<T>,
    (key, value): (&str, &str),
    expected: &'static str,
    read: Option<T>,
) -> Result<(), ViewingTextError> {
    let wrong = || ViewingTextError::Value { key: key.into(), value: value.into(), expected };
    match field.replace(read.ok_or_else(wrong)?) {
        Some(_) => Err(ViewingTextError::Twice(key.into())),
        None => Ok(()),
    }
}

fn number(field: &mut Option<f64>, key: &str, value: &str) -> Result<(), ViewingTextError> {
    set(field, (key, value), "a number", value.parse().ok())
}

fn resolution(value: &str) -> Option<(u32, u32)> {
    let (columns, rows) = value.split_once('x')?;
    Some((columns.parse().ok().filter(|&n| n > 0)?, rows.parse().ok().filter(|&n| n > 0)?))
}

fn eotf(value: &str) -> Option<Eotf> {
    match value {
        "srgb" => Some(Eotf::Srgb),
        "pq" => Some(Eotf::Pq),
        "hlg" => Some(Eotf::Hlg),
        "linear" => Some(Eotf::Linear),
        _ => value.strip_prefix("gamma")?.parse().ok().map(Eotf::Gamma),
    }
}

fn primaries(value: &str) -> Option<Primaries> {
    match value {
        "rec709" => Some(Primaries::Rec709),
        "rec2020" => Some(Primaries::Rec2020),
        _ => None,
    }
}

impl FromStr for Viewing {
    type Err = ViewingTextError;

    /// A preset, numbers, or a preset with numbers; what is not given is that of the preset, by default
    /// `desk`.
    fn from_str(text: &str) -> Result<Self, ViewingTextError> {
        let mut parts = text.split(',').map(str::trim).peekable();
        let base = match parts.next_if(|part| !part.contains('=')) {
            Some(name) => ViewingPreset::named(name).ok_or_else(|| ViewingTextError::Preset(name.into()))?,
            None => &PRESETS[0],
        };
        let mut typed = Typed::default();
        for part in parts {
            let (key, value) = part.split_once('=').ok_or_else(|| ViewingTextError::Key(part.into()))?;
            typed.read(key, value)?;
        }
        Ok(typed.over(base)?.check()?)
    }
}

impl fmt::Display for Viewing {
    /// The name of the preset, or all numbers; reads back as the same conditions.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(preset) = PRESETS.iter().find(|preset| preset.viewing() == *self) {
            return f.write_str(preset.name);
        }
        let ViewingParams { pixels_per_degree, peak, black, ambient, reflectivity, eotf, primaries } =
            self.params();
        write!(
            f,
            "ppd={pixels_per_degree},peak={peak},black={black},ambient={ambient},reflectivity={reflectivity}"
        )?;
        match eotf {
            Eotf::Srgb => Ok(()),
            Eotf::Gamma(gamma) => write!(f, ",eotf=gamma{gamma}"),
            Eotf::Pq => f.write_str(",eotf=pq"),
            Eotf::Hlg => f.write_str(",eotf=hlg"),
            Eotf::Linear => f.write_str(",eotf=linear"),
        }?;
        match primaries {
            Primaries::Rec709 => Ok(()),
            Primaries::Rec2020 => f.write_str(",primaries=rec2020"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_preset_reads_back() {
        for preset in PRESETS {
            let viewing: Viewing = preset.name.parse().unwrap();
            assert_eq!(viewing, preset.viewing());
            assert_eq!(viewing.to_string().parse(), Ok(viewing));
        }
    }

    #[test]
    fn numbers_change_a_preset() {
        let numbers: Viewing = "ppd=60,peak=300,black=0.3,ambient=100".parse().unwrap();
        assert_eq!(
            (numbers.pixels_per_degree(), numbers.params().peak, numbers.params().ambient),
            (60.0, 300.0, 100.0)
        );
        let far: Viewing = "desk, distance=1.2".parse().unwrap();
        let desk = Viewing::default();
        assert!((far.pixels_per_degree() / desk.pixels_per_degree() - 2.0).abs() < 1e-4);
        let bright: Viewing = "desk,peak=400".parse().unwrap();
        assert!((bright.params().black - 0.4).abs() < 1e-12);
        let by_contrast: Viewing = "tv,contrast=100".parse().unwrap();
        assert!((by_contrast.params().black - 3.5).abs() < 1e-12);
    }

    #[test]
    fn mistakes_are_named() {
        let said = |text: &str| text.parse::<Viewing>().unwrap_err().to_string();
        assert!(said("desc").contains("\"desc\""));
        assert!(said("").contains("no viewing conditions"));
        assert!(said("desk,ppi=3").contains("\"ppi\""));
        assert!(said("desk,tv").contains("\"tv\""));
        assert!(said("ppd=60,ppd=61").contains("twice"));
        assert!(said("ppd=60,distance=1").contains("either ppd or"));
        assert!(said("black=1,contrast=100").contains("either black or"));
        assert!(said("peak=bright").contains("a number"));
        assert!(said("resolution=0x10").contains("1920x1080"));
        assert!(said("eotf=gammaX").contains("gamma2.2"));
        assert!(said("ppd=nan").contains("1…2000"));
        assert!(said("distance=0").contains("distance"));
        assert!(said("contrast=0").contains("black"));
        assert!(said("standard_hdr_hlg,ambient=0").contains("0.01 lux"));
    }

    proptest! {
        #[test]
        fn all_conditions_read_back(
            (ppd, peak, black) in (1.0f64..2000.0, 1.0f64..20_000.0, 0.0f64..0.99),
            (ambient, share) in (0.01f64..1e5, 0.0f64..1.0),
            eotf in prop_oneof![
                Just(Eotf::Srgb), Just(Eotf::Pq), Just(Eotf::Hlg), Just(Eotf::Linear),
                (1.0f64..4.0).prop_map(Eotf::Gamma),
            ],
            primaries in prop_oneof![Just(Primaries::Rec709), Just(Primaries::Rec2020)],
        ) {
            let params = ViewingParams {
                pixels_per_degree: ppd, peak, black: black * peak, ambient, reflectivity: share, eotf,
                primaries,
            };
            let viewing = params.check().unwrap();
            prop_assert_eq!(viewing.to_string().parse(), Ok(viewing));
        }

        #[test]
        fn any_text_is_read_or_refused(text in "\\PC{0,40}") {
            let _ = text.parse::<Viewing>();
        }
    }

    #[test]
    fn serde_refuses_what_check_refuses() {
        let hdr: Viewing =
            "ppd=60,peak=300,black=0.5,ambient=100,eotf=gamma2.25,primaries=rec2020".parse().unwrap();
        let json = serde_json::to_string(&hdr).unwrap();
        assert_eq!(serde_json::from_str::<Viewing>(&json).unwrap(), hdr);
        let mut json = serde_json::to_value(Viewing::default()).unwrap();
        json["peak"] = serde_json::json!(-1.0);
        assert!(serde_json::from_value::<Viewing>(json).unwrap_err().to_string().contains("peak"));
    }
}
