//! Files that a scene file names, how much of them is read, and what was in them.

use crate::error::{LoadError, LoadFault, Place};
use noisefloor::source::SourceIdentity;
use noisefloor::text::stand_in;
pub(crate) use noisefloor::text::{lines, text};
use noisefloor_ptwne::check_memory;
use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Bytes of memory that a byte of a file becomes at most while it is read: numbers as text, rows of a mesh.
const EACH_BYTE: u64 = 8;
/// The same of XML and JSON, whose elements become objects.
const EACH_BYTE_OF_TREES: u64 = 32;

/// Longest mesh or picture that is read, in bytes.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 28;
/// Most bytes of all files, each counted as often as it is read.
const MAX_BYTES: u64 = 1 << 34;

/// How much of something a scene may have: so much any, and so much more for each byte of its files. A limit on each part
/// alone would let a short file name a part any number of times.
struct Allowance {
    what: &'static str,
    free: u64,
    a_byte: u64,
}

/// What compressed data may become. Deflate makes at most 1032 bytes of one, but meshes at most some 30 (those of Draco).
const INFLATED: Allowance = Allowance { what: "inflated bytes so far", free: 1 << 26, a_byte: 256 };
/// Pixels, of which deflate makes 344 from a byte if they are RGB.
const PIXELS: Allowance = Allowance { what: "pixels of pictures so far", free: 1 << 25, a_byte: 512 };
/// Text has a triangle in some 30 bytes, of which three levels of subdivision make 64.
const SURFACES: Allowance = Allowance { what: "surfaces so far", free: 1 << 21, a_byte: 2 };
/// Most folders that a scene may add to those where its files are looked for.
const MAX_FOLDERS: u64 = 64;

/// Where the files are that a scene names. Nothing outside one folder is read.
#[derive(Debug)]
pub(crate) struct Folder {
    /// The folder that nothing may leave.
    root: PathBuf,
    /// The scene's own folder, and those that it adds.
    searched: Vec<PathBuf>,
    /// Digests of all files that were read.
    contents: RefCell<SourceIdentity>,
    /// Bytes that were read, those of a file that is read again counted again.
    bytes: Cell<u64>,
    /// The files that were read, and the bytes that they have together.
    distinct: RefCell<HashSet<PathBuf>>,
    distinct_bytes: Cell<u64>,
    /// What compressed data became so far, in bytes and in pixels.
    inflated: Cell<u64>,
    pixels: Cell<u64>,
    /// Surfaces so far.
    surfaces: Cell<u64>,
}

impl Folder {
    /// The folder that holds `scene`. Its files must lie in `root`, by default as [`LoadOptions::root`] says.
    ///
    /// [`LoadOptions::root`]: crate::LoadOptions::root
    /// `options` are what changes the scene beside its files.
    pub(crate) fn of(scene: &Path, root: Option<&Path>, options: String) -> Self {
        let path = match scene.parent() {
            Some(parent) if parent != Path::new("") => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        let root = root.map_or_else(|| shared(&path), Path::to_owned);
        let contents = RefCell::new(SourceIdentity::new(options));
        Self {
            root,
            searched: vec![path],
            contents,
            bytes: Cell::new(0),
            distinct: RefCell::default(),
            distinct_bytes: Cell::new(0),
            inflated: Cell::new(0),
            pixels: Cell::new(0),
            surfaces: Cell::new(0),
        }
    }

    /// Adds a folder, relative to the scene's own, in which to look for files.
    pub(crate) fn search(&mut self, name: &str, place: &Place) -> Result<(), LoadError> {
        place.at_most("search paths", self.searched.len() as u64, MAX_FOLDERS)?;
        let path = self.find(name, place)?;
        self.searched.push(path);
        Ok(())
    }

    /// The file called `name` at `place`: the first there is, as seen from the scene's folder and those added
    /// to it. Backslashes separate folders, too, and where no file has spaces around its name, they do not
    /// count.
    ///
    /// # Errors
    /// [`LoadFault::Outside`] if the name, or a link on the way, leads out of the root; [`LoadFault::Read`]
    /// if there is no such file.
    pub(crate) fn find(&self, name: &str, place: &Place) -> Result<PathBuf, LoadError> {
        let outside = || place.error(LoadFault::Outside(name.to_owned()));
        let failed = |cause| place.error(LoadFault::Read(cause));
        let name = name.replace('\\', "/");
        let bare = Some(name.trim()).filter(|bare| *bare != name);
        let names = [Some(name.as_str()), bare].into_iter().flatten().map(Path::new);

        // Names, whether or not the files exist
        let mut first_missing = None;
        for (relative, folder) in
            names.flat_map(|name| self.searched.iter().map(move |folder| (name, folder)))
        {
            if !self.stays_inside(folder, relative) {
                continue;
            }
            // Links
            let path = folder.join(relative);
            match path.canonicalize() {
                Ok(real) => {
                    let root = self.root.canonicalize().map_err(failed)?;
                    return if real.starts_with(root) { Ok(path) } else { Err(outside()) };
                }
                Err(cause) => first_missing = first_missing.or(Some((path, cause))),
            }
        }
        match first_missing {
            None => Err(outside()),
            Some((path, cause)) => {
                Err(failed(io::Error::new(cause.kind(), format!("`{}`: {cause}", path.display()))))
            }
        }
    }

    /// Reads a regular file of at most `limit` bytes that is named at `place`, and notes what is in it.
    pub(crate) fn read(&self, path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
        let bytes = read(path, limit, place)?;
        self.bytes.set(self.bytes.get().saturating_add(bytes.len() as u64));
        place.at_most("bytes of files so far", self.bytes.get(), MAX_BYTES)?;
        if self.distinct.borrow_mut().insert(path.to_owned()) {
            self.distinct_bytes.set(self.distinct_bytes.get() + bytes.len() as u64);
        }
        if let Some(instead) = stand_in(&bytes) {
            return Err(Place::file(path).bad(instead));
        }
        // As seen from the scene, which may be moved with its files
        let name = path.strip_prefix(&self.searched[0]).unwrap_or(path).display().to_string();
        self.contents.borrow_mut().add(name, &bytes);
        Ok(bytes)
    }

    /// Counts bytes that compressed data becomes, before it does.
    pub(crate) fn inflate(&self, bytes: u64, place: &Place) -> Result<(), LoadError> {
        self.count(&self.inflated, bytes, &INFLATED, place)
    }

    /// How many bytes compressed data may still become.
    pub(crate) fn left(&self) -> u64 {
        self.most(&INFLATED).saturating_sub(self.inflated.get())
    }

    /// Counts pixels of a picture, before they are decoded.
    pub(crate) fn draw(&self, pixels: u64, place: &Place) -> Result<(), LoadError> {
        self.count(&self.pixels, pixels, &PIXELS, place)
    }

    /// Counts surfaces, before or after they are made.
    pub(crate) fn build(&self, surfaces: u64, place: &Place) -> Result<(), LoadError> {
        self.count(&self.surfaces, surfaces, &SURFACES, place)
    }

    /// How many more surfaces there may be.
    pub(crate) fn unbuilt(&self) -> u64 {
        self.most(&SURFACES).saturating_sub(self.surfaces.get())
    }

    fn count(&self, sum: &Cell<u64>, more: u64, of: &Allowance, place: &Place) -> Result<(), LoadError> {
        sum.set(sum.get().saturating_add(more));
        place.at_most(of.what, sum.get(), self.most(of))
    }

    fn most(&self, of: &Allowance) -> u64 {
        self.distinct_bytes.get().saturating_mul(of.a_byte).saturating_add(of.free)
    }

    /// Digests of all files that were read.
    pub(crate) fn contents(&self) -> SourceIdentity {
        self.contents.borrow().clone()
    }

    /// Whether `name`, seen from `folder`, stays below the root, judged only by names.
    fn stays_inside(&self, folder: &Path, name: &Path) -> bool {
        // How far the folder is below the root
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let inside = real(folder).strip_prefix(real(&self.root)).ok().map(|path| path.components().count());
        let mut depth = inside.unwrap_or(0);
        for component in name.components() {
            match component {
                Component::Normal(_) => depth += 1,
                Component::CurDir => {}
                Component::ParentDir => match depth.checked_sub(1) {
                    Some(up) => depth = up,
                    None => return false,
                },
                Component::Prefix(_) | Component::RootDir => return false,
            }
        }
        true
    }
}

/// The farthest folder that a scene in `folder` shares with others: up to two above its own. Meshes and
/// textures of a collection lie there. It must be deep enough that a scene cannot show what is no part of
/// the collection.
fn shared(folder: &Path) -> PathBuf {
    let home = std::env::var_os("HOME").or_else(|| std::env::var_os("USERPROFILE")).map(PathBuf::from);
    let home = home.and_then(|home| home.canonicalize().ok());
    let temporary = std::env::temp_dir().canonicalize().unwrap_or_default();
    let Ok(real) = folder.canonicalize() else { return folder.to_owned() };
    let above = real.ancestors().skip(1).take(2);
    above
        .take_while(|above| {
            is_private_to_a_collection(above, home.as_deref()) && !temporary.starts_with(above)
        })
        .last()
        .map_or_else(|| folder.to_owned(), Path::to_owned)
}

/// Whether nothing but scenes is likely to lie in a folder.
fn is_private_to_a_collection(folder: &Path, home: Option<&Path>) -> bool {
    let names = |path: &Path| path.components().filter(|c| matches!(c, Component::Normal(_))).count();
    let below_home = match home.map(|home| (folder.strip_prefix(home), home.starts_with(folder))) {
        Some((_, true)) => return false,
        Some((Ok(rest), _)) => names(rest),
        _ => usize::MAX,
    };
    names(folder) >= 3 && below_home >= 2
}

/// Checks that there is memory for what so many bytes become.
pub(crate) fn has_memory(bytes: u64, each: u64, place: &Place) -> Result<(), LoadError> {
    let bytes = usize::try_from(bytes.saturating_mul(each)).unwrap_or(usize::MAX);
    check_memory(bytes).map_err(place.refused())
}

/// Reads a regular file.
fn read(path: &Path, limit: u64, place: &Place) -> Result<Vec<u8>, LoadError> {
    let failed = |cause: io::Error| {
        // Where another file names it
        let cause = match *place == Place::file(path) {
            true => cause,
            false => io::Error::new(cause.kind(), format!("`{}`: {cause}", path.display())),
        };
        place.error(LoadFault::Read(cause))
    };

    // A pipe or a device would block or never end
    let meta = std::fs::metadata(path).map_err(failed)?;
    if !meta.is_file() {
        return Err(failed(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
    }
    Place::file(path).at_most("bytes", meta.len(), limit)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let tree = matches!(extension.as_str(), "xml" | "gltf");
    has_memory(meta.len(), if tree { EACH_BYTE_OF_TREES } else { EACH_BYTE }, place)?;

    // A file that grows while it is read is cut off
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(limit).read_to_end(&mut bytes)).map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collections_are_below_home_and_the_top() {
        let home = Some(Path::new("/home/ada"));
        for (folder, private) in [
            ("/home/ada/scenes/rooms", true),
            ("/home/ada/scenes", false),
            ("/home/ada", false),
            ("/home", false),
            ("/", false),
            ("/tmp/x", false),
            ("/data/scenes/rooms", true),
            ("/home/adam/scenes/rooms", true),
        ] {
            assert_eq!(is_private_to_a_collection(Path::new(folder), home), private, "{folder}");
        }
        assert!(is_private_to_a_collection(Path::new("/a/b/c"), None));
    }

    /// Two folders up, and no farther: other scenes' files are found, what lies beyond is not.
    #[test]
    fn scenes_share_what_lies_nearby() {
        let top = tempfile::tempdir().unwrap();
        let scene = top.path().join("a/b/collection/rooms/kitchen");
        std::fs::create_dir_all(&scene).unwrap();
        for name in ["a/b/secret", "a/b/collection/shared", "a/b/collection/rooms/near"] {
            std::fs::write(top.path().join(name), "").unwrap();
        }
        let folder = Folder::of(&scene.join("scene.xml"), None, String::new());
        let find = |name: &str| folder.find(name, &Place::file(Path::new("scene.xml")));
        assert!(find("../near").is_ok() && find("../../shared").is_ok());
        let error = find("../../../secret").unwrap_err();
        assert!(matches!(error.fault, LoadFault::Outside(_)) && error.to_string().contains("--scene-root"));
        // Asked for, it is strict
        let folder = Folder::of(&scene.join("scene.xml"), Some(&scene), String::new());
        assert!(folder.find("../near", &Place::file(Path::new("scene.xml"))).is_err());
    }
}
