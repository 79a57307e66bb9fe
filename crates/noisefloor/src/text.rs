//! Files of text as programs and people write them, and what stands in their place.

use std::borrow::Cow;

/// What a file holds instead of itself, if that is known, and what to do.
pub fn stand_in(bytes: &[u8]) -> Option<&'static str> {
    // The first line of a pointer (git-lfs, docs/spec.md); of a locked file of git-annex, its key
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
