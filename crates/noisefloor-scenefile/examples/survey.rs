//! Loads every scene file under some folders: `survey FOLDER…`. Prints a line for each file, and a count at
//! the end. A scene may name files anywhere in its folder of the command line; volumes are left out.

#![expect(clippy::print_stdout, reason = "a table for people")]

use noisefloor_scenefile::{LoadOptions, group_warnings, load_with};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let (mut loaded, mut refused) = (0, 0);
    for folder in std::env::args().skip(1) {
        let mut files = Vec::new();
        collect(Path::new(&folder), &mut files)?;
        files.sort();
        let mut options = LoadOptions::default();
        options.ignore_volumes = true;
        options.root = Path::new(&folder).is_dir().then(|| folder.clone().into());
        for file in &files {
            let start = Instant::now();
            let (outcome, findings) = match load_with(file, &options) {
                Ok(scene) => {
                    loaded += 1;
                    ("loaded", group_warnings(&scene.warnings))
                }
                Err(error) => {
                    refused += 1;
                    ("refused", error.findings())
                }
            };
            let findings: Vec<String> = findings.into_iter().map(|f| f.what).collect();
            let seconds = start.elapsed().as_secs_f64();
            println!("{}\t{seconds:.1} s\t{outcome}\t{}", file.display(), findings.join(" | "));
        }
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
