//! Values of jobs that JSON has no word for.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::ffi::OsString;
use std::fmt::Display;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A path: text, or its bytes where it is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobPath(pub PathBuf);

/// How a file keeps it.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Kept {
    Text(String),
    Bytes(Vec<u8>),
}

impl JobPath {
    /// The same file from wherever it is read.
    pub fn absolute(&self) -> std::io::Result<Self> {
        std::path::absolute(&self.0).map(Self)
    }

    /// The path with the number of a frame filled in; without a place for it, as it is.
    #[must_use]
    pub fn of_frame(&self, frame: i32) -> Self {
        let bytes = self.0.as_os_str().as_encoded_bytes();
        let Some(Placeholder { before, number, after, .. }) = placeholder(bytes) else { return self.clone() };
        Self(path([before, number.of(frame).as_bytes(), after].concat()))
    }

    /// What is in front of the number of the frame, if there is one place for it.
    pub fn before_frame(&self) -> Option<PathBuf> {
        let Placeholder { before, after, kind, .. } = placeholder(self.0.as_os_str().as_encoded_bytes())?;
        kind(after).is_none().then(|| path(before.to_vec()))
    }
}

/// A text with the number of a frame for {frame} or {frame:04}; none if it holds neither.
pub fn with_frame(text: &str, frame: i32) -> Option<String> {
    let mut rest = text.as_bytes();
    let mut filled = Vec::new();
    while let Some(Placeholder { before, number, after, .. }) = braces(rest) {
        filled.extend([before, number.of(frame).as_bytes()].concat());
        rest = after;
    }
    if rest.len() == text.len() {
        return None;
    }
    filled.extend(rest);
    String::from_utf8(filled).ok()
}

/// How a number is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Number {
    /// With a sign among so many characters, as C and Python write it.
    Wide(usize),
    /// With a sign before so many digits, as Blender and Houdini do.
    Digits(usize),
}

impl Number {
    fn of(self, frame: i32) -> String {
        match self {
            Self::Wide(width) => format!("{frame:0width$}"),
            Self::Digits(digits) => {
                let sign = if frame < 0 { "-" } else { "" };
                format!("{sign}{:0digits$}", frame.unsigned_abs())
            }
        }
    }
}

/// Where the number of the frame stands.
struct Placeholder<'a> {
    before: &'a [u8],
    number: Number,
    after: &'a [u8],
    kind: fn(&[u8]) -> Option<Placeholder<'_>>,
}

/// The first place for the number of a frame, by the surest kind that is there.
fn placeholder(bytes: &[u8]) -> Option<Placeholder<'_>> {
    [braces, percent, dollar, hashes].into_iter().find_map(|kind| kind(bytes))
}

/// `{frame}` or `{frame:04}`, as in Python.
fn braces(bytes: &[u8]) -> Option<Placeholder<'_>> {
    const OPEN: &[u8] = b"{frame";
    let begin = bytes.windows(OPEN.len()).position(|window| window == OPEN)?;
    let rest = &bytes[begin + OPEN.len()..];
    let end = rest.iter().position(|byte| *byte == b'}')?;
    let width = match std::str::from_utf8(&rest[..end]).ok()? {
        "" => 1,
        format => format.strip_prefix(":0")?.parse().ok().filter(|width| (1..=9).contains(width))?,
    };
    Some(Placeholder {
        before: &bytes[..begin],
        number: Number::Wide(width),
        after: &rest[end + 1..],
        kind: braces,
    })
}

/// `%d` or `%04d`, as in C.
fn percent(bytes: &[u8]) -> Option<Placeholder<'_>> {
    let found = |(begin, rest): (usize, &[u8])| match rest {
        [b'%', b'd', ..] => Some((begin, 1, 2)),
        [b'%', b'0', width @ b'1'..=b'9', b'd', ..] => Some((begin, usize::from(width - b'0'), 4)),
        _ => None,
    };
    let (begin, width, length) = suffixes(bytes).find_map(found)?;
    let (before, after) = (&bytes[..begin], &bytes[begin + length..]);
    Some(Placeholder { before, number: Number::Wide(width), after, kind: percent })
}

/// `$F` or `$F4`, as in Houdini.
fn dollar(bytes: &[u8]) -> Option<Placeholder<'_>> {
    let found = |(begin, rest): (usize, &[u8])| {
        let (digits, length) = match rest.strip_prefix(b"$F")? {
            [digits @ b'1'..=b'9', ..] => (usize::from(digits - b'0'), 3),
            _ => (1, 2),
        };
        // Another variable, such as $FF
        let ends = rest.get(length).is_none_or(|next| !next.is_ascii_alphanumeric());
        ends.then_some((begin, digits, length))
    };
    let (begin, digits, length) = suffixes(bytes).find_map(found)?;
    let (before, after) = (&bytes[..begin], &bytes[begin + length..]);
    Some(Placeholder { before, number: Number::Digits(digits), after, kind: dollar })
}

/// `####`, a digit each, as in Blender and Nuke.
fn hashes(bytes: &[u8]) -> Option<Placeholder<'_>> {
    let begin = bytes.iter().position(|byte| *byte == b'#')?;
    let digits = bytes[begin..].iter().take_while(|byte| **byte == b'#').count();
    let (before, after) = (&bytes[..begin], &bytes[begin + digits..]);
    Some(Placeholder { before, number: Number::Digits(digits.min(9)), after, kind: hashes })
}

/// What is left of bytes from each of them on.
fn suffixes(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    (0..bytes.len()).map(|begin| (begin, &bytes[begin..]))
}

#[cfg(unix)]
fn path(bytes: Vec<u8>) -> PathBuf {
    use std::os::unix::ffi::OsStringExt;
    OsString::from_vec(bytes).into()
}

#[cfg(not(unix))]
fn path(bytes: Vec<u8>) -> PathBuf {
    OsString::from(String::from_utf8_lossy(&bytes).into_owned()).into()
}

impl Deref for JobPath {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl<P: Into<PathBuf>> From<P> for JobPath {
    fn from(path: P) -> Self {
        Self(path.into())
    }
}

impl Serialize for JobPath {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let kept = match self.0.to_str() {
            Some(text) => Kept::Text(text.to_owned()),
            None => Kept::Bytes(self.0.as_os_str().as_encoded_bytes().to_vec()),
        };
        kept.serialize(to)
    }
}

impl<'de> Deserialize<'de> for JobPath {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Ok(Self(match Kept::deserialize(from)? {
            Kept::Text(text) => text.into(),
            Kept::Bytes(bytes) => path(bytes),
        }))
    }
}

pub mod as_typed {
    use super::*;

    pub fn serialize<T: Display, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(value)
    }

    pub fn deserialize<'de, T: FromStr<Err: Display>, D: Deserializer<'de>>(from: D) -> Result<T, D::Error> {
        String::deserialize(from)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_names_its_frames() {
        for (pattern, frame, before) in [
            ("shots/hall.{frame:04}.xml", "shots/hall.0007.xml", "shots/hall."),
            ("shots/{frame}/hall.xml", "shots/7/hall.xml", "shots/"),
            ("shots/hall.####.xml", "shots/hall.0007.xml", "shots/hall."),
            ("shots/hall.#.xml", "shots/hall.7.xml", "shots/hall."),
            ("shots/hall.%04d.xml", "shots/hall.0007.xml", "shots/hall."),
            ("shots/hall.%d.xml", "shots/hall.7.xml", "shots/hall."),
            ("shots/hall.$F4.xml", "shots/hall.0007.xml", "shots/hall."),
            ("shots/hall.$F.xml", "shots/hall.7.xml", "shots/hall."),
            // The surest kind counts
            ("c#/hall.{frame}.xml", "c#/hall.7.xml", "c#/hall."),
        ] {
            let pattern = JobPath::from(pattern);
            assert_eq!((pattern.of_frame(7), pattern.before_frame()), (frame.into(), Some(before.into())));
        }
        for wrong in [
            "hall.xml",
            "{frame",
            "{frame:4}",
            "{frame:0x}",
            "{frame:00}",
            "{frame}{frame}",
            "{frame:0999}",
            "##.##",
            "%4d",
            "%20x",
            "$Foo",
            "$F12",
            "$",
        ] {
            assert_eq!(JobPath::from(wrong).before_frame(), None, "{wrong}");
        }
        // Frames before 0, as each of these programs writes them
        for (pattern, frame) in
            [("{frame}", "-7"), ("{frame:04}", "-007"), ("%04d", "-007"), ("####", "-0007"), ("$F4", "-0007")]
        {
            assert_eq!(JobPath::from(pattern).of_frame(-7), frame.into());
        }
        assert_eq!(with_frame("t={frame:02}, {frame}", 7).as_deref(), Some("t=07, 7"));
        assert_eq!(with_frame("#ff0000 50%d", 7), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_path_that_is_no_text_comes_back() {
        let pattern = JobPath(path(b"h\xe4ll.{frame:03}.xml".to_vec()));
        let kept = serde_json::to_string(&pattern).unwrap();
        assert_eq!(serde_json::from_str::<JobPath>(&kept).unwrap(), pattern);
        assert_eq!(pattern.of_frame(12), JobPath(path(b"h\xe4ll.012.xml".to_vec())));
        assert_eq!(serde_json::to_string(&JobPath::from("a.xml")).unwrap(), "\"a.xml\"");
    }
}
