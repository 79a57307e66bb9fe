//! What the samples of a source depend on.

#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
#[cfg(feature = "files")]
use std::io::{self, Read};
use thiserror::Error;

/// What the samples of a source depend on: its options, and the contents of every file it reads. A checkpoint
/// keeps it, so that no render is resumed after an edit of its scene.
///
/// ```
/// use noisefloor::source::SourceIdentity;
///
/// let mut kept = SourceIdentity::new("a tracer, seed 1");
/// kept.add("wood.png", b"dark");
/// let mut now = SourceIdentity::new("a tracer, seed 1");
/// now.add("wood.png", b"light");
/// let change = now.change_since(&kept).unwrap();
/// assert_eq!(change.to_string(), "`wood.png` has changed");
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct SourceIdentity {
    options: String,
    /// BLAKE3 of each file, by its name.
    files: BTreeMap<String, String>,
}

/// The first difference between two identities.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum IdentityChange {
    /// Other options.
    #[error("it is of {kept}, not of {now}")]
    Options {
        /// As they were.
        kept: String,
        /// As they are.
        now: String,
    },
    /// A file has other contents.
    #[error("`{0}` has changed")]
    Changed(String),
    /// A file is read now that was not.
    #[error("`{0}` is read now, and was not before")]
    Added(String),
    /// A file was read that is not any more.
    #[error("`{0}` was read before, and is not now")]
    Removed(String),
}

impl SourceIdentity {
    /// A source that has read no files yet. `options` is text of the source's own: renderer, version, seed,
    /// and whatever else changes its samples.
    pub fn new(options: impl Into<String>) -> Self {
        Self { options: options.into(), files: BTreeMap::new() }
    }

    /// Adds options in front of those there are.
    #[must_use]
    pub fn with_options(mut self, options: &str) -> Self {
        let separator = if self.options.is_empty() { "" } else { ", " };
        self.options = format!("{options}{separator}{}", self.options);
        self
    }

    /// Adds a file by its contents. Names should be relative to the scene, so that a scene may be moved.
    #[cfg(feature = "files")]
    pub fn add(&mut self, name: impl Into<String>, contents: &[u8]) {
        self.files.insert(name.into(), blake3::hash(contents).to_hex().to_string());
    }

    /// As [`Self::add`], without holding the contents in memory.
    ///
    /// # Errors
    /// Those of `contents`.
    #[cfg(feature = "files")]
    pub fn add_from(&mut self, name: impl Into<String>, contents: impl Read) -> io::Result<()> {
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(contents)?;
        self.files.insert(name.into(), hasher.finalize().to_hex().to_string());
        Ok(())
    }

    /// The names of the files, in alphabetical order.
    pub fn files(&self) -> impl ExactSizeIterator<Item = &str> {
        self.files.keys().map(String::as_str)
    }

    /// What is different from `kept`; `None` if nothing is.
    pub fn change_since(&self, kept: &Self) -> Option<IdentityChange> {
        // Contents come first: a file is easier to find than an option
        let differs = |(name, digest): (&String, &String)| match self.files.get(name) {
            Some(now) if now == digest => None,
            Some(_) => Some(IdentityChange::Changed(name.clone())),
            None => Some(IdentityChange::Removed(name.clone())),
        };
        let added = || self.files.keys().find(|name| !kept.files.contains_key(*name)).cloned();
        let options = || IdentityChange::Options { kept: kept.options.clone(), now: self.options.clone() };
        let changed = kept.files.iter().find_map(differs);
        changed
            .or_else(|| added().map(IdentityChange::Added))
            .or_else(|| (self.options != kept.options).then(options))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_difference_is_named() {
        let mut kept = SourceIdentity::new("seed 1");
        kept.add("a", b"one");
        let mut now = kept.clone();
        assert_eq!(now.change_since(&kept), None);
        now.add_from("a", &b"two"[..]).unwrap();
        assert_eq!(now.change_since(&kept), Some(IdentityChange::Changed("a".into())));
        now.add_from("a", &b"one"[..]).unwrap();
        assert_eq!(now, kept);
        now.add("b", b"");
        assert_eq!(now.change_since(&kept), Some(IdentityChange::Added("b".into())));
        assert_eq!(kept.change_since(&now), Some(IdentityChange::Removed("b".into())));
        let other = kept.clone().with_options("another");
        let (kept_is, now_is) = ("seed 1".to_owned(), "another, seed 1".to_owned());
        assert_eq!(other.change_since(&kept), Some(IdentityChange::Options { kept: kept_is, now: now_is }));
    }
}
