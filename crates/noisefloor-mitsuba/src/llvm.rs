//! Finds libLLVM and its version.

use std::path::{Path, PathBuf};

/// The environment variable by which Dr.Jit finds it.
pub(crate) const VARIABLE: &str = "DRJIT_LIBLLVM_PATH";
/// The oldest version that works: 14 is refused, 15 and 16 abort the process.
const OLDEST: u32 = 17;

/// What was found.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Llvm {
    Usable(PathBuf),
    TooOld(PathBuf, u32),
    Missing,
}

impl Llvm {
    /// What is wrong, and how to fix it.
    pub(crate) fn note(&self) -> Option<String> {
        let found = match self {
            Self::Usable(_) => return None,
            Self::TooOld(path, version) => format!("{} is version {version}", path.display()),
            Self::Missing => "none was found".to_owned(),
        };
        Some(format!(
            "the fast variant llvm_ad_rgb needs libLLVM {OLDEST} or newer, but {found}; using scalar_rgb. \
             {}, or set {VARIABLE} to the path of one",
            if cfg!(target_os = "macos") {
                "Run `brew install llvm`"
            } else if cfg!(windows) {
                "Install LLVM for Windows"
            } else {
                "Install it (on Debian and Ubuntu `apt install libllvm19`)"
            }
        ))
    }
}

/// The library that the variable names, or the newest in the usual places.
pub(crate) fn find() -> Llvm {
    match std::env::var_os(VARIABLE).filter(|path| !path.is_empty()) {
        Some(path) => judge(PathBuf::from(path)),
        None => search(&usual_places()),
    }
}

/// A library that the user names: trusted if its version is unknown.
fn judge(path: PathBuf) -> Llvm {
    match version(&path) {
        _ if !path.is_file() => Llvm::Missing,
        Some(old) if old < OLDEST => Llvm::TooOld(path, old),
        _ => Llvm::Usable(path),
    }
}

fn search(places: &[PathBuf]) -> Llvm {
    let files = places.iter().filter_map(|place| std::fs::read_dir(place).ok()).flatten().flatten();
    let libraries = files.map(|file| file.path()).filter(|path| is_library(path));
    // The newest; among links to one library, always the same
    let known = libraries.filter_map(|path| Some((version(&path)?, path)));
    match known.max_by(|(a, one), (b, other)| a.cmp(b).then_with(|| other.cmp(one))) {
        Some((new, path)) if new >= OLDEST => Llvm::Usable(path),
        Some((old, path)) => Llvm::TooOld(path, old),
        None => Llvm::Missing,
    }
}

fn usual_places() -> Vec<PathBuf> {
    let fixed = [
        "/usr/lib/x86_64-linux-gnu",
        "/usr/lib/aarch64-linux-gnu",
        "/usr/lib64",
        "/usr/lib",
        "/usr/local/lib",
        "C:\\Program Files\\LLVM\\bin",
    ];
    let mut places: Vec<PathBuf> = fixed.iter().map(PathBuf::from).collect();
    // Folders of one version each: /usr/lib/llvm-19/lib, /usr/lib64/llvm19/lib64,
    // /opt/homebrew/opt/llvm@19/lib
    for parent in ["/usr/lib", "/usr/lib64", "/opt/homebrew/opt", "/usr/local/opt"] {
        for entry in std::fs::read_dir(parent).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with("llvm") {
                places.extend(["lib", "lib64"].map(|lib| entry.path().join(lib)));
            }
        }
    }
    places
}

/// libLLVM-19.so, libLLVM.so.19.1, libLLVM.dylib, LLVM-C.dll; not libLLVMCore.a.
fn is_library(path: &Path) -> bool {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return false };
    let rest = name.strip_prefix("libLLVM").filter(|rest| rest.starts_with(['-', '.']));
    name == "LLVM-C.dll" || rest.is_some_and(|rest| rest.contains(".so") || rest.ends_with(".dylib"))
}

/// The major version: the first number in the file's name, else in the name of what it links to, else in that
/// of its folders.
fn version(path: &Path) -> Option<u32> {
    let target = path.canonicalize();
    let target = target.as_deref().unwrap_or(path);
    let names = [path.file_name(), target.file_name()].into_iter().flatten();
    let folders = target.components().rev().skip(1).map(|component| component.as_os_str());
    names.chain(folders).find_map(|name| {
        let name = name.to_str()?;
        // Only folders that are named for a version: llvm-19, llvm@19, 19.1.7
        let telling =
            name.to_ascii_lowercase().contains("llvm") || name.starts_with(|c: char| c.is_ascii_digit());
        let digits = name.find(|c: char| c.is_ascii_digit()).filter(|_| telling)?;
        let number = name[digits..].split(|c: char| !c.is_ascii_digit()).next()?;
        number.parse().ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_in_names() {
        for (path, right) in [
            ("/usr/lib/x86_64-linux-gnu/libLLVM-19.so", Some(19)),
            ("/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", Some(19)),
            ("/usr/lib/llvm-14/lib/libLLVM-14.0.6.so.1", Some(14)),
            ("/usr/lib/llvm-17/lib/libLLVM.so", Some(17)),
            ("/opt/homebrew/Cellar/llvm@18/18.1.8/lib/libLLVM.dylib", Some(18)),
            ("/opt/libLLVM.so", None),
        ] {
            assert_eq!(version(Path::new(path)), right, "{path}");
        }
        for (name, right) in [("libLLVMCore.a", false), ("libLLVM-19.so.1", true), ("libLLVM.so", true)] {
            assert_eq!(is_library(Path::new(name)), right, "{name}");
        }
    }

    #[test]
    fn the_newest_is_found_and_old_ones_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let places = [folder.path().join("not there"), folder.path().to_owned()];
        let file = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "").unwrap();
            path
        };
        assert_eq!(search(&places), Llvm::Missing);
        let old = file("libLLVM-15.so");
        file("libLLVM-14.so");
        assert_eq!(search(&places), Llvm::TooOld(old.clone(), 15));
        assert!(search(&places).note().is_some_and(|note| note.contains("is version 15")));
        let new = file("libLLVM-19.so");
        file("libLLVM-17.so.1");
        assert_eq!(search(&places), Llvm::Usable(new.clone()));
        assert_eq!(judge(old.clone()), Llvm::TooOld(old, 15));
        assert_eq!(judge(new.clone()), Llvm::Usable(new));
        assert_eq!(judge(folder.path().join("libLLVM-18.so")), Llvm::Missing);
        assert_eq!(Llvm::Usable("x".into()).note(), None);
    }
}
