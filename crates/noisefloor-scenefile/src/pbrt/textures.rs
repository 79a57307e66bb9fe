//! Textures.

use super::params::Params;
use super::reader::Reader;
use super::state::{Definition, Height, plain};
use crate::channels;
use crate::error::{LoadError, Place};
use crate::picture::{self, Samples};
use noisefloor::Rgb;
use noisefloor_ptwne::{ImageTexture, Pixels, Texture, Wrap};
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

pub(super) type Named = HashMap<String, Texture>;

impl Reader<'_> {
    pub(super) fn texture(
        &mut self,
        name: &str,
        values: &str,
        class: &str,
        params: &Params,
    ) -> Result<(), LoadError> {
        let floats = match values {
            "float" => true,
            "spectrum" | "color" => false,
            _ => return Err(params.bad(format!("a texture is of `float` or `spectrum`, not of `{values}`"))),
        };
        let (numbers, colours) = (self.state.float_textures.clone(), self.state.colour_textures.clone());
        let known = if floats { &numbers } else { &colours };
        let mut height = None;
        let texture = match class {
            "imagemap" => {
                let (texture, map) = self.image_map(params, floats)?;
                height = Some(map);
                texture
            }
            "constant" => Texture::Colour(self.factor(params, "value")?.unwrap_or([1.0; 3])),
            // Version 3 multiplies two of a kind, version 4 by a number
            "scale" => {
                let old = params.get("tex1").or_else(|| params.get("tex2")).is_some();
                let ((first, second), by) =
                    if old { (("tex1", "tex2"), known) } else { (("tex", "scale"), &numbers) };
                height = self.scaled_height(params, [first, second])?;
                let first = self.operand(params, first, 1.0, known)?;
                let second = self.operand(params, second, 1.0, by)?;
                self.product(params, first, second)?
            }
            "checkerboard" => self.checkerboard(params, known)?,
            "mix" | "directionmix" => {
                let first = self.operand(params, "tex1", 0.0, known)?;
                let second = self.operand(params, "tex2", 1.0, known)?;
                let amount = if class == "mix" {
                    self.operand(params, "amount", 0.5, &numbers)?
                } else {
                    params.ignore(&["dir"]);
                    self.load.approximated(&params.place, "a mix by direction is half of each");
                    Texture::Colour([0.5; 3])
                };
                self.load.combined(&params.place, [&first, &second, &amount], |[a, b, t]| {
                    std::array::from_fn(|i| (1.0 - t[i]) * a[i] + t[i] * b[i])
                })?
            }
            _ => {
                self.load.approximated(
                    &params.place,
                    format!("the texture `{class}` is replaced by a grey of 0.5"),
                );
                params.ignore(&["octaves", "roughness", "scale", "variation", "inside", "outside"]);
                plain([0.5; 3])
            }
        };
        // Not shared with them any more, so that nothing is copied below
        drop((numbers, colours));
        if floats && self.state.heights.contains_key(name) {
            Rc::make_mut(&mut self.state.heights).remove(name);
        }
        if let Some(height) = height.filter(|_| floats) {
            Rc::make_mut(&mut self.state.heights).insert(name.to_owned(), height);
        }
        let textures = if floats { &mut self.state.float_textures } else { &mut self.state.colour_textures };
        // A copy, if an outer block has them, too
        if Rc::strong_count(textures) > 1 {
            self.load.bounds.spend(100 * textures.len(), &params.place)?;
        }
        Rc::make_mut(textures).insert(name.to_owned(), texture);
        Ok(())
    }

    fn checkerboard(&mut self, params: &Params, known: &Named) -> Result<Texture, LoadError> {
        let [first, second] = [("tex1", 1.0), ("tex2", 0.0)].map(|(name, missing)| {
            let texture = self.operand(params, name, missing, known)?;
            if matches!(texture, Texture::Image(_)) {
                let what =
                    format!("the picture on squares of a checkerboard, `{name}`, is replaced by its mean");
                self.load.approximated(&params.place, what);
            }
            self.inside(&params.place, texture)
        });
        let (a, b) = (self.load.means.of(&first?), self.load.means.of(&second?));
        let image = ImageTexture::new(2, 2, Pixels::Float(Arc::new([b, a, a, b])));
        // pbrt's squares have the size 1, a picture of ours has two
        let to_uv = self.uv_map(params)?.map(|row| row.map(|x| 0.5 * x));
        if params.count("dimension")?.is_some_and(|dimension| dimension != 2) {
            self.load
                .approximated(&params.place, "a checkerboard in space is laid on by texture coordinates");
        }
        Ok(Texture::Image(ImageTexture { to_uv, nearest: true, ..image }))
    }

    /// A colour, a number or a texture of those that are known, and otherwise a grey.
    fn operand(
        &mut self,
        params: &Params,
        name: &str,
        missing: f32,
        known: &Named,
    ) -> Result<Texture, LoadError> {
        if params.get(name).is_some_and(|p| p.kind == "texture") {
            let called = params.text(name)?.unwrap_or_default();
            let found = known.get(called).cloned();
            return found.ok_or_else(|| params.bad(format!("there is no texture `{called}`")));
        }
        Ok(Texture::Colour(self.factor(params, name)?.unwrap_or([missing; 3])))
    }

    /// The heights of a product: those of one texture, times a number.
    fn scaled_height(&self, params: &Params, names: [&str; 2]) -> Result<Option<Height>, LoadError> {
        for (texture, number) in [(names[0], names[1]), (names[1], names[0])] {
            if params.get(texture).is_none_or(|p| p.kind != "texture") {
                continue;
            }
            let known = params.text(texture)?.and_then(|called| self.state.heights.get(called));
            let by = match params.get(number) {
                None => Some(1.0),
                Some(p) if p.kind == "texture" => None,
                // It may be negative, as factors on light may not
                Some(_) => params.numbers(number)?.and_then(|numbers| numbers.first().copied()),
            };
            if let (Some(known), Some(by)) = (known, by) {
                return Ok(Some(Height { scale: known.scale * by as f32, ..known.clone() }));
            }
        }
        Ok(None)
    }

    pub(super) fn product(
        &mut self,
        params: &Params,
        first: Texture,
        second: Texture,
    ) -> Result<Texture, LoadError> {
        let times = |[a, b]: [Rgb; 2]| std::array::from_fn(|i| a[i] * b[i]);
        Ok(match (first, second) {
            (Texture::Image(image), Texture::Colour(colour))
            | (Texture::Colour(colour), Texture::Image(image)) => {
                Texture::Image(ImageTexture { factor: times([image.factor, colour]), ..image })
            }
            (first, second) => self.load.combined(&params.place, [&first, &second], times)?,
        })
    }

    /// A texture as a factor on light: what exceeds 1 is 1.
    pub(super) fn inside(&mut self, place: &Place, texture: Texture) -> Result<Texture, LoadError> {
        Ok(match texture {
            Texture::Colour(colour) => plain(colour),
            Texture::Image(image) if image.factor.iter().any(|c| *c > 1.0) => {
                let key = (channels::address(&image.pixels), image.factor.map(f32::to_bits));
                if !self.bounded.contains_key(&key) {
                    self.load.count_pixels(place, image.width * image.height)?;
                    let bounded = channels::mapped(&image, |p| p).pixels;
                    self.bounded.insert(key, (image.pixels, bounded));
                }
                let (_, pixels) = &self.bounded[&key];
                Texture::Image(ImageTexture { pixels: pixels.clone(), factor: [1.0; 3], ..image })
            }
            other => other,
        })
    }

    /// A picture as a texture, and as heights.
    fn image_map(&mut self, params: &Params, floats: bool) -> Result<(Texture, Height), LoadError> {
        let name = params.text("filename")?.ok_or_else(|| params.bad("an imagemap needs a `filename`"))?;
        params.ignore(&["maxanisotropy", "trilinear"]);
        let path = self.load.folder.find(name, &params.place)?;
        let picture = picture::read(&self.load.folder, &path, &params.place)?;
        let count = picture.width * picture.height;
        self.load.count_pixels(&params.place, count)?;
        let encoding = params.text("encoding")?;
        let raw = match (encoding, params.switch("gamma", true)?) {
            (Some("linear"), _) | (_, false) => true,
            (Some("sRGB") | None, true) => false,
            (Some(other), _) => {
                self.load.approximated(&params.place, format!("the encoding `{other}` is replaced by sRGB"));
                false
            }
        };
        // Shares in the alpha of a picture are its opacity
        let with_alpha =
            floats && matches!(&picture.samples, Samples::Eight(codes) if codes.iter().any(|p| p[3] < 255));
        let pixels = texels(picture.samples, raw, with_alpha);
        let wrap = match params.text("wrap")?.unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "clamp" => Wrap::Clamp,
            other => {
                self.load
                    .approximated(&params.place, format!("the wrap mode `{other}` is replaced by `clamp`"));
                Wrap::Clamp
            }
        };
        let nearest = params.text("filter")? == Some("point");
        let to_uv = self.uv_map(params)?;
        let image = ImageTexture::new(picture.width, picture.height, pixels);
        let image = ImageTexture { to_uv, wrap: [wrap; 2], nearest, ..image };
        let scale = params.float("scale")?.unwrap_or(1.0) as f32;
        if params.switch("invert", false)? {
            self.load.count_pixels(&params.place, count)?;
            let inverse = channels::mapped(&image, |p| p.map(|c| scale * (1.0 - c)));
            return Ok((Texture::Image(inverse), Height { map: image, scale: -scale }));
        }
        let height = Height { map: image.clone(), scale };
        let factor = [scale.max(0.0); 3];
        Ok((Texture::Image(ImageTexture { factor, ..image }), height))
    }
}

impl Reader<'_> {
    /// `uscale`, `vscale`, `udelta` and `vdelta`.
    fn uv_map(&mut self, params: &Params) -> Result<[[f32; 3]; 2], LoadError> {
        if params.text("mapping")?.is_some_and(|mapping| mapping != "uv") {
            self.load.approximated(&params.place, "the texture is laid on by texture coordinates");
            params.ignore(&["v1", "v2"]);
        }
        let number =
            |name: &str, missing: f64| Ok::<_, LoadError>(params.float(name)?.unwrap_or(missing) as f32);
        let (us, vs) = (number("uscale", 1.0)?, number("vscale", 1.0)?);
        let (ud, vd) = (number("udelta", 0.0)?, number("vdelta", 0.0)?);
        Ok([[us, 0.0, ud], [0.0, vs, vd]])
    }

    /// A picture of normals, whose codes are linear.
    pub(super) fn normal_map(&mut self, d: &Definition, name: &str) -> Result<Texture, LoadError> {
        let place = &d.params.place;
        let path = self.load.folder.find(name, place)?;
        let picture = picture::read(&self.load.folder, &path, place)?;
        self.load.count_pixels(place, picture.width * picture.height)?;
        let pixels = texels(picture.samples, true, false);
        Ok(Texture::Image(ImageTexture::new(picture.width, picture.height, pixels)))
    }
}

/// The pixels of a picture: as they are if they are `raw`, decoded from sRGB otherwise, or only its alpha.
fn texels(samples: Samples, raw: bool, alpha_alone: bool) -> Pixels {
    match samples {
        Samples::Eight(codes) if alpha_alone => Pixels::Linear8(codes.iter().map(|p| [p[3]; 3]).collect()),
        Samples::Linear(values) => {
            // Also false for NaN
            let inside = |v: f32| if v > 0.0 { v.min(1.0) } else { 0.0 };
            Pixels::Float(values.iter().map(|p| p.map(inside)).collect())
        }
        samples => samples.pixels(raw),
    }
}
