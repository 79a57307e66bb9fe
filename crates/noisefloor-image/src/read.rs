//! Reading a picture in whichever format its first bytes announce.

use crate::error::{PictureError, PictureFault};
use crate::facts::read_facts;
use crate::open::{Format, Opened, ReadOptions};
use crate::picture::Picture;
use crate::{decode_exr, decode_pfm, decode_png};
use noisefloor::stills::Still;
use std::path::Path;

/// Reads an EXR, PFM or PNG file. Its first bytes tell the format; its name does not matter.
///
/// # Errors
/// Those of [`read_exr`](crate::read_exr), [`read_pfm`](crate::read_pfm) and [`read_png`](crate::read_png);
/// [`PictureFault::Foreign`] for any other format.
pub fn read_picture(path: impl AsRef<Path>) -> Result<Picture, PictureError> {
    read_picture_with(path, &ReadOptions::default())
}

/// [`read_picture`], with what it leaves open.
///
/// # Errors
/// Those of [`read_picture`]; [`PictureFault::Large`], [`PictureFault::NoLayer`] if there is no such layer or the
/// format has none, and [`PictureFault::Colours`] if the display does not take the colours of a PNG.
pub fn read_picture_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Picture, PictureError> {
    let path = path.as_ref();
    let opened =
        Opened { most_pixels: options.most_pixels, ..Opened::open(path)? }.with_layer(path, options)?;
    match opened.format {
        Format::Exr => decode_exr::decode(path, opened).map(Picture::Linear),
        Format::Pfm => decode_pfm::decode(path, opened).map(Picture::Linear),
        Format::Png => decode_png::decode(path, opened, &options.viewing).map(Picture::Display),
        _ => Err(opened.foreign(path, "an OpenEXR, PFM or PNG file")),
    }
}

/// [`read_picture`], as one side of a comparison: with `spp` samples per pixel, or with those that the file
/// says it has. Whatever it says of where they come from is kept.
///
/// # Errors
/// Those of [`read_picture`]; without `spp`, also [`PictureFault::NoSamples`] and
/// [`PictureFault::UnevenSamples`].
pub fn read_still(path: impl AsRef<Path>, spp: Option<f64>) -> Result<Still, PictureError> {
    read_still_with(path, spp, &ReadOptions::default())
}

/// [`read_still`], with what it leaves open.
///
/// # Errors
/// Those of [`read_still`] and [`read_picture_with`].
pub fn read_still_with(
    path: impl AsRef<Path>,
    spp: Option<f64>,
    options: &ReadOptions,
) -> Result<Still, PictureError> {
    let path = path.as_ref();
    // What is no picture has no samples either
    let (picture, facts) = (read_picture_with(path, options)?, read_facts(path)?);
    let spp = match (spp, facts.samples) {
        (Some(spp), _) => spp,
        (None, Some((fewest, most))) if fewest < most => {
            return Err(PictureFault::UnevenSamples { fewest, most }.of(path));
        }
        (None, Some((_, spp))) => spp as f64,
        (None, None) => return Err(PictureFault::NoSamples.of(path)),
    };
    Ok(picture.into_still(spp).with_origin(facts.origin))
}
