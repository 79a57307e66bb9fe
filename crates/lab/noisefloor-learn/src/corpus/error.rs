//! Why a corpus could not be read. Every message says what, where, and what to do.

use noisefloor_image::StackError;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a corpus could not be read.
#[derive(Debug, Error)]
pub enum CorpusError {
    #[error("{}: cannot be read: {source}; a corpus is a folder with thresholds.csv and its stacks", path.display())]
    Io {
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    #[error("{}, line {line}: {what}; the columns are scene,renderer,zone,x,y,width,height,human_spp,first_spp,last_spp", path.display())]
    Row {
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        what: String,
    },
    #[error("{}: zone {zone} of {scene} has no images: neither folder {} nor {} is there; add one of them", dir.display(), of_scene.display(), of_zone.display())]
    NoImages {
        dir: PathBuf,
        scene: String,
        zone: u32,
        /// Where running means of the scene would be.
        of_scene: PathBuf,
        /// Where batches of the zone would be.
        of_zone: PathBuf,
    },
    #[error("{}: zone folders hold one scene, but thresholds.csv names {one} and {other}; give each a folder of its own", dir.display())]
    Scenes { dir: PathBuf, one: String, other: String },
    #[error("no scene {scene} in this corpus; it has {known}")]
    Unknown {
        scene: String,
        /// The scenes there are, comma-separated.
        known: String,
    },
    #[error("{}: zone {zone} of {scene} is not inside the {width}×{height} image; correct thresholds.csv", path.display())]
    Zone {
        path: PathBuf,
        scene: String,
        zone: u32,
        /// The image's width in pixels.
        width: usize,
        /// The image's height in pixels.
        height: usize,
    },
    #[error(transparent)]
    Stack(#[from] StackError),
}
