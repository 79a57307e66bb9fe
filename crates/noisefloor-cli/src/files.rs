//! JSON, each file complete or not there at all; and pictures to compare with.

use anyhow::bail;
use noisefloor::Rgb;
use noisefloor_image::{read_exr, write_atomic};
use serde::Serialize;
use std::fs::File;
use std::io::Read;
use std::path::Path;

pub fn write_json(path: &Path, value: &impl Serialize) -> anyhow::Result<()> {
    write_atomic(path, |to| serde_json::to_writer_pretty(to, value))?;
    Ok(())
}

/// Reads a small text that somebody has typed: a regular file, since a pipe might never end.
pub fn read_small(path: &Path) -> anyhow::Result<String> {
    const MOST: u64 = 1 << 20;
    if !std::fs::metadata(path)?.is_file() {
        bail!("is a folder, a pipe or a device; name a file");
    }
    let mut text = String::new();
    File::open(path)?.take(MOST + 1).read_to_string(&mut text)?;
    if text.len() as u64 > MOST {
        bail!("is longer than a megabyte; name the file that was meant");
    }
    Ok(text)
}

/// A picture to compare a render of that size with: linear radiance, row-major, all of it finite.
pub fn read_reference(path: &Path, (width, height): (usize, usize)) -> anyhow::Result<Vec<Rgb>> {
    let image = read_exr(path)?;
    if (image.width, image.height) != (width, height) {
        let (w, h) = (image.width, image.height);
        bail!("{} has {w}×{h} pixels, the render {width}×{height}: set --size {w}x{h}", path.display());
    }
    if !image.pixels.iter().flatten().all(|c| c.is_finite()) {
        bail!("{} has pixels that are not finite, so nothing can be compared with it", path.display());
    }
    Ok(image.pixels)
}
