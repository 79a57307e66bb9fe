//! `render --config`: options from a file, as if they were typed before the others.

use super::render::RenderArgs;
use anyhow::Context;
use clap::error::ErrorKind;
use noisefloor_cli::files::read_small;
use noisefloor_cli::refuse;
use std::collections::BTreeMap;
use std::error::Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use toml::{Spanned, Value};

/// What was typed, with the options of the file that `--config` names after the name of the command:
/// options typed come later, and win.
pub fn expand(typed: Vec<OsString>) -> anyhow::Result<Vec<OsString>> {
    if typed.get(1).is_none_or(|command| command != "render") {
        return Ok(typed);
    }
    let (before, after) = typed.split_at(2);
    Ok([before, &with_file(after)?].concat())
}

/// Options of `render`, with those of the file before them.
pub(super) fn with_file(typed: &[OsString]) -> anyhow::Result<Vec<OsString>> {
    let Some(path) = config(typed) else { return Ok(typed.to_vec()) };
    let options = options(&path).with_context(|| format!("--config {}", path.display()))?;
    Ok([&options, typed].concat())
}

/// The last file named by `--config`.
fn config(typed: &[OsString]) -> Option<PathBuf> {
    let named = |(word, next): (&OsString, Option<&OsString>)| {
        if word == "--config" {
            return next.map(PathBuf::from);
        }
        Some(PathBuf::from(word.to_str()?.strip_prefix("--config=")?))
    };
    let next = typed.iter().skip(1).map(Some).chain([None]);
    typed.iter().zip(next).filter_map(named).last()
}

const QUOTES: &str =
    "; in \"…\", \\ begins an escape: write paths of Windows in single quotes, as in 'c:\\shots'";

/// The options of a file, checked one by one: what is wrong is said in the words of the file.
fn options(path: &Path) -> anyhow::Result<Vec<OsString>> {
    let text = read_small(path)?;
    let line = |at: usize| 1 + text.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count();
    let table: BTreeMap<Spanned<String>, Spanned<Value>> = match toml::from_str(&text) {
        Ok(table) => table,
        Err(error) => {
            let line = error.span().map_or(1, |span| line(span.start));
            let escapes = text.lines().nth(line - 1).is_some_and(|words| words.contains('\\'));
            refuse!("line {line}: {}{}", error.message(), if escapes { QUOTES } else { "" })
        }
    };
    let mut options = Vec::new();
    for (name, value) in &table {
        let (line, name) = (line(name.span().start), name.as_ref());
        let value = match value.as_ref() {
            Value::Boolean(true) => None,
            Value::Boolean(false) => continue,
            // "c:\temp" is a tab and `emp`
            Value::String(text) if text.contains(char::is_control) => {
                refuse!("line {line}: {name} has a tab or the like in it{QUOTES}")
            }
            Value::String(text) => Some(text.clone()),
            Value::Integer(number) => Some(number.to_string()),
            Value::Float(number) => Some(number.to_string()),
            _ => refuse!(
                "line {line}: {name} is a list, a table or a date: expected text, a number, true or false"
            ),
        };
        if name == "config" {
            refuse!("line {line}: a configuration does not name another one");
        }
        if let Some(problem) = problem(name, value.as_deref()) {
            refuse!("line {line}: {problem}");
        }
        options.push(option(name, value.as_deref()));
    }
    Ok(options)
}

fn option(name: &str, value: Option<&str>) -> OsString {
    value.map_or_else(|| format!("--{name}"), |value| format!("--{name}={value}")).into()
}

/// What is wrong with one option by itself.
fn problem(name: &str, value: Option<&str>) -> Option<String> {
    let render = RenderArgs::alone();
    let mut known = render.get_arguments().filter(|known| !known.is_hide_set());
    if !known.any(|known| known.get_long() == Some(name)) {
        return Some(format!("`render` has no option {name}; `noisefloor render --help` lists them"));
    }
    let error = RenderArgs::parsed([option(name, value)]).err()?;
    let value = value.unwrap_or("true");
    match error.kind() {
        ErrorKind::InvalidValue | ErrorKind::ValueValidation => {
            let why = error.source().map(|why| format!(": {why}")).unwrap_or_default();
            Some(format!("{name} = {value:?} cannot be{why}"))
        }
        ErrorKind::TooManyValues => Some(format!("{name} takes no value but true or false")),
        // What is missing may be typed
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn words(typed: &[&str]) -> Vec<OsString> {
        typed.iter().map(OsString::from).collect()
    }

    #[test]
    fn options_of_a_file_come_before_those_typed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shot.toml");
        fs::write(&path, "size = \"64x32\"\nmax-spp = 400\nclamp = 2.5\nno-mis = true\nresume = false\n")
            .unwrap();
        let file = path.to_str().unwrap();
        let typed = words(&["noisefloor", "render", "hall.xml", "--config", file, "--max-spp", "9"]);
        let mut expected =
            words(&["noisefloor", "render", "--clamp=2.5", "--max-spp=400", "--no-mis", "--size=64x32"]);
        let mut expanded = expand(typed.clone()).unwrap();
        expanded[2..6].sort();
        expected.extend_from_slice(&typed[2..]);
        assert_eq!(expanded, expected);
        let nothing = words(&["noisefloor", "judge", "render", "--config", file]);
        assert_eq!(expand(nothing.clone()).unwrap(), nothing);
        for (text, line, words) in [
            ("size = [64, 32]", 1, "size is a list"),
            ("seed = 1\nsize 64", 2, "expected"),
            ("\n\ncolour = \"green\"", 3, "no option colour"),
            ("seed = 1\nmax-spp = \"many\"", 2, "max-spp = \"many\" cannot be: invalid digit"),
            ("tone-mapping = \"bright\"", 1, "expected reinhard, srgb"),
            ("no-mis = 3", 1, "takes no value but true or false"),
        ] {
            fs::write(&path, text).unwrap();
            let error = format!("{:#}", expand(typed.clone()).unwrap_err());
            assert!(error.contains(&format!("shot.toml: line {line}: ")) && error.contains(words), "{error}");
        }
        fs::write(&path, "#".repeat((1 << 20) + 1)).unwrap();
        let error = format!("{:#}", expand(typed).unwrap_err());
        assert!(error.contains("longer than a megabyte"), "{error}");
        let folder = words(&["noisefloor", "render", "--config", folder.path().to_str().unwrap()]);
        assert!(format!("{:#}", expand(folder).unwrap_err()).contains("is a folder"));
    }
}
