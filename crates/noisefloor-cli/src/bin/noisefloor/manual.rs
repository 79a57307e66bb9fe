//! `noisefloor completions` and `noisefloor man`: what shells and `man` know of the command.

use crate::args::Cli;
use anyhow::Context;
use clap_complete::Shell;
use noisefloor_cli::say;
use noisefloor_cli::say::print;
use std::path::PathBuf;

pub fn completions(shell: Shell) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::known(), "noisefloor", &mut script);
    print(format_args!("{}", String::from_utf8(script)?))?;
    Ok(())
}

/// One page for the command, and one for each of its commands.
pub fn man(dir: PathBuf) -> anyhow::Result<()> {
    let written = || format!("{}: man pages cannot be written there", dir.display());
    std::fs::create_dir_all(&dir).with_context(written)?;
    clap_mangen::generate_to(Cli::known(), &dir).with_context(written)?;
    say!("written to {}", dir.display())?;
    Ok(())
}
