//! What can be known of the files that another program reads.

use noisefloor::source::SourceIdentity;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// How much of a file is searched for names of other files, in bytes.
const SEARCHED: u64 = 64 << 20;
const MOST_FILES: usize = 10_000;
/// Longest name of a file that is looked for, in bytes.
const LONGEST: usize = 1024;
/// Files that may name others, beside the scene itself.
const NAMING: [&str; 7] = ["xml", "cfg", "scn", "py", "mtl", "pbrt", "gltf"];
/// What ends a name in the formats of the renderers: quotes, and in binary files whatever no name has.
const ENDS: &[u8] = b"\"'<>=\n\r\t\0";

/// Digests of a scene and of the files that it names: whatever stands in it between quotes, or alone in a
/// line or a binary field, and exists, as seen from the file that names it, from the scene, from the working directory, or from above the scene.
/// Names that a program puts together, and what is in compressed files, are not found.
///
/// # Errors
/// What the system says if a file cannot be read.
pub(crate) fn contents(scene: &Path, options: String) -> io::Result<SourceIdentity> {
    let mut identity = SourceIdentity::new(options);
    let scene = std::path::absolute(scene)?;
    // A folder, or a name that only the program understands
    if !scene.is_file() {
        return Ok(identity);
    }
    let home = scene.parent().unwrap_or(Path::new("/")).to_owned();
    // LuxCore's names begin at the working directory, or above the scene
    let here = std::env::current_dir().unwrap_or_default();
    let above: Vec<&Path> = home.ancestors().skip(1).collect();
    let (mut seen, mut left) = (BTreeSet::from([scene.clone()]), vec![scene.clone()]);
    while let Some(path) = left.pop() {
        let name = path.strip_prefix(&home).unwrap_or(&path).display().to_string();
        let length = std::fs::metadata(&path)?.len();
        identity.add_from(name, File::open(&path)?.take(length))?;
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        if path != scene && !NAMING.contains(&extension.as_str()) {
            continue;
        }
        let folder = path.parent().unwrap_or(&home);
        for named in named_in(&path, &[&[folder, &home, &here], &above[..]].concat())? {
            if seen.len() < MOST_FILES && seen.insert(named.clone()) {
                left.push(named);
            }
        }
    }
    Ok(identity)
}

/// Files that exist and are named in a file.
fn named_in(path: &Path, folders: &[&Path]) -> io::Result<BTreeSet<PathBuf>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(SEARCHED).read_to_end(&mut bytes)?;
    let pieces = bytes.split(|b| ENDS.contains(b)).filter(|piece| piece.len() <= LONGEST);
    let names: BTreeSet<&str> =
        pieces.filter_map(|piece| std::str::from_utf8(piece).ok()).map(name).collect();
    let files = names
        .into_iter()
        .filter(|name| looks_like_a_file(name))
        .flat_map(|name| folders.iter().map(|folder| folder.join(name)).find(|path| path.is_file()));
    Ok(files.collect())
}

/// A name without the decorations of formats: Blender begins names as seen from the scene with `//`.
fn name(piece: &str) -> &str {
    let piece = piece.trim().trim_end_matches(';');
    piece.strip_prefix("//").unwrap_or(piece)
}

/// Cheap, since a binary file has many pieces.
fn looks_like_a_file(name: &str) -> bool {
    let extension = name.rsplit_once('.').map(|(_, extension)| extension).unwrap_or_default();
    (1..=8).contains(&extension.len()) && extension.bytes().all(|b| b.is_ascii_alphanumeric())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_scene_names_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &[u8]| std::fs::write(folder.path().join(name), text).unwrap();
        std::fs::create_dir(folder.path().join("parts")).unwrap();
        write("hall.xml", b"<include filename=\"parts/walls.xml\"/><string value=\"absent.png\"/>");
        write("parts/walls.xml", b"<string name='filename' value='wood.png'/> 0.5 stone.png");
        write("parts/wood.png", b"brown");
        write("parts/stone.png", b"not quoted: not a name");
        let files = |scene: &str| {
            let identity = contents(&folder.path().join(scene), String::new()).unwrap();
            identity.files().map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(files("hall.xml"), ["hall.xml", "parts/walls.xml", "parts/wood.png"]);

        // LuxCore's properties, and Blender's fields
        write("hall.cfg", b"scene.file = hall.scn\nfilm.width = 0.5\n");
        write("hall.scn", b"scene.objects.a.ply = parts/wood.png\n");
        assert_eq!(files("hall.cfg"), ["hall.cfg", "hall.scn", "parts/wood.png"]);
        write("hall.blend", b"BLENDER\0\xff\xfe\0\0//parts/stone.png\0\0");
        assert_eq!(files("hall.blend"), ["hall.blend", "parts/stone.png"]);

        // An edit of any of them is seen
        let now = || contents(&folder.path().join("hall.xml"), String::new()).unwrap();
        let before = now();
        write("parts/wood.png", b"black");
        assert_eq!(now().change_since(&before).unwrap().to_string(), "`parts/wood.png` has changed");
    }
}
