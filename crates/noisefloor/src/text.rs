//! Text of files and of other programs: how it is read, what stands in its place, and how it is printed.

use std::borrow::Cow;
use std::path::Path;

/// What a file holds instead of itself, if that is known, and what to do.
pub fn stand_in(bytes: &[u8]) -> Option<&'static str> {
    // The first line of a pointer (git-lfs); of a locked file of git-annex, its key
    if bytes.starts_with(b"version https://git-lfs.github.com/spec/") {
        return Some("this is a Git LFS pointer, not the file itself: run `git lfs pull`");
    }
    if bytes.len() < 1024 && bytes.starts_with(b"/annex/objects/") {
        return Some("this is a pointer of git-annex, not the file itself: run `git annex get`");
    }
    let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let is = |word: &[u8]| start.get(..word.len()).is_some_and(|found| found.eq_ignore_ascii_case(word));
    (is(b"<!doctype html") || is(b"<html"))
        .then_some("this is a web page (HTML), not the file itself: download that again")
}

/// The text of a file: UTF-8, or UTF-16 with a byte order mark, or else Latin-1, in which any bytes are text.
pub fn text(bytes: &[u8]) -> Cow<'_, str> {
    let words = |word: fn([u8; 2]) -> u16| -> String {
        let words = bytes[2..].chunks_exact(2).map(|pair| word([pair[0], pair[1]]));
        char::decode_utf16(words).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    match bytes {
        [0xff, 0xfe, ..] => words(u16::from_le_bytes).into(),
        [0xfe, 0xff, ..] => words(u16::from_be_bytes).into(),
        _ => {
            let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
            let latin_1 = || bytes.iter().map(|b| *b as char).collect::<String>();
            std::str::from_utf8(bytes).map_or_else(|_| latin_1().into(), Cow::Borrowed)
        }
    }
}

/// The lines of a text, which end by \n, \r\n, or by \r alone, as on old Macs.
pub fn lines(text: &str) -> impl Iterator<Item = &str> + Clone {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    text.split(end).map(|line| line.strip_suffix('\r').unwrap_or(line))
}

/// Makes text from a file or another program safe to print on a terminal.
///
/// Control characters, which can move the cursor, hide text or retitle a window, and invisible marks that
/// reorder text become escapes like `\u{1b}`. Line breaks and tabs stay.
///
/// ```
/// assert_eq!(noisefloor::text::printable("wall\x1b[2J\tgrey"), "wall\\u{1b}[2J\tgrey");
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
/// let names = noisefloor::text::told_apart(&["a/x/1.exr", "b/x/1.exr", "b/2.exr"].map(Path::new));
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
