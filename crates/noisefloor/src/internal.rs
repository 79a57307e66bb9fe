//! What other crates of this workspace share with this one.

use crate::tile::TileError;
use std::borrow::Cow;
use std::path::Path;

pub use crate::container::{FileFault, Format};
pub use crate::evidence::{HALO, held};
pub use crate::model::familiarity::nearest;
pub use crate::text::{lines, stand_in, text};

/// Luminance weights, squared and summed: variance of Y′ for unit variance of R′, G′ and B′.
pub const ROUNDING_LUMINANCE: f32 = crate::display::ROUNDING_LUMINANCE;

/// Checks an image's size against the limits, before anything of that size is allocated.
///
/// # Errors
/// [`TileError::Image`] if it is empty or too large.
pub fn check_image(width: usize, height: usize) -> Result<(), TileError> {
    crate::tile::check_image(width, height)
}

/// Makes text from a file or another program safe to print on a terminal.
///
/// Control characters, which can move the cursor, hide text or retitle a window, and invisible marks that
/// reorder text become escapes like `\u{1b}`. Line breaks and tabs stay.
///
/// ```
/// assert_eq!(noisefloor::internal::printable("wall\x1b[2J\tgrey"), "wall\\u{1b}[2J\tgrey");
/// ```
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(unsafe_to_print) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if unsafe_to_print(c) { safe.extend(c.escape_default()) } else { safe.push(c) }
    }
    Cow::Owned(safe)
}

/// Controls but line break and tab, and the marks of bidirectional text (Unicode 15, Bidi_Control).
fn unsafe_to_print(c: char) -> bool {
    let control = c.is_control() && !matches!(c, '\n' | '\t');
    control
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Names of files by which they can be told apart: each its own, with as many of its folders as it takes.
///
/// ```
/// use std::path::Path;
/// let names = noisefloor::internal::told_apart(&["a/x/1.exr", "b/x/1.exr", "b/2.exr"].map(Path::new));
/// assert_eq!(names, ["a/x/1.exr", "b/x/1.exr", "2.exr"]);
/// ```
pub fn told_apart(paths: &[&Path]) -> Vec<String> {
    let parts: Vec<Vec<String>> = paths
        .iter()
        .map(|path| path.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect())
        .collect();
    let named = |parts: &[String], length: usize| parts[parts.len() - length.min(parts.len())..].join("/");
    let name = |own: &Vec<String>| {
        let twins =
            |length: usize| parts.iter().filter(|other| named(other, length) == named(own, length)).count();
        // The same file twice stays twice
        let enough = (1..=own.len()).find(|length| twins(*length) <= twins(own.len())).unwrap_or(1);
        named(own, enough)
    };
    parts.iter().map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_shown_and_text_stays() {
        for same in ["", "a wall, grün\n\tand 灰色 🙂"] {
            assert!(matches!(printable(same), Cow::Borrowed(text) if text == same));
        }
        // Colour, title of the window, the eight-bit form of ESC [, carriage return, delete, right-to-left
        // override
        assert_eq!(printable("\x1b[31m"), "\\u{1b}[31m");
        assert_eq!(printable("\x1b]0;owned\x07"), "\\u{1b}]0;owned\\u{7}");
        assert_eq!(printable("\u{9b}2J\r\x7f\u{202e}x"), "\\u{9b}2J\\r\\u{7f}\\u{202e}x");
    }
}
