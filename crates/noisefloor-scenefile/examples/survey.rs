//! Loads every scene file under some folders: `survey FOLDER…`. Prints one line a file, its outcome first, and a
//! count by outcome at the end.

#![expect(clippy::print_stdout, reason = "a table for people")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut files = Vec::new();
    for folder in std::env::args().skip(1) {
        collect(Path::new(&folder), &mut files)?;
    }
    files.sort();
    let (mut loaded, mut refused) = (0, 0);
    for file in &files {
        let start = Instant::now();
        let outcome = match noisefloor_scenefile::load(file) {
            Ok(scene) => {
                loaded += 1;
                format!("loaded\t{} surfaces, {} warnings", scene.scene.surfaces(), scene.warnings.len())
            }
            Err(error) => {
                refused += 1;
                format!("refused\t{}", with_causes(&error))
            }
        };
        println!(
            "{}\t{:.1} s\t{}",
            file.display(),
            start.elapsed().as_secs_f64(),
            outcome.replace('\n', " | ")
        );
    }
    println!("{loaded} loaded, {refused} refused");
    Ok(())
}

/// Adds the scene files in `folder` and below. Of XML files, those that look like a scene of Mitsuba.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if folder.is_file() {
        files.push(folder.to_owned());
        return Ok(());
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let wanted = match extension {
            "gltf" | "glb" | "pbrt" => true,
            "xml" => String::from_utf8_lossy(&std::fs::read(&path)?).contains("<scene version="),
            _ => false,
        };
        if path.is_dir() {
            collect(&path, files)?;
        } else if wanted {
            files.push(path);
        }
    }
    Ok(())
}

/// An error and its causes.
fn with_causes(error: &dyn Error) -> String {
    let mut message = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        message += &format!(": {error}");
        cause = error.source();
    }
    message
}
