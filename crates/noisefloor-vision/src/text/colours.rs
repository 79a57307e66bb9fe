//! Primaries and whites as text: `primaries=p3`, `white=d50`, `white=0.3457:0.3585`.

use crate::chromaticity::Chromaticities;
use std::fmt;

/// What `primaries` takes.
pub(super) const PRIMARIES: &str =
    "rec709, rec2020, p3, or CIE 1931 x and y of red, green and blue, such as 0.64:0.33:0.3:0.6:0.15:0.06";
/// What `white` takes.
pub(super) const WHITE: &str =
    "d50, d55, d65, d75, d93, 4000K to 25000K (daylight), or CIE 1931 x:y such as 0.3457:0.3585";

const GAMUTS: [(&str, Chromaticities); 3] = [
    ("rec709", Chromaticities::REC709),
    ("rec2020", Chromaticities::REC2020),
    ("p3", Chromaticities::DISPLAY_P3),
];
const WHITES: [(&str, [f64; 2]); 5] = [
    ("d50", Chromaticities::D50),
    ("d55", Chromaticities::D55),
    ("d65", Chromaticities::D65),
    ("d75", Chromaticities::D75),
    ("d93", Chromaticities::D93),
];

fn of_gamut(colours: &Chromaticities) -> [[f64; 2]; 3] {
    [colours.red, colours.green, colours.blue]
}

/// Red, green and blue, unchecked.
pub(super) fn primaries(value: &str) -> Option<[[f64; 2]; 3]> {
    if let Some((_, gamut)) = GAMUTS.iter().find(|(name, _)| *name == value) {
        return Some(of_gamut(gamut));
    }
    let [a, b, c, d, e, f] = numbers(value)?;
    Some([[a, b], [c, d], [e, f]])
}

/// A white, unchecked.
pub(super) fn white(value: &str) -> Option<[f64; 2]> {
    if let Some((_, white)) = WHITES.iter().find(|(name, _)| *name == value) {
        return Some(*white);
    }
    match value.strip_suffix(['K', 'k']) {
        Some(kelvin) => Chromaticities::daylight(kelvin.parse().ok()?),
        None => numbers(value),
    }
}

/// Exactly N numbers between colons.
fn numbers<const N: usize>(value: &str) -> Option<[f64; N]> {
    let mut parts = value.split(':');
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = parts.next()?.parse().ok()?;
    }
    parts.next().is_none().then_some(numbers)
}

/// Writes what differs from Rec.709 and D65, by name where there is one.
pub(super) fn write(f: &mut fmt::Formatter<'_>, colours: Chromaticities) -> fmt::Result {
    let gamut = of_gamut(&colours);
    match GAMUTS.iter().find(|(_, known)| of_gamut(known) == gamut) {
        Some(("rec709", _)) => {}
        Some((name, _)) => write!(f, ",primaries={name}")?,
        None => {
            let [[a, b], [c, d], [e, g]] = gamut;
            write!(f, ",primaries={a}:{b}:{c}:{d}:{e}:{g}")?;
        }
    }
    match WHITES.iter().find(|(_, known)| *known == colours.white) {
        Some(("d65", _)) => Ok(()),
        Some((name, _)) => write!(f, ",white={name}"),
        None => write!(f, ",white={}:{}", colours.white[0], colours.white[1]),
    }
}
