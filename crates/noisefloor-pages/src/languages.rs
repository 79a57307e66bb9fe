//! Texts of the pages, one TOML file per language. English and French are built in; a study can bring others.

use crate::error::PagesError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

const BUILT_IN: [(&str, &str); 2] =
    [("en", include_str!("../pages/languages/en.toml")), ("fr", include_str!("../pages/languages/fr.toml"))];
/// Longest language file, in bytes.
const MAX_FILE: u64 = 1 << 18;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    Ltr,
    Rtl,
}

/// The texts of the pages in one language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Language {
    /// Name of the language, in the language.
    pub name: String,
    pub direction: Direction,
    pub text: BTreeMap<String, String>,
}

/// The built-in languages, and those in a folder, by their code. A file `ar.toml` adds the language `ar` or
/// replaces the built-in one.
pub fn read_languages(folder: Option<&Path>) -> Result<BTreeMap<String, Language>, PagesError> {
    let mut languages = BTreeMap::new();
    for (code, text) in BUILT_IN {
        languages.insert(code.to_owned(), parse_language(text, Path::new(code))?);
    }
    let english = languages["en"].clone();
    let Some(folder) = folder else { return Ok(languages) };
    let io = |source| PagesError::Io { path: folder.to_owned(), source };
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let Some(code) = path.file_stem().and_then(|s| s.to_str()) else { continue };
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        let language = parse_language(&read(&path)?, &path)?;
        check(&language, &english, &path)?;
        languages.insert(code.to_owned(), language);
    }
    Ok(languages)
}

fn read(path: &Path) -> Result<String, PagesError> {
    let io = |source| PagesError::Io { path: path.to_owned(), source };
    if path.metadata().map_err(io)?.len() > MAX_FILE {
        let what = format!("longer than {MAX_FILE} bytes");
        return Err(PagesError::Language { path: path.to_owned(), what });
    }
    std::fs::read_to_string(path).map_err(io)
}

pub fn parse_language(text: &str, path: &Path) -> Result<Language, PagesError> {
    toml::from_str(text).map_err(|e| PagesError::Language {
        path: path.to_owned(),
        what: e.to_string().trim_end().to_owned(),
    })
}

/// Every text of the English file exists, with the same places to fill in, and no other.
pub fn check(language: &Language, english: &Language, path: &Path) -> Result<(), PagesError> {
    let bad = |what: String| PagesError::Language { path: path.to_owned(), what };
    for (name, text) in &english.text {
        let Some(own) = language.text.get(name) else {
            return Err(bad(format!("has no text {name:?}; pages/languages/en.toml lists them all")));
        };
        if gaps(own) != gaps(text) {
            return Err(bad(format!("text {name:?} needs the places to fill in {:?}", gaps(text))));
        }
    }
    match language.text.keys().find(|name| !english.text.contains_key(*name)) {
        Some(name) => Err(bad(format!("no page shows a text {name:?}"))),
        None => Ok(()),
    }
}

/// Names between braces, sorted.
fn gaps(text: &str) -> Vec<&str> {
    let mut gaps: Vec<&str> = text.split('{').skip(1).filter_map(|t| Some(t.split_once('}')?.0)).collect();
    gaps.sort_unstable();
    gaps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_languages_have_the_same_texts() {
        let languages = read_languages(None).unwrap();
        check(&languages["fr"], &languages["en"], Path::new("fr")).unwrap();
    }

    #[test]
    fn incomplete_languages_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let english = &read_languages(None).unwrap()["en"];
        let write = |language: &Language| {
            let text: String = language.text.iter().map(|(k, v)| format!("{k} = {v:?}\n")).collect();
            let head = "name = \"Testish\"\ndirection = \"rtl\"\n[text]\n";
            std::fs::write(folder.path().join("xx.toml"), format!("{head}{text}")).unwrap();
            read_languages(Some(folder.path())).map(|all| all["xx"].direction)
        };
        assert_eq!(write(english).unwrap(), Direction::Rtl);
        let mut less = english.clone();
        less.text.remove("begin");
        assert!(write(&less).unwrap_err().to_string().contains("\"begin\""));
        let mut gap = english.clone();
        gap.text.insert("code_note".into(), "no code".into());
        assert!(write(&gap).unwrap_err().to_string().contains("code_note"));
        let mut more = english.clone();
        more.text.insert("more".into(), "x".into());
        assert!(write(&more).unwrap_err().to_string().contains("more"));
    }
}
