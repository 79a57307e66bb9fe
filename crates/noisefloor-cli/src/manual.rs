//! `completions` and `man`: what shells and `man` know of a command.

use crate::say;
use crate::say::print;
use crate::sources::ADAPTERS;
use anyhow::Context;
use clap::builder::PossibleValuesParser;
use clap_complete::Shell;
use noisefloor_denoise::OIDN;
use noisefloor_ptwne::scenes;
use noisefloor_rivals::RIVALS;
use noisefloor_vision::PRESETS;
use std::collections::BTreeSet;
use std::path::Path;

/// Prints the completions of a command for a shell.
pub fn completions(command: clap::Command, shell: Shell) -> anyhow::Result<()> {
    let mut script = Vec::new();
    let mut command = with_values(command, shell);
    let name = command.get_name().to_owned();
    clap_complete::generate(shell, &mut command, name, &mut script);
    print(format_args!("{}", String::from_utf8(script)?))?;
    Ok(())
}

/// The command as shells know it: with the words that options take beside numbers and files.
fn with_values(mut command: clap::Command, shell: Shell) -> clap::Command {
    let names: Vec<String> = command.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    for name in names {
        command = command.mut_subcommand(name, |command| with_values(command, shell));
    }
    command.mut_args(|arg| {
        let values = words(arg.get_id().as_str(), shell);
        if values.is_empty() { arg } else { arg.value_parser(PossibleValuesParser::new(values)) }
    })
}

/// What can be typed for an argument, as far as these are words.
fn words(argument: &str, shell: Shell) -> Vec<&'static str> {
    match argument {
        // Where it is none of these, bash goes on with files; other shells do not
        "scene" | "scenes" if shell == Shell::Bash => {
            scenes::list().chain(scenes::stiff()).map(|scene| scene.name).collect()
        }
        "source" => ["ptwne", "exr"].into_iter().chain(ADAPTERS.iter().map(|adapter| adapter.name)).collect(),
        "install" => {
            let renderers: BTreeSet<_> = ADAPTERS.iter().map(|adapter| adapter.renderer.name).collect();
            renderers.into_iter().chain([OIDN.name]).collect()
        }
        "criterion" => ["oracle"].into_iter().chain(RIVALS.iter().map(|rival| rival.name)).collect(),
        "tone_mapping" => vec!["reinhard", "srgb"],
        "lut_input" => vec!["linear", "srgb", "acescct"],
        "viewing" => PRESETS.iter().map(|preset| preset.name).collect(),
        "audience" => vec!["observers", "art-students"],
        "exposure_from" => vec!["first", "each"],
        _ => Vec::new(),
    }
}

/// Writes one page for the command, and one for each of its commands.
pub fn man(command: clap::Command, dir: &Path) -> anyhow::Result<()> {
    let written = || format!("{}: man pages cannot be written there", dir.display());
    std::fs::create_dir_all(dir).with_context(written)?;
    clap_mangen::generate_to(command, dir).with_context(written)?;
    say!("written to {}", dir.display())?;
    Ok(())
}
