//! What observers do, as it is sent and kept.

use serde::{Deserialize, Serialize};

/// Largest clock reading that is believed, in milliseconds since 1970: the year 2255.
const MAX_CLOCK: u64 = 9_000_000_000_000;

/// One thing that an observer did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum StudyEvent {
    /// Agreed to take part. Nothing is shown before.
    Consent {
        /// Language of the text that was agreed to.
        language: String,
    },
    /// How the pictures are seen. May be sent again, when the window has moved to another screen.
    Conditions(Conditions),
    /// Acquisition: moved one tile one level on or back.
    Step {
        /// Number of the trial.
        trial: u32,
        /// Row-major place of the tile.
        tile: u32,
        /// Level that the tile has now.
        level: u32,
    },
    /// Acquisition: sees no difference any more.
    Done {
        /// Number of the trial.
        trial: u32,
    },
    /// Validation or forced choice: an answer.
    Answer {
        /// Number of the trial.
        trial: u32,
        /// What was answered.
        choice: Choice,
    },
    /// Stops for a while.
    Pause,
    /// Goes on.
    Resume,
}

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Choice {
    /// Validation: the two pictures are identical.
    Identical,
    /// Validation: they are not.
    Different,
    /// Forced choice: the first interval had the noise.
    First,
    /// Forced choice: the second one.
    Second,
}

/// How the pictures are seen. Nothing here tells who sees them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Conditions {
    /// Device pixels in a millimetre of the screen, from a card of known size held against it: 0.5 to 60.
    pub pixels_per_mm: f64,
    /// Distance of the eyes from the screen, in millimetres: 100 to 10 000.
    pub distance_mm: f64,
    /// Device pixels in a CSS pixel, a whole number: pictures are shown unscaled.
    pub pixel_ratio: f64,
    /// Pinch zoom; 1, since pictures are shown unscaled.
    pub zoom: f64,
    /// Bits a pixel, as the browser says: 24 or more.
    pub colour_depth: u32,
    /// Width of the screen in CSS pixels.
    pub screen_width: u32,
    /// Height of the screen in CSS pixels.
    pub screen_height: u32,
    /// Gamma of the screen, from the check chart: 1 to 4.
    pub gamma: f64,
    /// Light in the room, as the observer says.
    pub ambient: Ambient,
}

/// Light in the room.
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

impl Conditions {
    /// Pixels in a degree of visual angle.
    pub fn pixels_per_degree(&self) -> f64 {
        2.0 * self.distance_mm * 0.5f64.to_radians().tan() * self.pixels_per_mm
    }

    /// Checks every number against its range.
    ///
    /// # Errors
    /// What is out of range, as a sentence.
    pub fn check(&self) -> Result<(), String> {
        let within = |name: &str, value: f64, low: f64, high: f64| {
            let fits = (low..=high).contains(&value);
            if fits { Ok(()) } else { Err(format!("{name} is {value}, not {low} to {high}")) }
        };
        within("pixels-per-mm", self.pixels_per_mm, 0.5, 60.0)?;
        within("distance-mm", self.distance_mm, 100.0, 10_000.0)?;
        within("pixel-ratio", self.pixel_ratio, 1.0, 8.0)?;
        within("gamma", self.gamma, 1.0, 4.0)?;
        within("colour-depth", f64::from(self.colour_depth), 24.0, 128.0)?;
        within("screen-width", f64::from(self.screen_width), 100.0, 100_000.0)?;
        within("screen-height", f64::from(self.screen_height), 100.0, 100_000.0)?;
        if self.pixel_ratio.fract() != 0.0 || self.zoom != 1.0 {
            return Err("the page is zoomed, so that pictures are scaled: set the zoom to 100 %".to_owned());
        }
        Ok(())
    }
}

/// An event with its place in the session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope {
    /// Number within the session, from 0 without gaps. A repeated number is the same event again.
    pub seq: u64,
    /// Clock of the page when it happened, in milliseconds since 1970.
    pub at: u64,
    /// What happened.
    pub event: StudyEvent,
}

impl Envelope {
    /// Whether its clock can be one.
    pub fn has_sane_clock(&self) -> bool {
        self.at <= MAX_CLOCK
    }
}
