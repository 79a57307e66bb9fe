//! `scenes check`: what scene files hold that is not rendered as it is meant.

use crate::args::CheckArgs;
use noisefloor_cli::say::say;
use noisefloor_scenefile::{Treatment, group_warnings, load_with};
use std::process::ExitCode;

/// Loads each file, and lists what was found in it.
pub fn check(args: CheckArgs) -> anyhow::Result<ExitCode> {
    let options = args.scene_files.check();
    let mut code = ExitCode::SUCCESS;
    for file in &args.files {
        let (summary, findings) = match load_with(file, &options) {
            Ok(loaded) => {
                (format!("loads: {} surfaces", loaded.scene.surfaces()), group_warnings(&loaded.warnings))
            }
            Err(error) => {
                code = ExitCode::FAILURE;
                ("does not load".to_owned(), error.findings())
            }
        };
        say!("{}: {summary}", file.display())?;
        for finding in &findings {
            let treatment = match finding.treatment {
                Treatment::Refused => "refused",
                Treatment::Approximated => "approximated",
                _ => "ignored",
            };
            say!("  {treatment}: {finding}")?;
        }
    }
    Ok(code)
}
