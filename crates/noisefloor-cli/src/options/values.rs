//! Values as they are typed.

use noisefloor::{
    Audience,
    tile::{MAX_TILE, MIN_TILE},
};
use noisefloor_rivals::{RIVALS, Rival};
use std::num::NonZeroUsize;
use std::time::Duration;

/// More threads than any machine has cores would only cost memory.
const MAX_THREADS: usize = 1024;

pub fn rival(text: &str) -> Result<&'static Rival, String> {
    let names = || RIVALS.iter().map(|rival| rival.name).collect::<Vec<_>>().join(", ");
    RIVALS.iter().find(|rival| rival.name == text).ok_or_else(|| format!("expected one of {}", names()))
}

pub fn size(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once(['x', 'X', '×']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let (width, height) = parts.ok_or("expected WIDTHxHEIGHT in pixels, such as 512x512")?;
    noisefloor::tile::check_image(width, height).map_err(|e| e.to_string())?;
    Ok((width, height))
}

/// A whole number within a range, or what it should have been.
pub fn within(text: &str, range: std::ops::RangeInclusive<usize>) -> Result<usize, String> {
    let number = text.parse().ok().filter(|n| range.contains(n));
    number.ok_or_else(|| format!("expected a whole number within {}…{}", range.start(), range.end()))
}

pub fn edge(text: &str) -> Result<usize, String> {
    within(text, MIN_TILE..=MAX_TILE)
}

pub fn threads(text: &str) -> Result<NonZeroUsize, String> {
    within(text, 1..=MAX_THREADS).map(|n| NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN))
}

pub fn audience(text: &str) -> Result<Audience, String> {
    match text {
        "observers" => Ok(Audience::TRAINED),
        "art-students" => Ok(Audience::ART_STUDENTS),
        line => {
            let (factor, offset) = line.split_once(',').unwrap_or((line, "0"));
            let number = |text: &str| text.trim().parse().ok();
            let parts = number(factor).zip(number(offset));
            let (slope, offset) = parts.ok_or(
                "expected `observers`, `art-students`, a factor on samples, or a,b for T' = a T + b",
            )?;
            Ok(Audience { slope, offset })
        }
    }
}

pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected seconds, such as 60 or 0.5")?;
    if seconds.is_nan() || seconds <= 0.0 {
        return Err("expected a time above 0 seconds".into());
    }
    Duration::try_from_secs_f64(seconds).map_err(|e| e.to_string())
}

pub fn jods(text: &str) -> Result<f64, String> {
    let jods = text.parse().ok().filter(|jods| (1e-3..=5.0).contains(jods));
    jods.ok_or_else(|| "expected just-objectionable differences within 0.001…5, such as 0.3".into())
}
