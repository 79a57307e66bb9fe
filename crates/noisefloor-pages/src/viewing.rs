//! How the pictures are seen: screen, distance, gamma and light, as observers report them.

use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ambient {
    /// Nothing but the screen.
    Dark,
    /// A lamp, or daylight behind curtains.
    Dim,
    /// An office or a room by day.
    Bright,
    /// Sun or lamps reflected by the screen.
    Glare,
}

impl Ambient {
    /// As files name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Dim => "dim",
            Self::Bright => "bright",
            Self::Glare => "glare",
        }
    }
}

/// Viewing conditions that a study accepts, as ranges with both ends included.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct ViewingLimits {
    /// Device pixels per degree of visual angle.
    pub pixels_per_degree: [f64; 2],
    /// Distance of the eyes from the screen, in millimetres.
    pub distance_mm: [f64; 2],
    pub gamma: [f64; 2],
    pub ambient: Vec<Ambient>,
}

impl Default for ViewingLimits {
    fn default() -> Self {
        Self {
            pixels_per_degree: [15.0, 120.0],
            distance_mm: [250.0, 4000.0],
            gamma: [1.4, 3.0],
            ambient: vec![Ambient::Dark, Ambient::Dim, Ambient::Bright],
        }
    }
}

/// Viewing conditions of one observer. They identify nobody.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Conditions {
    /// Device pixels per millimetre, from a card of known size held against the screen: 0.5 to 60.
    pub pixels_per_mm: f64,
    /// Distance of the eyes from the screen, in millimetres: 100 to 10 000.
    pub distance_mm: f64,
    /// Device pixels per CSS pixel: 0.25 to 8. Pictures are shown one image pixel to one device pixel at any
    /// ratio.
    pub pixel_ratio: f64,
    /// Pinch zoom, which must be 1.
    pub zoom: f64,
    /// Colour depth in bits per pixel, as the browser reports it: at least 24.
    pub colour_depth: u32,
    /// Width of the screen in CSS pixels.
    pub screen_width: u32,
    /// Height of the screen in CSS pixels.
    pub screen_height: u32,
    /// Gamma of the screen, from the test chart: 1 to 4.
    pub gamma: f64,
    pub ambient: Ambient,
}

impl Conditions {
    /// Device pixels per degree of visual angle.
    pub fn pixels_per_degree(&self) -> f64 {
        2.0 * self.distance_mm * 0.5f64.to_radians().tan() * self.pixels_per_mm
    }

    /// Checks that every number is possible.
    pub fn check(&self) -> Result<(), String> {
        let within = |name: &str, value: f64, low: f64, high: f64| {
            let fits = (low..=high).contains(&value);
            if fits { Ok(()) } else { Err(format!("{name} is {value}, not {low} to {high}")) }
        };
        within("pixels-per-mm", self.pixels_per_mm, 0.5, 60.0)?;
        within("distance-mm", self.distance_mm, 100.0, 10_000.0)?;
        within("pixel-ratio", self.pixel_ratio, 0.25, 8.0)?;
        within("gamma", self.gamma, 1.0, 4.0)?;
        within("colour-depth", f64::from(self.colour_depth), 24.0, 128.0)?;
        within("screen-width", f64::from(self.screen_width), 100.0, 100_000.0)?;
        within("screen-height", f64::from(self.screen_height), 100.0, 100_000.0)?;
        if self.zoom != 1.0 {
            return Err("the page is enlarged by a gesture, so that pictures are scaled".to_owned());
        }
        Ok(())
    }

    /// The first condition that a study does not accept.
    pub fn outside(&self, limits: &ViewingLimits) -> Option<ViewingProblem> {
        let beyond = |value: f64, [low, high]: [f64; 2]| !(low..=high).contains(&value);
        if beyond(self.distance_mm, limits.distance_mm) {
            Some(ViewingProblem::Distance)
        } else if beyond(self.pixels_per_degree(), limits.pixels_per_degree) {
            Some(ViewingProblem::PixelsPerDegree)
        } else if beyond(self.gamma, limits.gamma) {
            Some(ViewingProblem::Gamma)
        } else if !limits.ambient.contains(&self.ambient) {
            Some(ViewingProblem::Ambient)
        } else {
            None
        }
    }
}

/// A condition outside the limits of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ViewingProblem {
    /// Too close or too far.
    Distance,
    /// Pixels too coarse or too fine at that distance.
    PixelsPerDegree,
    Gamma,
    Ambient,
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEEN: Conditions = Conditions {
        pixels_per_mm: 3.78,
        distance_mm: 600.0,
        pixel_ratio: 1.25,
        zoom: 1.0,
        colour_depth: 24,
        screen_width: 1920,
        screen_height: 1080,
        gamma: 2.2,
        ambient: Ambient::Dim,
    };

    /// 600 mm at 3.78 pixels per mm: 2·600·tan(½°)·3.78 = 39.58 pixels per degree.
    #[test]
    fn visual_angle_has_a_known_value() {
        assert!((SEEN.pixels_per_degree() - 39.58).abs() < 0.01);
    }

    #[test]
    fn each_limit_is_named() {
        let limits = ViewingLimits::default();
        let outside = |c: Conditions| c.outside(&limits);
        assert_eq!((SEEN.check(), outside(SEEN)), (Ok(()), None));
        assert_eq!(outside(Conditions { distance_mm: 200.0, ..SEEN }), Some(ViewingProblem::Distance));
        assert_eq!(outside(Conditions { pixels_per_mm: 1.0, ..SEEN }), Some(ViewingProblem::PixelsPerDegree));
        assert_eq!(outside(Conditions { gamma: 1.2, ..SEEN }), Some(ViewingProblem::Gamma));
        assert_eq!(outside(Conditions { ambient: Ambient::Glare, ..SEEN }), Some(ViewingProblem::Ambient));
        assert!(Conditions { zoom: 1.5, ..SEEN }.check().is_err());
        assert!(Conditions { distance_mm: f64::NAN, ..SEEN }.check().is_err());
    }
}
