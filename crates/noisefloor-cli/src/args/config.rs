//! `render --config`: options from a file, as if they were typed before the others.

use anyhow::{Context, bail};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// What was typed, with the options of the file that `--config` names after the name of the command: options typed
/// come later, and win.
pub fn expand(typed: Vec<OsString>) -> anyhow::Result<Vec<OsString>> {
    if typed.get(1).is_none_or(|command| command != "render") {
        return Ok(typed);
    }
    let Some(path) = config(&typed[2..]) else { return Ok(typed) };
    let (before, after) = typed.split_at(2);
    let options = options(&path).with_context(|| format!("--config {}", path.display()))?;
    Ok([before, &options, after].concat())
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

fn options(path: &Path) -> anyhow::Result<Vec<OsString>> {
    let text = fs::read_to_string(path)?;
    let table: Table = text.parse().map_err(|error: toml::de::Error| anyhow::anyhow!("{error}"))?;
    let mut options = Vec::new();
    for (name, value) in &table {
        let value = match value {
            Value::Boolean(true) => None,
            Value::Boolean(false) => continue,
            Value::String(text) => Some(text.clone()),
            Value::Integer(number) => Some(number.to_string()),
            Value::Float(number) => Some(number.to_string()),
            _ => bail!("{name} is a list, a table or a date: expected text, a number, true or false"),
        };
        if name == "config" {
            bail!("a configuration does not name another one");
        }
        options.push(match value {
            Some(value) => format!("--{name}={value}").into(),
            None => format!("--{name}").into(),
        });
    }
    Ok(options)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        fs::write(&path, "size = [64, 32]").unwrap();
        assert!(expand(typed.clone()).unwrap_err().chain().any(|e| e.to_string().contains("size is a list")));
        fs::write(&path, "size 64").unwrap();
        assert!(expand(typed).is_err());
    }
}
