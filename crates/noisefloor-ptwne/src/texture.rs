//! Colours that vary over a surface.

use crate::checks::check_reflectance;
use crate::error::SceneError;
use crate::math::{self, Vec3};
use noisefloor::Rgb;
use std::sync::{Arc, LazyLock};

/// Largest number of pixels of an image texture.
pub const MAX_TEXTURE_PIXELS: usize = 1 << 26;

/// A colour as a function of the texture coordinates (u, v). All colours are reflectances: linear Rec.709,
/// each channel in 0…1. Patterns repeat without end; `scale` is the number of repeats per unit of u and v.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Texture {
    Colour(Rgb),
    Checker {
        colours: [Rgb; 2],
        /// Squares per unit of u and v.
        scale: [f32; 2],
    },
    /// Bricks in running bond, each with its own shade, in mortar.
    Brick {
        /// Colour of the brightest bricks; others are up to 35 % darker.
        brick: Rgb,
        mortar: Rgb,
        /// Bricks per unit of u, and courses per unit of v.
        scale: [f32; 2],
    },
    /// A mix of two colours by fractal value noise with four octaves.
    Noise {
        colours: [Rgb; 2],
        /// Cells of the first octave per unit of u and v.
        scale: [f32; 2],
    },
    Image(ImageTexture),
    /// The colours of the mesh's corners ([`Mesh::colours`](crate::Mesh::colours)), interpolated, times a
    /// texture if there is one. Of an opacity, their [alphas](crate::Mesh::alphas). Only for the colour and
    /// the opacity of a material, the share of a mix, and what a surface emits: anywhere else, and on
    /// surfaces without such colours, corners are white.
    Corners(Option<Box<Texture>>),
}

/// An image in memory. It covers the unit square of u and v; v = 0 is the bottom row.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageTexture {
    pub width: usize,
    pub height: usize,
    /// `width`·`height` pixels, row-major from the top left.
    pub pixels: Pixels,
    /// Two rows of the affine map from (u, v, 1) to image coordinates; usually [`ImageTexture::IDENTITY`].
    pub to_uv: [[f32; 3]; 2],
    /// Factor on the image, each channel in 0…1.
    pub factor: Rgb,
    /// How the image continues outside the unit square, in u and in v.
    pub wrap: [Wrap; 2],
    /// Whether each pixel has one colour, instead of interpolating between pixels.
    pub nearest: bool,
    /// Whether (u, v) are the second texture coordinates of the mesh,
    /// [`Mesh::second_uvs`](crate::Mesh::second_uvs).
    pub second: bool,
}

/// The first and the second texture coordinates of a point, which are equal if there is one pair.
pub(crate) type Coordinates = [f32; 4];

/// Pixels of an image, shared by all textures that use it.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// Eight bits per channel, sRGB encoded (IEC 61966-2-1).
    Srgb8(Arc<[[u8; 3]]>),
    /// Eight bits per channel, linear: 255 is 1.
    Linear8(Arc<[[u8; 3]]>),
    /// Linear.
    Float(Arc<[Rgb]>),
}

/// How an image continues outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Wrap {
    #[default]
    Repeat,
    /// It repeats, mirrored every other time.
    Mirror,
    /// Its border pixels continue.
    Clamp,
}

impl Pixels {
    fn len(&self) -> usize {
        match self {
            Pixels::Srgb8(p) | Pixels::Linear8(p) => p.len(),
            Pixels::Float(p) => p.len(),
        }
    }

    fn at(&self, index: usize) -> Vec3 {
        match self {
            Pixels::Srgb8(p) => eight(p[index], &TABLES.0),
            Pixels::Linear8(p) => eight(p[index], &TABLES.1),
            Pixels::Float(p) => Vec3::from_array(p[index]),
        }
    }
}

/// Decodes a pixel with eight bits per channel.
#[inline]
fn eight([r, g, b]: [u8; 3], table: &[f32; 256]) -> Vec3 {
    Vec3::new(table[usize::from(r)], table[usize::from(g)], table[usize::from(b)])
}

/// The 256 values of an sRGB encoded channel, and of a linear one.
static TABLES: LazyLock<([f32; 256], [f32; 256])> = LazyLock::new(|| {
    let linear = |i: usize| i as f64 / 255.0;
    let decode = |x: f64| if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
    (std::array::from_fn(|i| decode(linear(i)) as f32), std::array::from_fn(|i| linear(i) as f32))
});

impl Wrap {
    /// The two pixels of `0..size` around `x`, measured from the centre of the first pixel, and the position
    /// of `x` between them.
    #[inline]
    fn around(self, x: f32, size: usize) -> (usize, usize, f32) {
        // Reduce to one or two periods; where f32 no longer resolves pixels, any will do
        let n = size as f32;
        let period = if self == Wrap::Mirror { 2.0 * n } else { n };
        let x = match self {
            Wrap::Clamp => x.clamp(-1.0, n),
            Wrap::Repeat | Wrap::Mirror => x - math::floor(x / period) * period,
        };
        let x0 = math::floor(x);
        let first = x0 as i32;
        let pixel = |i: i32| {
            let n = size as i32;
            // Less than two periods: no division needed
            let inside = |period: i32| if i < period { i } else { i - period };
            match self {
                Wrap::Repeat => inside(n),
                Wrap::Mirror => {
                    let i = inside(2 * n);
                    if i < n { i } else { 2 * n - 1 - i }
                }
                Wrap::Clamp => i,
            }
            .clamp(0, n - 1) as usize
        };
        (pixel(first), pixel(first.saturating_add(1)), x - x0)
    }
}

impl From<Rgb> for Texture {
    fn from(colour: Rgb) -> Self {
        Texture::Colour(colour)
    }
}

impl Texture {
    /// Checks that it is a reflectance everywhere.
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        let (colours, scale): (&[Rgb], _) = match self {
            Texture::Colour(c) => return check_reflectance(*c),
            Texture::Checker { colours, scale } | Texture::Noise { colours, scale } => (colours, scale),
            Texture::Brick { brick, mortar, scale } => (&[*brick, *mortar], scale),
            Texture::Image(image) => return image.check(),
            Texture::Corners(None) => return Ok(()),
            Texture::Corners(Some(texture)) => return texture.check(),
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

    /// The mean colour of an image's pixels, or of a pattern over the unit square.
    pub(crate) fn mean(&self) -> Vec3 {
        if let Texture::Image(image) = self {
            return image.mean().into();
        }
        const SIDE: u32 = 64;
        let centre = |i: u32| (i as f32 + 0.5) / SIDE as f32;
        let point = |i: u32| [centre(i % SIDE), centre(i / SIDE)];
        let points = (0..SIDE * SIDE).map(|i| self.eval(twice(point(i))));
        points.sum::<Vec3>() / (SIDE * SIDE) as f32
    }

    /// Whether it takes the second texture coordinates.
    pub(crate) fn is_second(&self) -> bool {
        matches!(self, Texture::Image(image) if image.second)
    }

    /// The colour at texture coordinates.
    pub(crate) fn eval(&self, at: Coordinates) -> Vec3 {
        let [u, v, ..] = at;
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
            Texture::Image(image) => image.eval(at),
            Texture::Corners(None) => Vec3::ONE,
            Texture::Corners(Some(texture)) => texture.eval(at),
        }
    }
}

impl ImageTexture {
    /// The identity map of (u, v).
    pub const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    /// An image that covers the unit square and repeats outside of it.
    pub fn new(width: usize, height: usize, pixels: Pixels) -> Self {
        let (factor, wrap) = ([1.0; 3], [Wrap::Repeat; 2]);
        Self { width, height, pixels, to_uv: Self::IDENTITY, factor, wrap, nearest: false, second: false }
    }

    /// The mean colour of its pixels, times the factor.
    pub fn mean(&self) -> Rgb {
        let sum: glam::DVec3 = (0..self.pixels.len()).map(|i| self.pixels.at(i).as_dvec3()).sum();
        let mean = (sum / self.pixels.len() as f64).as_vec3a() * Vec3::from_array(self.factor);
        mean.to_array()
    }

    fn check(&self) -> Result<(), SceneError> {
        let (width, height) = (self.width, self.height);
        let size = width.checked_mul(height).filter(|s| (1..=MAX_TEXTURE_PIXELS).contains(s));
        if size != Some(self.pixels.len()) {
            return Err(SceneError::Image { width, height, found: self.pixels.len() });
        }
        if !self.to_uv.iter().flatten().all(|x| x.is_finite()) {
            return Err(SceneError::NotFinite { what: "the scale of a texture" });
        }
        check_reflectance(self.factor)?;
        match &self.pixels {
            Pixels::Float(pixels) => pixels.iter().try_for_each(|p| check_reflectance(*p)),
            Pixels::Srgb8(_) | Pixels::Linear8(_) => Ok(()),
        }
    }

    /// The pair of texture coordinates that it takes.
    #[inline]
    pub(crate) fn own(&self, [u, v, second_u, second_v]: Coordinates) -> [f32; 2] {
        if self.second { [second_u, second_v] } else { [u, v] }
    }

    fn eval(&self, at: Coordinates) -> Vec3 {
        let [u, v] = self.own(at);
        let place = |row: [f32; 3]| row[0] * u + row[1] * v + row[2];
        self.at(place(self.to_uv[0]), place(self.to_uv[1]))
    }

    /// The colour at image coordinates.
    #[inline]
    pub(crate) fn at(&self, u: f32, v: f32) -> Vec3 {
        let (x0, x1, fx) = self.wrap[0].around(u * self.width as f32 - 0.5, self.width);
        let (y0, y1, fy) = self.wrap[1].around((1.0 - v) * self.height as f32 - 0.5, self.height);
        let factor = Vec3::from_array(self.factor);
        let (above, below) = (y0 * self.width, y1 * self.width);
        if self.nearest {
            let (x, row) = (if fx < 0.5 { x0 } else { x1 }, if fy < 0.5 { above } else { below });
            return self.pixels.at(row + x) * factor;
        }
        let four = [above + x0, above + x1, below + x0, below + x1];
        // Match on the kind of pixels once for all four
        let [a, b, c, d] = match &self.pixels {
            Pixels::Srgb8(p) => {
                let table = &TABLES.0;
                four.map(|i| eight(p[i], table))
            }
            Pixels::Linear8(p) => {
                let table = &TABLES.1;
                four.map(|i| eight(p[i], table))
            }
            Pixels::Float(p) => four.map(|i| Vec3::from_array(p[i])),
        };
        a.lerp(b, fx).lerp(c.lerp(d, fx), fy) * factor
    }
}

/// Texture coordinates of which there is one pair.
#[inline]
pub(crate) fn twice([u, v]: [f32; 2]) -> Coordinates {
    [u, v, u, v]
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
        let image = ImageTexture::new(2, 2, Pixels::Float([a, b, b, a].into()));
        for texture in [
            Texture::Checker { colours: [a, b], scale: [4.0; 2] },
            Texture::Noise { colours: [a, b], scale: [4.0; 2] },
            Texture::Brick { brick: b, mortar: a, scale: [4.0; 2] },
            Texture::Image(image),
        ] {
            texture.check().unwrap();
            for i in -500..500 {
                let c = texture.eval(twice([i as f32 * 0.037, i as f32 * -0.11]));
                assert!(c.min_element() >= 0.0999 && c.max_element() <= 0.9001, "{texture:?}: {c}");
            }
        }
    }

    #[test]
    fn images_are_checked_and_the_right_way_up() {
        let bad = ImageTexture::new(2, 2, Pixels::Linear8([[0; 3]; 3].into()));
        let error = Texture::Image(bad).check().unwrap_err();
        assert_eq!(error, SceneError::Image { width: 2, height: 2, found: 3 });
        let top_white = Pixels::Srgb8([[255; 3], [255; 3], [0; 3], [0; 3]].into());
        let mut image = ImageTexture::new(2, 2, top_white);
        let at = |image: &ImageTexture, v: f32| Texture::Image(image.clone()).eval(twice([0.5, v])).x;
        assert_eq!((at(&image, 0.75), at(&image, 0.25)), (1.0, 0.0));
        assert_eq!(at(&image, 0.5), 0.5);
        image.nearest = true;
        assert_eq!((at(&image, 0.51), at(&image, 0.49)), (1.0, 0.0));
        // One unit up: the same again, mirrored, and the border
        let all = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp].map(|wrap| {
            image.wrap[1] = wrap;
            (at(&image, 1.25), at(&image, 1.75))
        });
        assert_eq!(all, [(0.0, 1.0), (1.0, 0.0), (1.0, 1.0)]);
        image.to_uv = [[0.0, 1.0, 0.0], [0.0, 0.5, 0.25]];
        image.wrap[1] = Wrap::Repeat;
        assert_eq!((at(&image, 0.0), at(&image, 1.0)), (0.0, 1.0));
        assert!(at(&image, f32::MAX).is_finite());
        assert!(Texture::Colour([1.1, 0.0, 0.0]).check().is_err());
        assert!(Texture::Colour([f32::NAN, 0.0, 0.0]).check().is_err());
    }
}
