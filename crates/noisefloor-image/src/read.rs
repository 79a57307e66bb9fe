//! Reading a picture in whichever format its first bytes announce.

use crate::error::PictureError;
use crate::facts::read_facts;
use crate::open::{Format, Opened};
use crate::picture::Picture;
use crate::{decode_exr, decode_pfm, decode_png};
use noisefloor::{stills::Still, viewing::Viewing};
use std::path::Path;

/// Reads an EXR, PFM or PNG file. Its first bytes tell the format; its name does not matter.
///
/// # Errors
/// Those of [`read_exr`](crate::read_exr), [`read_pfm`](crate::read_pfm) and [`read_png`](crate::read_png);
/// [`PictureError::Foreign`] for any other format.
pub fn read_picture(path: impl AsRef<Path>) -> Result<Picture, PictureError> {
    read_picture_within(path, noisefloor::tile::MAX_PIXELS)
}

/// [`read_picture_within`], to be shown on a display other than the usual one. It takes the codes of a PNG
/// that states no colours, states sRGB, or states what the display takes, such as PQ; all others are
/// converted to sRGB if it takes that.
///
/// # Errors
/// Those of [`read_picture_within`], and [`PictureError::Colours`] if this display does not take the colours
/// of a PNG.
pub fn read_picture_on(
    path: impl AsRef<Path>,
    viewing: &Viewing,
    most: usize,
) -> Result<Picture, PictureError> {
    let path = path.as_ref();
    let opened = Opened { most_pixels: most, ..Opened::open(path)? };
    match opened.format {
        Format::Exr => decode_exr::decode(path, opened).map(Picture::Linear),
        Format::Pfm => decode_pfm::decode(path, opened).map(Picture::Linear),
        Format::Png => decode_png::decode(path, opened, viewing).map(Picture::Display),
        _ => Err(opened.foreign(path, "an OpenEXR, PFM or PNG file")),
    }
}

/// [`read_picture`], limited to `most` pixels: a larger picture is refused before any pixel is allocated.
///
/// # Errors
/// Those of [`read_picture`], and [`PictureError::Large`].
pub fn read_picture_within(path: impl AsRef<Path>, most: usize) -> Result<Picture, PictureError> {
    read_picture_on(path, &Viewing::default(), most)
}

/// [`read_picture`], as one side of a comparison: with `spp` samples per pixel, or with those that the file
/// says it has. Whatever it says of where they come from is kept.
///
/// # Errors
/// Those of [`read_picture`]; without `spp`, also [`PictureError::NoSamples`] and
/// [`PictureError::UnevenSamples`].
pub fn read_still(path: impl AsRef<Path>, spp: Option<f64>) -> Result<Still, PictureError> {
    read_still_on(path, spp, &Viewing::default())
}

/// [`read_still`], to be shown on this display: see [`read_picture_on`].
///
/// # Errors
/// Those of [`read_still`] and [`read_picture_on`].
pub fn read_still_on(
    path: impl AsRef<Path>,
    spp: Option<f64>,
    viewing: &Viewing,
) -> Result<Still, PictureError> {
    let path = path.as_ref();
    // What is no picture has no samples either
    let (picture, facts) = (read_picture_on(path, viewing, noisefloor::tile::MAX_PIXELS)?, read_facts(path)?);
    let spp = match (spp, facts.samples) {
        (Some(spp), _) => spp,
        (None, Some((fewest, most))) if fewest < most => {
            return Err(PictureError::UnevenSamples { path: path.to_owned(), fewest, most });
        }
        (None, Some((_, spp))) => spp as f64,
        (None, None) => return Err(PictureError::NoSamples { path: path.to_owned() }),
    };
    Ok(Still { origin: facts.origin, ..picture.into_still(spp) })
}
