//! What a picture is seen on, and from where: the display's light and its pixels per degree.

use crate::chromaticity::{Chromaticities, ChromaticityError};
#[cfg(feature = "serde")]
use serde::ser::SerializeStruct;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize, Serializer};
use std::f64::consts::PI;
use thiserror::Error;

/// How code values become light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Eotf {
    /// IEC 61966-2-1; code values in [0, 1].
    #[default]
    Srgb,
    /// A power of this exponent, within 1…4; code values in [0, 1].
    Gamma(f64),
    /// SMPTE ST 2084 (PQ); code values in [0, 1].
    Pq,
    /// ITU-R BT.2100 hybrid log-gamma; code values in [0, 1].
    Hlg,
    /// Values are light already, in cd/m².
    Linear,
}

/// The primaries of code values, and the white that all three show together. Values are sent to the display
/// as they are, and eyes are taken as adapted to D65, as in ColorVideoVDP: with another white, greys have a
/// colour.
// Model files number the variants: new ones come last
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Primaries {
    /// ITU-R BT.709, those of sRGB; white is D65.
    #[default]
    Rec709,
    /// ITU-R BT.2020; white is D65.
    Rec2020,
    /// Any others, or another white. The light of the room that the display reflects has the colour of white,
    /// too, and HLG keeps the luminance weights of BT.2020, which its standard fixes.
    Measured(Chromaticities),
}

impl Primaries {
    /// What they mix from.
    pub fn chromaticities(self) -> Chromaticities {
        match self {
            Self::Rec709 => Chromaticities::REC709,
            Self::Rec2020 => Chromaticities::REC2020,
            Self::Measured(chromaticities) => chromaticities,
        }
    }
}

impl From<Chromaticities> for Primaries {
    /// A standard if they are exactly its own. Its published matrix differs from theirs in the fifth digit.
    fn from(chromaticities: Chromaticities) -> Self {
        let standards = [Self::Rec709, Self::Rec2020].into_iter();
        let mut equal = standards.filter(|standard| standard.chromaticities() == chromaticities);
        equal.next().unwrap_or(Self::Measured(chromaticities))
    }
}

/// Unchecked viewing conditions. [`ViewingParams::check`] makes them a [`Viewing`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Deserialize))]
#[non_exhaustive]
pub struct ViewingParams {
    /// Pixels per degree of visual angle in the centre of the picture, within 1…2000.
    pub pixels_per_degree: f64,
    /// Luminance of white, in cd/m², within 1…20000.
    pub peak: f64,
    /// Luminance of black in a dark room, in cd/m²; below the peak.
    pub black: f64,
    /// Light of the room that falls on the display, in lux, at most 100,000.
    pub ambient: f64,
    /// Share of that light that the display reflects, within 0…1.
    pub reflectivity: f64,
    /// How code values become light.
    pub eotf: Eotf,
    /// Their primaries and white.
    pub primaries: Primaries,
    /// In a film whose noise is new in every frame, its frames per second; `None` for a still.
    #[cfg_attr(feature = "serde", serde(default))]
    pub frames_per_second: Option<f64>,
}

#[cfg(feature = "serde")]
impl Serialize for ViewingParams {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        // Where fields have names, a still says nothing of films: digests of what was written before stay as they are
        let says = self.frames_per_second.is_some() || !to.is_human_readable();
        let mut fields = to.serialize_struct("ViewingParams", 7 + usize::from(says))?;
        fields.serialize_field("pixels_per_degree", &self.pixels_per_degree)?;
        fields.serialize_field("peak", &self.peak)?;
        fields.serialize_field("black", &self.black)?;
        fields.serialize_field("ambient", &self.ambient)?;
        fields.serialize_field("reflectivity", &self.reflectivity)?;
        fields.serialize_field("eotf", &self.eotf)?;
        fields.serialize_field("primaries", &self.primaries)?;
        if says {
            fields.serialize_field("frames_per_second", &self.frames_per_second)?;
        }
        fields.end()
    }
}

/// Viewing conditions that no display has.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ViewingError {
    /// Pixels per degree out of range.
    #[error("pixels per degree must lie within 1…2000, not {0}: check resolution, diagonal and distance")]
    PixelsPerDegree(f64),
    /// The peak is out of range.
    #[error("the peak luminance must lie within 1…20000 cd/m², not {0}")]
    Peak(f64),
    /// Black is no luminance, or not below white.
    #[error("black must lie between 0 and the peak of {peak} cd/m², not {black}")]
    Black {
        /// Luminance of black, in cd/m².
        black: f64,
        /// Luminance of white, in cd/m².
        peak: f64,
    },
    /// The ambient light is out of range.
    #[error("ambient light must lie within 0…100000 lux, not {0}")]
    Ambient(f64),
    /// The reflectivity is out of range.
    #[error("reflectivity must lie within 0…1, not {0}")]
    Reflectivity(f64),
    /// The exponent is out of range.
    #[error("the exponent of a gamma display must lie within 1…4, not {0}")]
    Gamma(f64),
    /// The system gamma of HLG is undefined.
    #[error(
        "HLG displays above 1000 cd/m² need ambient light of at least 0.01 lux, on which their gamma depends"
    )]
    DarkHlg,
    /// The frame rate is out of range.
    #[error("a film must have 10…1000 frames per second, not {0}")]
    FramesPerSecond(f64),
    /// No display mixes colours so.
    #[error(transparent)]
    Colours(#[from] ChromaticityError),
}

impl ViewingParams {
    /// Checks every value. Measured primaries that are those of a standard become the standard's.
    ///
    /// # Errors
    /// The first value that is out of its range.
    pub fn check(self) -> Result<Viewing, ViewingError> {
        let Self {
            pixels_per_degree,
            peak,
            black,
            ambient,
            reflectivity,
            eotf,
            primaries,
            frames_per_second,
        } = self;
        if !(1.0..=2000.0).contains(&pixels_per_degree) {
            return Err(ViewingError::PixelsPerDegree(pixels_per_degree));
        }
        if !(1.0..=20_000.0).contains(&peak) {
            return Err(ViewingError::Peak(peak));
        }
        if !(0.0..peak).contains(&black) {
            return Err(ViewingError::Black { black, peak });
        }
        if !(0.0..=100_000.0).contains(&ambient) {
            return Err(ViewingError::Ambient(ambient));
        }
        if !(0.0..=1.0).contains(&reflectivity) {
            return Err(ViewingError::Reflectivity(reflectivity));
        }
        // Slower ones do not show what the transient channel sees best, 5 Hz
        if let Some(rate) = frames_per_second.filter(|rate| !(10.0..=1000.0).contains(rate)) {
            return Err(ViewingError::FramesPerSecond(rate));
        }
        match eotf {
            Eotf::Gamma(gamma) if !(1.0..=4.0).contains(&gamma) => return Err(ViewingError::Gamma(gamma)),
            Eotf::Hlg if peak > 1000.0 && ambient < 0.01 => return Err(ViewingError::DarkHlg),
            _ => {}
        }
        let colours = primaries.chromaticities();
        colours.to_xyz()?;
        Ok(Viewing(Self { primaries: colours.into(), ..self }))
    }
}

/// Checked viewing conditions: a display, the light in the room, how far away the display is, and whether it shows
/// a still or a film.
///
/// As text, they are a preset (`desk`, `standard_4k`), numbers (`ppd=60,peak=300,black=0.3,ambient=100`), or
/// a preset with changes (`desk,distance=1.2`, `desk,primaries=p3,white=d50`, `desk,fps=24`).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "ViewingParams", into = "ViewingParams"))]
pub struct Viewing(ViewingParams);

impl TryFrom<ViewingParams> for Viewing {
    type Error = ViewingError;

    fn try_from(params: ViewingParams) -> Result<Self, ViewingError> {
        params.check()
    }
}

impl From<Viewing> for ViewingParams {
    fn from(viewing: Viewing) -> Self {
        viewing.0
    }
}

impl Viewing {
    /// The numbers, to change some of them and check again.
    pub fn params(&self) -> ViewingParams {
        self.0
    }

    /// Pixels per degree of visual angle.
    pub fn pixels_per_degree(&self) -> f64 {
        self.0.pixels_per_degree
    }

    /// In a film whose noise is new in every frame, its frames per second; `None` for a still.
    pub fn frames_per_second(&self) -> Option<f64> {
        self.0.frames_per_second
    }

    /// The same display with a film of so many frames per second, or with a still.
    ///
    /// # Errors
    /// Beyond 10…1000 frames per second.
    pub fn with_frames_per_second(&self, frames_per_second: Option<f64>) -> Result<Self, ViewingError> {
        ViewingParams { frames_per_second, ..self.0 }.check()
    }

    /// The same display with a still.
    #[must_use]
    pub fn of_still(&self) -> Self {
        Self(ViewingParams { frames_per_second: None, ..self.0 })
    }

    /// Light of the room that the display reflects, in cd/m²: that of a diffuse reflector (Mantiuk 2016, §3).
    pub fn reflected(&self) -> f64 {
        self.0.ambient / PI * self.0.reflectivity
    }
}
