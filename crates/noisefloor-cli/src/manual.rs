//! `completions` and `man`: what shells and `man` know of a command.

use crate::say;
use crate::say::print;
use anyhow::Context;
use clap_complete::Shell;
use std::path::Path;

/// Prints the completions of a command for a shell.
pub fn completions(mut command: clap::Command, shell: Shell) -> anyhow::Result<()> {
    let mut script = Vec::new();
    let name = command.get_name().to_owned();
    clap_complete::generate(shell, &mut command, name, &mut script);
    print(format_args!("{}", String::from_utf8(script)?))?;
    Ok(())
}

/// Writes one page for the command, and one for each of its commands.
pub fn man(command: clap::Command, dir: &Path) -> anyhow::Result<()> {
    let written = || format!("{}: man pages cannot be written there", dir.display());
    std::fs::create_dir_all(dir).with_context(written)?;
    clap_mangen::generate_to(command, dir).with_context(written)?;
    say!("written to {}", dir.display())?;
    Ok(())
}
