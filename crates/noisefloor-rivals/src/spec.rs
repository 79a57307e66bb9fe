//! Criteria by name.

use crate::{
    ConvergedCvvdp, CyclesAdaptive, Dammertz, LuxCoreHalt, Myszkowski1998, RelativeError, Takouachet2007,
    converged, cycles, dammertz, luxcore, relative_error, stages,
};
use noisefloor::{FixedSpp, StoppingCriterion};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Samples per pixel of the example.
const DEFAULT_SAMPLES: f64 = 1000.0;

/// A criterion with one constant that its authors leave open or to the user.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Rival {
    /// The name in a spec: `"dammertz"`.
    pub name: &'static str,
    /// The name in a table or legend: `"Dammertz et al. 2010"`.
    pub title: &'static str,
    /// The published constant, or the documented one if none was published.
    pub default: f64,
    /// Search range of the constant, from strict (more samples) to lax (fewer), both above 0, to be searched
    /// logarithmically.
    pub range: (f64, f64),
    /// The criterion with its constant.
    pub make: fn(f64) -> Box<dyn StoppingCriterion + Send>,
    /// Whether it compares with the converged picture, which it takes as the session's reference: for
    /// comparison only.
    pub against_converged: bool,
    /// Whether the probability of its verdicts is one minus the smallest constant at which the tile would be
    /// done: one run then covers all constants.
    pub tells: bool,
    /// Whether the criterion accepts the constant.
    valid: fn(f64) -> bool,
    /// What the constant must be, for error messages.
    wanted: &'static str,
}

const SHARE: &str = "a share of the pixels above 0 and at most 1";
const POSITIVE: &str = "a number above 0";
const PROBABILITY: &str = "a probability above 0 and below 1";

/// All rivals with one open constant.
pub const RIVALS: &[Rival] = &[
    Rival {
        name: "spp",
        title: "Fixed samples per pixel",
        default: DEFAULT_SAMPLES,
        range: (100_000.0, 2.0),
        make: |samples| Box::new(FixedSpp(samples.round() as u64)),
        against_converged: false,
        tells: false,
        valid: |samples| (1.0..=1e15).contains(&samples),
        wanted: "a number of samples per pixel, at least 1",
    },
    Rival {
        name: "relative-error",
        title: "Relative error (Mitsuba 0.6)",
        default: relative_error::DEFAULT_ERROR,
        range: (1e-3, 1.0),
        make: |error| Box::new(RelativeError::new(error)),
        against_converged: false,
        tells: false,
        valid: |error| error > 0.0,
        wanted: POSITIVE,
    },
    Rival {
        name: "dammertz",
        title: "Dammertz et al. 2010",
        default: dammertz::DEFAULT_STOP,
        range: (1e-5, 0.1),
        make: |stop| Box::new(Dammertz::new(stop)),
        against_converged: false,
        tells: false,
        valid: |stop| stop > 0.0,
        wanted: POSITIVE,
    },
    Rival {
        name: "cycles",
        title: "Cycles",
        default: cycles::DEFAULT_THRESHOLD,
        range: (1e-4, 1.0),
        make: |threshold| Box::new(CyclesAdaptive::new(threshold)),
        against_converged: false,
        tells: false,
        valid: |threshold| threshold > 0.0,
        wanted: POSITIVE,
    },
    Rival {
        name: "luxcore",
        title: "LuxCoreRender",
        default: luxcore::DEFAULT_SHARE,
        range: (1e-4, 1.0),
        make: |share| Box::new(LuxCoreHalt::new(share)),
        against_converged: false,
        tells: false,
        valid: |share| share > 0.0 && share <= 1.0,
        wanted: SHARE,
    },
    Rival {
        name: "vdp-stages",
        title: "Myszkowski 1998",
        default: stages::DEFAULT_SEEN,
        range: (1e-4, 0.999),
        make: |probability| Box::new(Myszkowski1998::new(probability)),
        against_converged: false,
        tells: true,
        valid: |probability| probability > 0.0 && probability < 1.0,
        wanted: PROBABILITY,
    },
    Rival {
        name: "vdp-first",
        title: "Takouachet et al. 2007",
        default: stages::DEFAULT_GROWTH,
        range: (1e-4, 0.999),
        make: |probability| Box::new(Takouachet2007::new(probability)),
        against_converged: false,
        tells: true,
        valid: |probability| probability > 0.0 && probability < 1.0,
        wanted: PROBABILITY,
    },
    Rival {
        name: "cvvdp",
        title: "ColorVideoVDP, against the converged picture",
        default: converged::DEFAULT_LOST,
        range: (1e-3, 1.0),
        make: |lost| Box::new(ConvergedCvvdp::new(lost)),
        against_converged: true,
        tells: true,
        valid: |lost| lost > 0.0,
        wanted: POSITIVE,
    },
];

/// A spec that names no criterion.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum SpecError {
    #[error("there is no criterion {name:?}; there are {}", known())]
    Unknown { name: String },
    #[error("{spec:?}: {name} takes {wanted}, as in {name}:{example}")]
    Number {
        spec: String,
        name: &'static str,
        /// What it takes.
        wanted: &'static str,
        example: String,
    },
}

fn known() -> String {
    RIVALS.iter().map(|rival| format!("{}:…", rival.name)).collect::<Vec<_>>().join(", ")
}

/// A criterion by its name, and after a colon its constant, or the default without one; `spp` needs its
/// number: `"spp:256"`, `"relative-error:0.17"`, `"dammertz:0.0046"`,
/// `"cycles:0.01"`, `"luxcore:0.31"`, `"vdp-stages:0.94"`, `"vdp-first:0.74"`, `"cvvdp:0.3"`. Checked when
/// it is parsed; files keep the text.
#[derive(Clone, Debug)]
pub struct RivalSpec {
    text: String,
    rival: &'static Rival,
    constant: f64,
}

impl RivalSpec {
    /// A criterion that has not seen anything yet.
    pub fn criterion(&self) -> Box<dyn StoppingCriterion + Send> {
        (self.rival.make)(self.constant)
    }

    /// Whether it compares with the converged picture, which no render has.
    pub fn against_converged(&self) -> bool {
        self.rival.against_converged
    }
}

impl FromStr for RivalSpec {
    type Err = SpecError;

    fn from_str(spec: &str) -> Result<Self, SpecError> {
        let (name, number) = spec.split_once(':').map_or((spec, None), |(name, number)| (name, Some(number)));
        let rival = RIVALS.iter().find(|rival| rival.name == name);
        let rival = rival.ok_or_else(|| SpecError::Unknown { name: name.into() })?;
        let Rival { name, default, wanted, valid, .. } = *rival;
        // Any default number of samples would be wrong for somebody
        let constant = match number.or((name == "spp").then_some("")) {
            None => Some(default),
            Some(number) => number.trim().parse().ok().filter(|&x: &f64| x.is_finite() && valid(x)),
        };
        let wrong = || SpecError::Number { spec: spec.into(), name, wanted, example: default.to_string() };
        Ok(Self { text: spec.to_owned(), rival, constant: constant.ok_or_else(wrong)? })
    }
}

impl fmt::Display for RivalSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl PartialEq for RivalSpec {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl Serialize for RivalSpec {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for RivalSpec {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        String::deserialize(from)?.parse().map_err(serde::de::Error::custom)
    }
}

/// The criterion of a [`RivalSpec`].
pub fn parse(spec: &str) -> Result<Box<dyn StoppingCriterion + Send>, SpecError> {
    Ok(spec.parse::<RivalSpec>()?.criterion())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specs_name_criteria() {
        for (spec, name) in [
            ("spp:256", "256 samples per pixel"),
            ("relative-error", "relative error 0.17 at 95 %"),
            ("dammertz:0.002", "Dammertz et al. 2010, stop 0.002"),
            ("cycles: 0.1", "Cycles, threshold 0.1"),
            ("luxcore:1e-2", "LuxCore, 0.01 of the pixels"),
            ("vdp-stages:0.6", "Myszkowski 1998, P 0.6"),
            ("vdp-first", "Takouachet et al. 2007, P 0.74"),
            ("cvvdp:0.5", "ColorVideoVDP against the converged picture, 0.5 JOD"),
        ] {
            assert_eq!(parse(spec).unwrap().name(), name, "{spec}");
            let kept = serde_json::to_string(&spec.parse::<RivalSpec>().unwrap()).unwrap();
            let read: RivalSpec = serde_json::from_str(&kept).unwrap();
            assert_eq!((read.to_string().as_str(), read.criterion().name().as_str()), (spec, name));
        }
    }

    #[test]
    fn what_is_wrong_is_said() {
        let error = |spec| parse(spec).err().unwrap().to_string();
        assert!(
            error("fixd:3").contains("\"fixd\"") && error("fixd:3").contains("relative-error:…, dammertz:…")
        );
        assert_eq!(error("cycles:-1"), "\"cycles:-1\": cycles takes a number above 0, as in cycles:0.01");
        for spec in [
            "",
            ":",
            "spp",
            "spp:0",
            "spp:x",
            "spp:1e99",
            "time:1",
            "luxcore:1.1",
            "vdp-first:1",
            "dammertz:inf",
            "dammertz:",
        ] {
            assert!(
                parse(spec).is_err() && serde_json::from_value::<RivalSpec>(spec.into()).is_err(),
                "{spec}"
            );
        }
    }

    #[test]
    fn defaults_lie_in_their_ranges() {
        for rival in RIVALS {
            let (strict, lax) = rival.range;
            let (low, high) = (strict.min(lax), strict.max(lax));
            assert!(low > 0.0 && (low..=high).contains(&rival.default), "{}", rival.name);
            assert!([strict, lax].into_iter().all(rival.valid), "{}", rival.name);
            let spec = format!("{}:{}", rival.name, rival.default);
            assert_eq!((rival.make)(rival.default).name(), parse(&spec).unwrap().name());
        }
    }
}
