//! Viewing conditions as text: `desk`, `standard_4k`, `ppd=60,peak=300,black=0.3,ambient=100`,
//! `tv,distance=2`, `desk,primaries=p3,white=d50`, `desk,fps=24`.

mod colours;

use crate::chromaticity::Chromaticities;
use crate::presets::{PRESETS, ViewingPreset};
use crate::screen::Screen;
use crate::viewing::{Eotf, Viewing, ViewingError, ViewingParams};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The keys of the text form.
const KEYS: &str = "ppd, resolution, diagonal, distance, peak, black, contrast, ambient, reflectivity, eotf, \
                    primaries, white, fps";

/// Text that names no viewing conditions.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
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
    primaries: Option<[[f64; 2]; 3]>,
    white: Option<[f64; 2]>,
    fps: Option<f64>,
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
            "fps" => number(&mut self.fps, key, value),
            "resolution" => set(&mut self.resolution, (key, value), "such as 1920x1080", resolution(value)),
            "eotf" => {
                set(&mut self.eotf, (key, value), "srgb, pq, hlg, linear, or such as gamma2.2", eotf(value))
            }
            "primaries" => {
                set(&mut self.primaries, (key, value), colours::PRIMARIES, colours::primaries(value))
            }
            "white" => set(&mut self.white, (key, value), colours::WHITE, colours::white(value)),
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
        let mut mixed = base.primaries.chromaticities();
        if let Some([red, green, blue]) = self.primaries {
            mixed = Chromaticities { red, green, blue, ..mixed };
        }
        mixed.white = self.white.unwrap_or(mixed.white);
        Ok(ViewingParams {
            pixels_per_degree: self.ppd.unwrap_or_else(|| screen.pixels_per_degree()),
            peak,
            black,
            ambient: self.ambient.unwrap_or(base.ambient),
            reflectivity: self.reflectivity.unwrap_or(of_base.reflectivity),
            eotf: self.eotf.unwrap_or(base.eotf),
            primaries: mixed.into(),
            frames_per_second: self.fps,
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
        let still = self.of_still();
        match PRESETS.iter().find(|preset| preset.viewing() == still) {
            Some(preset) => f.write_str(preset.name)?,
            None => write_numbers(f, &still.params())?,
        }
        match self.frames_per_second() {
            Some(rate) => write!(f, ",fps={rate}"),
            None => Ok(()),
        }
    }
}

/// The numbers of a display.
fn write_numbers(f: &mut fmt::Formatter<'_>, params: &ViewingParams) -> fmt::Result {
    let ViewingParams { pixels_per_degree, peak, black, ambient, reflectivity, eotf, primaries, .. } = params;
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
    colours::write(f, primaries.chromaticities())
}

#[cfg(test)]
mod tests;
