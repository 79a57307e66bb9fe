//! Pictures in memory: linear or display-encoded.

use noisefloor::{Rgb, display::srgb_decode, stills::Still};

/// A scene-referred picture: linear RGB, Rec.709 primaries, arbitrary scale. Values may be negative or
/// non-finite.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row-major, `width * height` values.
    pub pixels: Vec<Rgb>,
}

/// A display-referred picture: sRGB-encoded RGB in 0…1, as sent to an observer's monitor.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplayImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row-major, `width * height` values.
    pub pixels: Vec<Rgb>,
    /// Distance between neighbouring codes: 1/255 or 1/65535, of which values are multiples. Of a picture
    /// whose colours were converted, the root mean square of the distances.
    pub step: f32,
}

impl DisplayImage {
    /// The same picture in linear light, by [`srgb_decode`]. Values that were clipped at 1 stay at 1.
    /// One step of an 8-bit code is up to 0.9 % of full scale in linear light.
    pub fn to_linear(&self) -> LinearImage {
        let pixels = self.pixels.iter().map(|rgb| rgb.map(srgb_decode)).collect();
        LinearImage { width: self.width, height: self.height, pixels }
    }
}

/// A picture of either kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Picture {
    /// From an EXR or PFM file.
    Linear(LinearImage),
    /// From a PNG file.
    Display(DisplayImage),
}

impl Picture {
    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Picture::Linear(image) => (image.width, image.height),
            Picture::Display(image) => (image.width, image.height),
        }
    }

    /// Variance of the rounding error of each display value: step²/12; 0 for a linear picture.
    pub fn rounding(&self) -> f32 {
        match self {
            Picture::Linear(_) => 0.0,
            Picture::Display(image) => image.step * image.step / 12.0,
        }
    }

    /// The picture in linear light; a display-encoded one by [`DisplayImage::to_linear`].
    pub fn into_linear(self) -> LinearImage {
        match self {
            Picture::Linear(image) => image,
            Picture::Display(image) => image.to_linear(),
        }
    }

    /// The picture, rendered with `spp` samples per pixel, as one side of a comparison.
    pub fn into_still(self, spp: f64) -> Still {
        let (size, rounding) = (self.size(), self.rounding());
        let display_referred = matches!(self, Picture::Display(_));
        let still = Still::new(size, self.into_linear().pixels, spp);
        if display_referred { still.displayed_as_it_is(rounding) } else { still }
    }
}
