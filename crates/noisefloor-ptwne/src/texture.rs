//! Colours that vary over a surface.

use crate::error::SceneError;
use crate::math::Vec3;
use noisefloor::Rgb;

/// Largest number of pixels of an image texture.
pub const MAX_TEXTURE_PIXELS: usize = 1 << 26;

/// A colour as a function of the texture coordinates (u, v). All colours are reflectances: linear Rec.709, each channel in
/// 0…1. Patterns repeat for ever; `scale` counts repeats for each unit of u and v.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// One colour everywhere.
    Colour(Rgb),
    /// A checkerboard.
    Checker {
        /// The two colours.
        colours: [Rgb; 2],
        /// Squares for each unit of u and v.
        scale: [f32; 2],
    },
    /// Running bond: bricks twice as wide as high, each of its own shade, in mortar.
    Brick {
        /// Colour of the bricks, of which each is up to 35 % darker.
        brick: Rgb,
        /// Colour of the mortar.
        mortar: Rgb,
        /// Bricks for each unit of u, courses for each unit of v.
        scale: [f32; 2],
    },
    /// A mix of two colours by fractal value noise of four octaves.
    Noise {
        /// The two colours.
        colours: [Rgb; 2],
        /// Cells of the first octave for each unit of u and v.
        scale: [f32; 2],
    },
    /// An image, bilinearly interpolated, repeated in u and v.
    Image(ImageTexture),
}

/// An image in memory, row-major from the top left; v = 0 is the bottom row.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageTexture {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Linear reflectance, `width`·`height` values, each channel in 0…1.
    pub pixels: Vec<Rgb>,
    /// Repeats for each unit of u and v.
    pub scale: [f32; 2],
}

impl From<Rgb> for Texture {
    fn from(colour: Rgb) -> Self {
        Texture::Colour(colour)
    }
}

/// Checks that a reflectance is in 0…1.
pub(crate) fn check_reflectance(colour: Rgb) -> Result<(), SceneError> {
    for value in colour {
        if !value.is_finite() {
            return Err(SceneError::NotFinite { what: "a reflectance" });
        }
        if !(0.0..=1.0).contains(&value) {
            return Err(SceneError::Range { what: "a reflectance", value, range: "0…1" });
        }
    }
    Ok(())
}

impl Texture {
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let (colours, scale): (&[Rgb], _) = match self {
            Texture::Colour(c) => return check_reflectance(*c),
            Texture::Checker { colours, scale } | Texture::Noise { colours, scale } => (colours, scale),
            Texture::Brick { brick, mortar, scale } => (&[*brick, *mortar], scale),
            Texture::Image(image) => {
                let ImageTexture { width, height, ref pixels, ref scale } = *image;
                let size = width.checked_mul(height).filter(|s| (1..=MAX_TEXTURE_PIXELS).contains(s));
                if size != Some(pixels.len()) {
                    return Err(SceneError::Image { width, height, found: pixels.len() });
                }
                (pixels.as_slice(), scale)
            }
        };
        if !scale.iter().all(|s| s.is_finite()) {
            return Err(SceneError::NotFinite { what: "the scale of a texture" });
        }
        colours.iter().try_for_each(|c| check_reflectance(*c))
    }

    /// The one colour, if there is one.
    pub(crate) fn constant(&self) -> Option<Vec3> {
        match self {
            Texture::Colour(c) => Some(Vec3::from_array(*c)),
            _ => None,
        }
    }

    /// The colour at (u, v).
    pub(crate) fn eval(&self, u: f32, v: f32) -> Vec3 {
        match self {
            Texture::Colour(c) => Vec3::from_array(*c),
            Texture::Checker { colours, scale } => {
                let odd = ((u * scale[0]).floor() + (v * scale[1]).floor()).rem_euclid(2.0) >= 1.0;
                Vec3::from_array(colours[usize::from(odd)])
            }
            Texture::Brick { brick, mortar, scale } => {
                let row = (v * scale[1]).floor();
                let x = u * scale[0] + 0.5 * row.rem_euclid(2.0);
                let (fx, fy) = (x - x.floor(), v * scale[1] - row);
                if fx < 0.04 || fy < 0.08 {
                    return Vec3::from_array(*mortar);
                }
                Vec3::from_array(*brick) * (1.0 - 0.35 * lattice(x.floor(), row))
            }
            Texture::Noise { colours, scale } => {
                let (mut x, mut y) = (u * scale[0], v * scale[1]);
                let (mut sum, mut weight) = (0.0, 0.5);
                for _ in 0..4 {
                    sum += weight * value_noise(x, y);
                    (x, y, weight) = (x * 2.03 + 17.0, y * 2.03 + 31.0, weight * 0.5);
                }
                let t = (sum * (16.0 / 15.0)).clamp(0.0, 1.0);
                Vec3::from_array(colours[0]).lerp(Vec3::from_array(colours[1]), t)
            }
            Texture::Image(image) => image.eval(u, v),
        }
    }
}

impl ImageTexture {
    fn eval(&self, u: f32, v: f32) -> Vec3 {
        let x = (u * self.scale[0]).rem_euclid(1.0) * self.width as f32 - 0.5;
        let y = (1.0 - (v * self.scale[1]).rem_euclid(1.0)) * self.height as f32 - 0.5;
        let (x0, y0) = (x.floor(), y.floor());
        let at = |dx: f32, dy: f32| {
            let column = ((x0 + dx) as isize).rem_euclid(self.width as isize) as usize;
            let row = ((y0 + dy) as isize).rem_euclid(self.height as isize) as usize;
            Vec3::from_array(self.pixels[row * self.width + column])
        };
        let (fx, fy) = (x - x0, y - y0);
        at(0.0, 0.0).lerp(at(1.0, 0.0), fx).lerp(at(0.0, 1.0).lerp(at(1.0, 1.0), fx), fy)
    }
}

/// A fixed pseudo-random number in [0, 1) for each lattice point.
fn lattice(x: f32, y: f32) -> f32 {
    let h = (x as i32 as u32).wrapping_mul(0x9e37_79b1) ^ (y as i32 as u32).wrapping_mul(0x85eb_ca77);
    let h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    let h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    ((h ^ (h >> 15)) >> 8) as f32 / (1 << 24) as f32
}

/// Lattice noise with smooth interpolation, in [0, 1).
fn value_noise(x: f32, y: f32) -> f32 {
    let (x0, y0) = (x.floor(), y.floor());
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (fx, fy) = (smooth(x - x0), smooth(y - y0));
    let row = |y: f32| lattice(x0, y) * (1.0 - fx) + lattice(x0 + 1.0, y) * fx;
    row(y0) * (1.0 - fy) + row(y0 + 1.0) * fy
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_stay_between_their_colours() {
        let (a, b) = ([0.1; 3], [0.9; 3]);
        let image = ImageTexture { width: 2, height: 2, pixels: vec![a, b, b, a], scale: [1.0; 2] };
        for texture in [
            Texture::Checker { colours: [a, b], scale: [4.0; 2] },
            Texture::Noise { colours: [a, b], scale: [4.0; 2] },
            Texture::Brick { brick: b, mortar: a, scale: [4.0; 2] },
            Texture::Image(image),
        ] {
            texture.check().unwrap();
            for i in -500..500 {
                let c = texture.eval(i as f32 * 0.037, i as f32 * -0.11);
                assert!(c.min_element() >= 0.0999 && c.max_element() <= 0.9001, "{texture:?}: {c}");
            }
        }
    }

    #[test]
    fn images_are_checked_and_the_right_way_up() {
        let bad = ImageTexture { width: 2, height: 2, pixels: vec![[0.0; 3]; 3], scale: [1.0; 2] };
        let error = Texture::Image(bad).check().unwrap_err();
        assert_eq!(error, SceneError::Image { width: 2, height: 2, found: 3 });
        let pixels = vec![[1.0; 3], [1.0; 3], [0.0; 3], [0.0; 3]];
        let image = ImageTexture { width: 2, height: 2, pixels, scale: [1.0; 2] };
        assert_eq!(Texture::Image(image.clone()).eval(0.5, 0.75), Vec3::ONE);
        assert_eq!(Texture::Image(image).eval(0.5, 0.25), Vec3::ZERO);
        assert!(Texture::Colour([1.1, 0.0, 0.0]).check().is_err());
        assert!(Texture::Colour([f32::NAN, 0.0, 0.0]).check().is_err());
    }
}
