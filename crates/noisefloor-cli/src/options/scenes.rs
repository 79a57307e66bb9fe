//! Options about scene files.

use clap::{Args, ValueEnum};
use noisefloor_scenefile::LoadOptions;
use std::path::PathBuf;

/// How scene files are loaded.
#[derive(Debug, Args)]
pub struct SceneFileArgs {
    /// Built-in renderer: the value of a `$NAME` in a Mitsuba file. Can be given more than once.
    #[arg(short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = definition)]
    define: Vec<(String, String)>,
    /// Built-in renderer: leave out, with a warning, what would otherwise stop a scene file from loading.
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    ignore: Vec<Ignorable>,
    /// Built-in renderer: the folder in which a scene file may name files [default: its own, or up to two
    /// above].
    #[arg(long, value_name = "DIR")]
    scene_root: Option<PathBuf>,
}

/// What can be left out of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Ignorable {
    /// Participating media, such as fog and smoke.
    Volumes,
}

impl SceneFileArgs {
    /// Checked: every value is valid.
    pub fn check(self) -> LoadOptions {
        let mut options = LoadOptions::default();
        options.parameters = self.define.into_iter().collect();
        options.ignore_volumes = self.ignore.contains(&Ignorable::Volumes);
        options.root = self.scene_root;
        options
    }
}

fn definition(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() => {
            Ok((name.trim_start_matches('$').to_owned(), value.to_owned()))
        }
        _ => Err("expected NAME=VALUE".to_owned()),
    }
}
