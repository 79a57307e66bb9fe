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
    ///
    /// # Errors
    /// If there is no current folder.
    pub fn absolute(&self) -> std::io::Result<Self> {
        std::path::absolute(&self.0).map(Self)
    }

    /// The path with {frame} or {frame:04} filled in; without either, as it is.
    #[must_use]
    pub fn of_frame(&self, frame: u32) -> Self {
        let bytes = self.0.as_os_str().as_encoded_bytes();
        let Some((before, digits, after)) = placeholder(bytes) else { return self.clone() };
        let number = format!("{frame:0digits$}");
        Self(path([before, number.as_bytes(), after].concat()))
    }

    /// What is in front of {frame}, if that is there once, and nothing of the kind after it.
    pub(crate) fn before_frame(&self) -> Option<PathBuf> {
        let (before, _, after) = placeholder(self.0.as_os_str().as_encoded_bytes())?;
        placeholder(after).is_none().then(|| path(before.to_vec()))
    }
}

/// What is in front of the first {frame} or {frame:04}, its digits, and what follows.
fn placeholder(bytes: &[u8]) -> Option<(&[u8], usize, &[u8])> {
    const OPEN: &[u8] = b"{frame";
    let begin = bytes.windows(OPEN.len()).position(|window| window == OPEN)?;
    let rest = &bytes[begin + OPEN.len()..];
    let end = rest.iter().position(|byte| *byte == b'}')?;
    let digits = match std::str::from_utf8(&rest[..end]).ok()? {
        "" => 1,
        format => format.strip_prefix(":0")?.parse().ok().filter(|digits| (1..=9).contains(digits))?,
    };
    Some((&bytes[..begin], digits, &rest[end + 1..]))
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

/// As it is typed.
pub mod as_typed {
    use super::*;

    /// # Errors
    /// Those of the format.
    pub fn serialize<T: Display, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(value)
    }

    /// # Errors
    /// If it is no such text.
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
        ] {
            let pattern = JobPath::from(pattern);
            assert_eq!((pattern.of_frame(7), pattern.before_frame()), (frame.into(), Some(before.into())));
        }
        for wrong in
            ["hall.xml", "{frame", "{frame:4}", "{frame:0x}", "{frame:00}", "{frame}{frame}", "{frame:0999}"]
        {
            assert_eq!(JobPath::from(wrong).before_frame(), None, "{wrong}");
        }
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
