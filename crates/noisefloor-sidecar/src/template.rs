//! Command lines with placeholders.

use crate::error::CommandError;
use noisefloor::Tile;
use std::ffi::{OsStr, OsString};
use std::path::Path;

/// Every placeholder of a command that renders.
const PLACEHOLDERS: [&str; 10] = ["scene", "seed", "spp", "x0", "x1", "y0", "y1", "width", "height", "out"];
/// The corners of a tile; a template has all of them or none.
const CORNERS: [&str; 4] = ["x0", "x1", "y0", "y1"];

/// What a command that renders is given, by the names of placeholders.
pub(crate) struct RunValues<'a> {
    pub(crate) scene: Option<&'a Path>,
    pub(crate) seed: u64,
    pub(crate) spp: u64,
    pub(crate) threshold: f64,
    pub(crate) tile: Tile,
    pub(crate) size: (usize, usize),
    pub(crate) out: &'a Path,
}

/// The words of a command, checked.
#[derive(Debug)]
pub(crate) struct Template {
    words: Vec<String>,
}

impl Template {
    /// A command that renders, with the placeholders that it needs.
    pub(crate) fn renderer(template: &str, scene: bool) -> Result<Self, CommandError> {
        let wrong = |why: String| Err(CommandError::Template { template: template.to_owned(), why });
        let words = Self::parse(template, &PLACEHOLDERS, &["seed", "spp", "out"])?;
        if let Some(missing) = CORNERS.iter().find(|corner| words.aims() && !words.has(corner)) {
            return wrong(format!("{{{missing}}} is missing; name all corners of a tile, or none"));
        }
        match (words.has("scene"), scene) {
            (true, false) => wrong("it contains {scene}, but no scene is given".to_owned()),
            (false, true) => wrong("a scene is given, but it does not contain {scene}".to_owned()),
            _ => Ok(words),
        }
    }

    /// Splits a template into words as a POSIX shell does. It may contain only `known` placeholders, and must
    /// contain the `required` ones.
    pub(crate) fn parse(template: &str, known: &[&str], required: &[&str]) -> Result<Self, CommandError> {
        let wrong = |why: String| Err(CommandError::Template { template: template.to_owned(), why });
        let Some(words) = shlex::split(template) else { return wrong("a quote is not closed".to_owned()) };
        if words.is_empty() {
            return wrong("it is empty".to_owned());
        }
        let template = Self { words };
        let named: Vec<&str> = template.words.iter().flat_map(|word| placeholders(word)).collect();
        if let Some(unknown) = named.iter().find(|name| !known.contains(name)) {
            let known: Vec<_> = known.iter().map(|name| format!("{{{name}}}")).collect();
            return wrong(format!("{{{unknown}}} is not a placeholder; use {}", known.join(" ")));
        }
        match required.iter().find(|name| !template.has(name)) {
            Some(missing) => wrong(format!("{{{missing}}} is missing; it differs from run to run")),
            None => Ok(template),
        }
    }

    /// The program, as typed.
    pub(crate) fn program(&self) -> &str {
        &self.words[0]
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.words.iter().flat_map(|word| placeholders(word)).any(|placeholder| placeholder == name)
    }

    /// Whether it renders single tiles.
    pub(crate) fn aims(&self) -> bool {
        CORNERS.iter().any(|corner| self.has(corner))
    }

    /// The words of a run that renders.
    pub(crate) fn fill_run(&self, values: &RunValues<'_>) -> Vec<OsString> {
        let RunValues { scene, seed, spp, threshold, tile, size, out } = values;
        self.fill(|name| match name {
            "scene" => scene.unwrap_or(Path::new("")).into(),
            "seed" => seed.to_string().into(),
            "spp" => spp.to_string().into(),
            "threshold" => threshold.to_string().into(),
            "x0" => tile.x.to_string().into(),
            "x1" => (tile.x + tile.width).to_string().into(),
            "y0" => tile.y.to_string().into(),
            "y1" => (tile.y + tile.height).to_string().into(),
            "width" => size.0.to_string().into(),
            "height" => size.1.to_string().into(),
            _ => out.into(),
        })
    }

    /// The words with their placeholders filled in. Values may be any file name, Unicode or not.
    pub(crate) fn fill(&self, value: impl Fn(&str) -> OsString) -> Vec<OsString> {
        self.words.iter().map(|word| fill(word, &value)).collect()
    }
}

/// The names in braces. Other braces, for example of JSON, are text.
fn placeholders(word: &str) -> impl Iterator<Item = &str> {
    pieces(word).filter_map(|piece| match piece {
        Piece::Placeholder(name) => Some(name),
        Piece::Text(_) => None,
    })
}

fn fill(word: &str, value: &impl Fn(&str) -> OsString) -> OsString {
    let mut filled = OsString::new();
    for piece in pieces(word) {
        match piece {
            Piece::Placeholder(name) => filled.push(value(name)),
            Piece::Text(text) => filled.push(OsStr::new(text)),
        }
    }
    filled
}

enum Piece<'a> {
    Text(&'a str),
    Placeholder(&'a str),
}

/// A word cut into text and placeholders, in order.
fn pieces(word: &str) -> impl Iterator<Item = Piece<'_>> {
    let mut rest = word;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        if let Some(length) = placeholder_length(rest) {
            let name = &rest[1..=length];
            rest = &rest[length + 2..];
            return Some(Piece::Placeholder(name));
        }
        // Text up to the next brace, at least one character
        let first = rest.chars().next().map_or(0, char::len_utf8);
        let end = rest[first..].find('{').map_or(rest.len(), |at| first + at);
        let (text, after) = rest.split_at(end);
        rest = after;
        Some(Piece::Text(text))
    })
}

/// Length of the name if a text starts with lower-case letters and digits in braces.
fn placeholder_length(text: &str) -> Option<usize> {
    let length = text.strip_prefix('{')?.find('}')?;
    let inside = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
    (length > 0 && text[1..=length].chars().all(inside)).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_are_lower_case_names_in_braces() {
        let value = |name: &str| OsString::from(format!("<{name}>"));
        for (word, filled) in [
            ("--crop={x0},{y0}", "--crop=<x0>,<y0>"),
            ("{out}.exr", "<out>.exr"),
            ("{\"spp\": {spp}}", "{\"spp\": <spp>}"),
            ("{}", "{}"),
            ("{é{seed}é}", "{é<seed>é}"),
            ("{{spp}}", "{<spp>}"),
            ("{", "{"),
            ("", ""),
        ] {
            assert_eq!(fill(word, &value), OsStr::new(filled), "{word}");
        }
    }
}
