//! Textures of several numbers, one a channel.

use noisefloor::{Rgb, display::srgb_decode};
use noisefloor_ptwne::{ImageTexture, Pixels, Texture};
use std::cell::RefCell;
use std::collections::HashMap;

/// The mean colours of pictures, each found once: any number of surfaces can ask for one.
#[derive(Debug, Default)]
pub(crate) struct Means {
    /// By the address of the pixels, which stay here so that no other ones get it.
    known: RefCell<HashMap<usize, (Pixels, Rgb)>>,
}

impl Means {
    /// The mean colour of a texture.
    pub(crate) fn of(&self, texture: &Texture) -> Rgb {
        let image = match texture {
            Texture::Colour(colour) => return *colour,
            Texture::Image(image) => image,
            // The readers make no others
            _ => return [0.5; 3],
        };
        let key = address(&image.pixels);
        let mut known = self.known.borrow_mut();
        let plain = || ImageTexture { factor: [1.0; 3], ..image.clone() }.mean();
        let (_, mean) = known.entry(key).or_insert_with(|| (image.pixels.clone(), plain()));
        std::array::from_fn(|i| mean[i] * image.factor[i])
    }
}

/// Where pixels lie: the same for all textures that share them.
pub(crate) fn address(pixels: &Pixels) -> usize {
    match pixels {
        Pixels::Srgb8(codes) | Pixels::Linear8(codes) => codes.as_ptr().addr(),
        Pixels::Float(values) => values.as_ptr().addr(),
    }
}

/// Linear values of pixels.
pub(crate) fn linear(pixels: &Pixels) -> Vec<Rgb> {
    let linear = |code: u8| f32::from(code) / 255.0;
    match pixels {
        Pixels::Srgb8(codes) => codes.iter().map(|p| p.map(|code| srgb_decode(linear(code)))).collect(),
        Pixels::Linear8(codes) => codes.iter().map(|p| p.map(linear)).collect(),
        Pixels::Float(values) => values.to_vec(),
    }
}

/// A picture with each pixel changed; what is outside 0…1 is brought there.
pub(crate) fn mapped(image: &ImageTexture, change: impl Fn(Rgb) -> Rgb) -> ImageTexture {
    let pixel = |p: Rgb| {
        let changed = change(std::array::from_fn(|i| p[i] * image.factor[i]));
        changed.map(|c| c.clamp(0.0, 1.0))
    };
    let pixels = Pixels::Float(linear(&image.pixels).into_iter().map(pixel).collect());
    ImageTexture { pixels, factor: [1.0; 3], ..image.clone() }
}

/// Textures as one, whose pixels `put` makes of their colours. A picture that does not lie as the first does is
/// replaced by its mean; the second result is whether there was one.
pub(crate) fn combined<const N: usize>(
    parts: [&Texture; N],
    mean: impl Fn(&Texture) -> Rgb,
    put: impl Fn([Rgb; N]) -> Rgb,
) -> (Texture, bool) {
    let means = parts.map(mean);
    let first =
        parts.iter().find_map(|part| if let Texture::Image(image) = part { Some(image) } else { None });
    let Some(first) = first else { return (Texture::Colour(put(means)), false) };
    let lies = |image: &ImageTexture| (image.width, image.height, image.to_uv, image.wrap, image.nearest);
    let values = parts.map(|part| match part {
        Texture::Image(image) if lies(image) == lies(first) => {
            let value = |p: Rgb| std::array::from_fn(|i| p[i] * image.factor[i]);
            Some(linear(&image.pixels).into_iter().map(value).collect::<Vec<Rgb>>())
        }
        _ => None,
    });
    let replaced = (0..N).any(|i| values[i].is_none() && !matches!(parts[i], Texture::Colour(_)));
    let pixel = |at: usize| {
        let colours = std::array::from_fn(|i| values[i].as_ref().map_or(means[i], |values| values[at]));
        put(colours).map(|c| c.clamp(0.0, 1.0))
    };
    let pixels = Pixels::Float((0..first.width * first.height).map(pixel).collect());
    (Texture::Image(ImageTexture { pixels, factor: [1.0; 3], ..first.clone() }), replaced)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(texture: &Texture) -> Rgb {
        match texture {
            Texture::Colour(colour) => *colour,
            Texture::Image(image) => image.mean(),
            _ => [0.5; 3],
        }
    }

    #[test]
    fn pictures_are_joined_pixel_by_pixel() {
        let image = |codes: &[u8]| {
            let pixels = Pixels::Linear8(codes.iter().map(|c| [*c; 3]).collect());
            Texture::Image(ImageTexture::new(codes.len(), 1, pixels))
        };
        let put = |[a, b]: [Rgb; 2]| [a[0] * a[0], b[0], 2.0];
        let (two, other) = (image(&[0, 255]), image(&[0, 0, 255]));
        let (Texture::Image(found), false) = combined([&two, &image(&[51, 102])], mean, put) else {
            panic!()
        };
        assert_eq!(found.pixels, Pixels::Float([[0.0, 0.2, 1.0], [1.0, 0.4, 1.0]].into()));
        let (Texture::Image(found), true) = combined([&two, &other], mean, put) else { panic!() };
        assert_eq!(linear(&found.pixels)[1], [1.0, 1.0 / 3.0, 1.0]);
        let plain = combined([&Texture::Colour([0.5; 3]), &Texture::Colour([0.25; 3])], mean, put);
        assert_eq!(plain, (Texture::Colour([0.25, 0.25, 2.0]), false));
    }
}
