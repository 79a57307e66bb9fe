//! Textures.

use super::context::Context;
use super::xml::Element;
use crate::channels::{self, linear};
use crate::colour::Quantity;
use crate::error::LoadError;
use crate::picture::{self, Picture};
use noisefloor::Rgb;
use noisefloor_ptwne::{ImageTexture, Pixels, Texture, Wrap};
use std::sync::Arc;

impl<'d> Context<'d> {
    /// The factor called `name`, constant or not, each channel in 0…1, or else `default`.
    pub(super) fn factor(&self, object: &'d Element, name: &str, default: f32) -> Result<Texture, LoadError> {
        match self.texture(object, name)? {
            Some(element) => Ok(self.image(element, Quantity::Factor)?.1),
            None => self.constant_factor(object, name, default).map(Texture::Colour),
        }
    }

    /// As [`Self::factor`], but a texture is replaced by its mean.
    pub(super) fn constant_factor(
        &self,
        object: &'d Element,
        name: &str,
        default: f32,
    ) -> Result<Rgb, LoadError> {
        let colour = self.constant(object, name, default, Quantity::Factor)?;
        if colour.iter().any(|c| *c > 1.0) {
            self.approximated(
                object.get(name).unwrap_or(object),
                format!("`{name}` is {colour:?}; values above 1 become 1"),
            );
        }
        Ok(colour.map(|c| c.min(1.0)))
    }

    /// The colour called `name`, or the mean of a texture, which may be above 1. To Mitsuba, spectra in textures are those
    /// of factors in lights, too.
    fn constant(
        &self,
        object: &'d Element,
        name: &str,
        default: f32,
        quantity: Quantity,
    ) -> Result<Rgb, LoadError> {
        let Some(texture) = self.texture(object, name)? else {
            return Ok(self.colour(object, name, Quantity::Factor)?.unwrap_or([default; 3]));
        };
        self.approximated(texture, format!("the texture of `{name}` is replaced by its mean"));
        let (scale, image) = self.image(texture, quantity)?;
        let image = self.varying(texture, image)?;
        Ok(self.load.means.of(&image).map(|c| c * scale))
    }

    /// The light called `name`, 1 if there is none, and what multiplies it over the surface.
    pub(super) fn light(&self, object: &'d Element, name: &str) -> Result<(Rgb, Option<Texture>), LoadError> {
        if let Some(element) = self.texture(object, name)? {
            let (scale, texture) = self.image(element, Quantity::Light)?;
            let texture = self.varying(element, texture)?;
            return Ok(([scale; 3], Some(texture)));
        }
        Ok((self.colour(object, name, Quantity::Light)?.unwrap_or([1.0; 3]), None))
    }

    /// The texture called `name`, if what is called so is one.
    fn texture(&self, object: &'d Element, name: &str) -> Result<Option<&'d Element>, LoadError> {
        match object.get(name) {
            Some(element) if element.tag == "texture" || element.tag == "ref" => {
                let texture = self.resolve(element)?;
                if texture.tag == "texture" {
                    texture.read();
                    return Ok(Some(texture));
                }
                Err(self.bad(element, format!("`{name}` is {}; expected a texture", texture.label())))
            }
            _ => Ok(None),
        }
    }

    /// A texture, and what it is to be multiplied with: 1, but for lights brighter than 1.
    pub(super) fn image(
        &self,
        element: &'d Element,
        quantity: Quantity,
    ) -> Result<(f32, Texture), LoadError> {
        let key = (element.serial, quantity == Quantity::Light);
        if let Some(known) = self.textures.borrow().get(&key) {
            return Ok(known.clone());
        }
        let made = self.nested_in(element, || self.image_of_kind(element, quantity))?;
        self.textures.borrow_mut().insert(key, made.clone());
        Ok(made)
    }

    fn image_of_kind(&self, element: &'d Element, quantity: Quantity) -> Result<(f32, Texture), LoadError> {
        let (scale, image) = match element.kind() {
            "bitmap" => self.bitmap(element, quantity)?,
            "checkerboard" => self.checkerboard(element, quantity)?,
            "scale" => return self.scale(element, quantity),
            // Read with the mesh
            "mesh_attribute" => {
                element.ignore(&["name", "scale"]);
                return Ok((1.0, Texture::Corners(None)));
            }
            "rawconstant" => {
                // As a colour or as a vector
                let vector = element.get("value").is_some_and(|value| value.tag == "vector");
                let colour = match self.point(element, "value") {
                    Ok(Some(value)) if vector => value.as_vec3().to_array(),
                    Err(error) if vector => return Err(error),
                    _ => self.colour(element, "value", quantity)?.unwrap_or([1.0; 3]),
                };
                let scale = colour.into_iter().fold(1.0, f32::max);
                return Ok((scale, Texture::Colour(colour.map(|c| c.max(0.0) / scale))));
            }
            _ => return Err(self.unsupported_kind(element)),
        };
        Ok((scale, Texture::Image(image)))
    }

    /// The colours of corners times a factor of at most 1.
    fn tinted_corners(&self, element: &Element, texture: Texture, factor: Rgb) -> Result<Texture, LoadError> {
        match texture {
            Texture::Corners(None) if factor.iter().all(|f| *f <= 1.0) => {
                Ok(Texture::Corners(Some(Box::new(Texture::Colour(factor)))))
            }
            _ => Err(self.unsupported(element, "a factor on an attribute of a mesh")),
        }
    }

    /// A texture where colours of corners do not count, which is an error of those.
    pub(super) fn varying(&self, element: &Element, texture: Texture) -> Result<Texture, LoadError> {
        match texture {
            Texture::Corners(_) => Err(self.unsupported(element, "an attribute of a mesh as this parameter")),
            other => Ok(other),
        }
    }

    /// A texture times a number, of Mitsuba 0.6.
    fn scale(&self, element: &'d Element, quantity: Quantity) -> Result<(f32, Texture), LoadError> {
        let factor = match self.float(element, "scale")? {
            Some(factor) => [factor as f32; 3],
            None => self.colour(element, "scale", Quantity::Factor)?.unwrap_or([1.0; 3]),
        };
        let parts = self.parts(element, "texture")?;
        let [inside] = parts.as_slice() else {
            return Err(self.bad(element, "<texture type=\"scale\"> needs one <texture> in it"));
        };
        let (scale, texture) = self.image(inside, quantity)?;
        let peak = factor.into_iter().fold(0.0, f32::max).max(f32::MIN_POSITIVE);
        if quantity == Quantity::Factor && peak > 1.0 {
            return Ok((scale, self.scaled(element, texture, peak)?));
        }
        let over = if quantity == Quantity::Light { peak.max(1.0) } else { 1.0 };
        let tint = |colour: Rgb| std::array::from_fn(|i| colour[i] * (factor[i] / over).max(0.0));
        let texture = match texture {
            Texture::Colour(colour) => Texture::Colour(tint(colour)),
            Texture::Image(image) => Texture::Image(ImageTexture { factor: tint(image.factor), ..image }),
            other => self.tinted_corners(element, other, tint([1.0; 3]))?,
        };
        Ok((scale * over, texture))
    }

    /// A factor that is `scale` times as large; what would exceed 1 is 1.
    pub(super) fn scaled(
        &self,
        element: &Element,
        texture: Texture,
        scale: f32,
    ) -> Result<Texture, LoadError> {
        Ok(match texture {
            Texture::Colour(colour) => Texture::Colour(colour.map(|c| (c * scale).min(1.0))),
            Texture::Image(image) if scale <= 1.0 => {
                Texture::Image(ImageTexture { factor: image.factor.map(|c| c * scale), ..image })
            }
            Texture::Image(image) => {
                self.count_pixels(element, image.width * image.height)?;
                Texture::Image(channels::mapped(&image, |p| p.map(|c| (c * scale).min(1.0))))
            }
            other => self.tinted_corners(element, other, [scale; 3])?,
        })
    }

    fn bitmap(&self, element: &'d Element, quantity: Quantity) -> Result<(f32, ImageTexture), LoadError> {
        let name = self.string(element, "filename")?;
        let name = name.ok_or_else(|| self.bad(element, "a bitmap needs a `filename`"))?;
        // A gamma of 1 is how older versions say it
        let raw = match self.float(element, "gamma")? {
            Some(gamma) => gamma == 1.0,
            None => self.boolean(element, "raw", false)?,
        };
        element.ignore(&["max_anisotropy", "cache", "mipmap", "format"]);
        let image = self.raster(element, name, raw)?;
        let (scale, pixels) = self.fit(element, image.pixels, quantity)?;

        let nearest = match self.string(element, "filter_type")?.unwrap_or("bilinear") {
            "nearest" => true,
            // What older versions filter over footprints is interpolated
            "bilinear" | "trilinear" | "ewa" => false,
            other => return Err(self.unsupported(element, format!("the filter `{other}`"))),
        };
        let wrap = match self.string(element, "wrap_mode")?.unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "mirror" => Wrap::Mirror,
            "clamp" => Wrap::Clamp,
            other => {
                self.approximated(element, format!("the wrap mode `{other}` is replaced by `clamp`"));
                Wrap::Clamp
            }
        };
        let to_uv = self.to_uv(element)?;
        Ok((scale, ImageTexture { pixels, to_uv, wrap: [wrap; 2], nearest, ..image }))
    }

    /// Brings the pixels of a picture into 0…1: those of factors are clamped, lights are scaled.
    fn fit(&self, element: &Element, pixels: Pixels, quantity: Quantity) -> Result<(f32, Pixels), LoadError> {
        let Pixels::Float(values) = &pixels else { return Ok((1.0, pixels)) };
        let flat = || values.iter().flatten();
        if !flat().all(|v| v.is_finite()) {
            return Err(self.bad(element, "the picture has values that are not finite"));
        }
        let peak = flat().fold(0.0, |peak: f32, v| peak.max(*v));
        let scale = if quantity == Quantity::Light { peak.max(1.0) } else { 1.0 };
        let outside = flat().filter(|v| !(0.0..=scale).contains(*v)).count();
        if outside > 0 {
            self.approximated(
                element,
                format!("{outside} values of the picture are outside 0…1 and are clamped"),
            );
        }
        if outside == 0 && scale == 1.0 {
            return Ok((scale, pixels));
        }
        self.count_pixels(element, values.len())?;
        Ok((scale, Pixels::Float(values.iter().map(|p| p.map(|v| v.clamp(0.0, scale) / scale)).collect())))
    }

    /// Two by two squares in the unit square.
    fn checkerboard(
        &self,
        element: &'d Element,
        quantity: Quantity,
    ) -> Result<(f32, ImageTexture), LoadError> {
        let square = |name, default| match quantity {
            Quantity::Factor => self.constant_factor(element, name, default),
            Quantity::Light => self.constant(element, name, default, quantity),
        };
        let (a, b) = (square("color0", 0.4)?, square("color1", 0.2)?);
        let scale = a.into_iter().chain(b).fold(1.0, f32::max);
        let [a, b] = [a, b].map(|colour| colour.map(|c| c / scale));
        let image = ImageTexture::new(2, 2, Pixels::Float(Arc::new([a, b, b, a])));
        Ok((scale, ImageTexture { to_uv: self.to_uv(element)?, nearest: true, ..image }))
    }

    /// `to_uv`, for v that counts from below: Mitsuba's counts from the top of the picture.
    fn to_uv(&self, element: &'d Element) -> Result<[[f32; 3]; 2], LoadError> {
        let matrix = self.transform(element, "to_uv")?;
        let [[a, b, c], [d, e, f]] = [matrix.row(0), matrix.row(1)].map(|row| [row.x, row.y, row.w]);
        let number = |name: &str, missing| Ok::<_, LoadError>(self.float(element, name)?.unwrap_or(missing));
        // Older versions
        let (us, vs) = (number("uscale", 1.0)?, number("vscale", 1.0)?);
        let (uo, vo) = (number("uoffset", 0.0)?, number("voffset", 0.0)?);
        let ([a, b, c], [d, e, f]) = ([a * us, b * us, c * us + uo], [d * vs, e * vs, f * vs + vo]);
        Ok([[a, -b, b + c], [-d, e, 1.0 - e - f]].map(|row| row.map(|x| x as f32)))
    }

    /// What Mitsuba takes for a number where something else is given: the mean of a colour's channels, and
    /// the luminance of a picture. Its alpha has no part in it.
    pub(super) fn one_channel(&self, element: &Element, texture: Texture) -> Result<Texture, LoadError> {
        let grey = |colour: Rgb| [noisefloor::display::luminance(colour).clamp(0.0, 1.0); 3];
        Ok(match texture {
            Texture::Colour(colour) => {
                Texture::Colour([(colour.iter().sum::<f32>() / 3.0).clamp(0.0, 1.0); 3])
            }
            Texture::Image(image) => {
                self.count_pixels(element, image.width * image.height)?;
                let pixels = Pixels::Float(linear(&image.pixels).into_iter().map(grey).collect());
                Texture::Image(ImageTexture { pixels, ..image })
            }
            // This reader makes no others
            other => other,
        })
    }

    /// The picture called `name`. Codes of 8 and 16 bits are sRGB-encoded unless `raw`.
    pub(super) fn raster(&self, element: &Element, name: &str, raw: bool) -> Result<ImageTexture, LoadError> {
        let place = &self.place(element);
        let path = self.load.folder.find(name, place)?;
        let key = (path, raw);
        if let Some(found) = self.rasters.borrow().get(&key) {
            return Ok(found.clone());
        }
        let Picture { width, height, samples } = picture::read(&self.load.folder, &key.0, place)?;
        self.count_pixels(element, width * height)?;
        let image = ImageTexture::new(width, height, samples.pixels(raw));
        self.rasters.borrow_mut().insert(key, image.clone());
        Ok(image)
    }
}

/// The largest value of a texture.
pub(super) fn peak(texture: &Texture) -> f32 {
    let largest = |colour: Rgb| colour.into_iter().fold(0.0, f32::max);
    match texture {
        Texture::Colour(colour) => largest(*colour),
        Texture::Image(image) => {
            let pixels = linear(&image.pixels).into_iter().map(largest).fold(0.0, f32::max);
            pixels * largest(image.factor)
        }
        // This reader makes no others
        _ => 1.0,
    }
}
