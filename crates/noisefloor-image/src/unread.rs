//! What a picture's file holds beside the colours that are read, for a warning.

use crate::colours::Stated;
use crate::decode_exr::{Layout, alpha_of, layout_of};
use crate::error::PictureError;
use crate::open::{Format, Opened};
use crate::{ReadOptions, decode_png, read_picture_with};
use std::ops::RangeInclusive;
use std::path::Path;

/// What is not read of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unread {
    /// The layer that is read, and all others that have colours, in the order of preference; empty if there
    /// is only one. The unnamed one has an empty name.
    pub layers: Vec<String>,
    /// Least and largest alpha, if there is alpha.
    pub alpha: Option<RangeInclusive<f32>>,
    /// The colours of a PNG that are for a display with light above the white of sRGB.
    pub hdr: Option<String>,
}

impl Unread {
    /// In words, one sentence each: nothing if all that matters is read.
    pub fn warnings(&self) -> Vec<String> {
        let name =
            |layer: &String| if layer.is_empty() { "the unnamed one".to_owned() } else { layer.clone() };
        let mut all = Vec::new();
        if let [read, others @ ..] = self.layers.as_slice() {
            let others: Vec<String> = others.iter().map(name).collect();
            let (read, others) = (name(read), others.join(", "));
            all.push(format!("of its layers, {read} is read, and not {others}; another is read by --layer"));
        }
        match &self.alpha {
            Some(alpha) if *alpha.end() <= 0.0 => all.push(
                "its alpha is 0 everywhere, so viewers show nothing; alpha is ignored, and colours are read as stored"
                    .to_owned(),
            ),
            Some(alpha) if *alpha.start() < 1.0 => all.push(
                "it is transparent in places; alpha is ignored, and colours are read as stored"
                    .to_owned(),
            ),
            _ => {}
        }
        if let Some(colours) = &self.hdr {
            all.push(format!(
                "it states {colours}; on a display without HDR, its white is 203 cd/m², \
                 and lighter parts are clipped"
            ));
        }
        all
    }
}

/// Finds what [`read_picture_with`](crate::read_picture_with) leaves out. Reads the pixels again if there is alpha.
///
/// # Errors
/// Those of [`read_picture_with`](crate::read_picture_with).
pub fn read_unread(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Unread, PictureError> {
    let path = path.as_ref();
    let open = || Opened::open(path)?.with_layer(path, options);
    let opened = open()?;
    match opened.format {
        Format::Exr => {
            let Layout { layers, has_alpha } = layout_of(path, opened)?;
            let layers = if layers.len() > 1 { layers } else { Vec::new() };
            let alpha = if has_alpha { Some(alpha_of(path, open()?)?) } else { None };
            Ok(Unread {
                layers,
                alpha: alpha.map(|image| range(image.pixels.iter().map(|p| p[0]))),
                hdr: None,
            })
        }
        Format::Png => {
            let alpha = decode_png::decode_alpha(path, opened)?;
            let colours = decode_png::stated_colours(path, open()?)?;
            let hdr = colours.filter(Stated::is_hdr).map(|colours| colours.describe());
            Ok(Unread { layers: Vec::new(), alpha: alpha.map(|alpha| range(alpha.into_iter())), hdr })
        }
        // PFM has colours only, and anything else is refused there
        _ => read_picture_with(path, options).map(|_| Unread::default()),
    }
}

fn range(values: impl Iterator<Item = f32>) -> RangeInclusive<f32> {
    let (least, most) =
        values.fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
    least..=most
}
