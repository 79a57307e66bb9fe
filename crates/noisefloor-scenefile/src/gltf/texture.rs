//! Textures: images, their samplers (glTF 2.0, §3.8), and `KHR_texture_transform`.

use super::asset::Asset;
use super::gloss::Gloss;
use super::parts::{WEBP, name};
use crate::channels;
use crate::picture::{self, Samples};
use crate::{LoadError, LoadFault, Place};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::{Info, MagFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Image, Index, Value, deserialize};
use noisefloor::{
    Rgb,
    display::{srgb_decode, srgb_encode},
};
use noisefloor_ptwne::{ImageTexture, MAX_TEXTURE_PIXELS, Pixels, Texture, Wrap};
use std::collections::HashMap;
use std::sync::Arc;

/// Most pixels of all images together: a small file can make a large image, and a file can name many.
const MAX_PIXELS: u64 = 4 * MAX_TEXTURE_PIXELS as u64;

/// The index that the types of the JSON give a texture without a source.
const NO_IMAGE: usize = u32::MAX as usize;

/// What the numbers of an image mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Colours, encoded as sRGB.
    Srgb,
    Linear,
}

/// Three channels of an image, shared by all that show them.
type Codes = Arc<[[u8; 3]]>;

/// A decoded image, shared by all textures that show it.
#[derive(Clone, Debug)]
struct Decoded {
    width: usize,
    height: usize,
    colour: Codes,
    /// None if it is opaque.
    alpha: Option<Arc<[u8]>>,
}

/// Images, decoded when first asked for.
#[derive(Debug)]
pub(super) struct Textures<'a> {
    asset: &'a Asset<'a>,
    images: HashMap<usize, Decoded>,
    opacities: HashMap<usize, Codes>,
    /// The set of texture coordinates that comes first in the material that is read.
    pub(super) first_set: u32,
    pixels: u64,
}

impl<'a> Textures<'a> {
    pub(super) fn new(asset: &'a Asset<'a>) -> Self {
        Self { asset, images: HashMap::new(), opacities: HashMap::new(), first_set: 0, pixels: 0 }
    }

    /// The colours of a texture, that the element at `place` uses.
    pub(super) fn colour(
        &mut self,
        info: &Info,
        encoding: Encoding,
        place: &Place,
    ) -> Result<ImageTexture, LoadError> {
        let (_, mut texture) = self.texture(info, place)?;
        if let (Encoding::Linear, Pixels::Srgb8(pixels)) = (encoding, &texture.pixels) {
            texture.pixels = Pixels::Linear8(pixels.clone());
        }
        Ok(texture)
    }

    /// Alpha of a texture, if it is not opaque all over.
    pub(super) fn opacity(&mut self, info: &Info, place: &Place) -> Result<Option<ImageTexture>, LoadError> {
        let (image, mut texture) = self.texture(info, place)?;
        let Some(alpha) = self.images.get(&image).and_then(|decoded| decoded.alpha.clone()) else {
            return Ok(None);
        };
        let opacity = match self.opacities.get(&image) {
            Some(opacity) => opacity.clone(),
            None => {
                self.count(alpha.len(), place)?;
                let opacity: Codes = alpha.iter().map(|a| [*a; 3]).collect();
                self.opacities.insert(image, opacity.clone());
                opacity
            }
        };
        texture.pixels = Pixels::Linear8(opacity);
        Ok(Some(texture))
    }

    /// The red channel of a texture, as shares.
    pub(super) fn red(&mut self, info: &Info, place: &Place) -> Result<ImageTexture, LoadError> {
        let (image, texture) = self.texture(info, place)?;
        let codes = self.images.get(&image).map(|decoded| decoded.colour.clone()).unwrap_or_default();
        self.count(codes.len(), place)?;
        Ok(ImageTexture { pixels: Pixels::Linear8(codes.iter().map(|[r, ..]| [*r; 3]).collect()), ..texture })
    }

    /// The square of a texture's green channel times a factor, which is α of its microfacets in all
    /// directions.
    pub(super) fn alphas(&mut self, info: &Info, factor: f32, place: &Place) -> Result<Texture, LoadError> {
        let image = self.colour(info, Encoding::Linear, place)?;
        self.count(image.width * image.height, place)?;
        Ok(Texture::Image(channels::mapped(&image, |[_, green, _]| [(green * factor).powi(2); 3])))
    }

    /// Base colour, and roughness and metal, of diffuse and of specular colours with glossiness: factors times
    /// textures. Pixels lie as in the first texture that there is.
    pub(super) fn gloss(
        &mut self,
        factor: Gloss,
        [diffuse, specular]: [Option<&Info>; 2],
        place: &Place,
    ) -> Result<(Texture, Texture), LoadError> {
        let mut read = |info: Option<&Info>| match info {
            Some(info) => self.texture(info, place).map(Some),
            None => Ok(None),
        };
        let (diffuse, specular) = (read(diffuse)?, read(specular)?);
        let Some((_, frame)) = diffuse.as_ref().or(specular.as_ref()) else {
            let (base, [roughness, metal]) = factor.metal();
            return Ok((Texture::Colour(base), Texture::Colour([1.0, roughness, metal])));
        };
        let (width, height, frame) = (frame.width, frame.height, frame.clone());
        self.count(2 * width * height, place)?;
        let decoded = |found: &Option<(usize, ImageTexture)>| {
            found.as_ref().and_then(|f| self.images.get(&f.0).cloned())
        };
        let (diffuse, specular) = (decoded(&diffuse), decoded(&specular));
        let at = |image: &Option<Decoded>, x: usize, y: usize| match image {
            None => ([1.0; 3], 1.0),
            Some(image) => {
                let i = y * image.height / height * image.width + x * image.width / width;
                let alpha = image.alpha.as_ref().map_or(255, |alpha| alpha[i]);
                (image.colour[i].map(|c| srgb_decode(f32::from(c) / 255.0)), f32::from(alpha) / 255.0)
            }
        };
        let code = |x: f32| (x * 255.0 + 0.5) as u8;
        let (mut bases, mut shares) =
            (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let ((d, _), (s, glossiness)) = (at(&diffuse, x, y), at(&specular, x, y));
            let times = |a: Rgb, b: Rgb| std::array::from_fn(|i| a[i] * b[i]);
            let (base, [roughness, metal]) = Gloss {
                diffuse: times(factor.diffuse, d),
                specular: times(factor.specular, s),
                glossiness: factor.glossiness * glossiness,
            }
            .metal();
            bases.push(base.map(|c| code(srgb_encode(c))));
            shares.push([255, code(roughness), code(metal)]);
        }
        let image = |pixels| Texture::Image(ImageTexture { pixels, ..frame.clone() });
        Ok((image(Pixels::Srgb8(bases.into())), image(Pixels::Linear8(shares.into()))))
    }

    /// The texture with its colours taken for sRGB, and the index of its image.
    fn texture(&mut self, info: &Info, place: &Place) -> Result<(usize, ImageTexture), LoadError> {
        let asset = self.asset;
        let texture = asset.get(info.index, "texture", place)?;
        let here = Place::part(asset.path, name("texture", info.index.value(), texture.name.as_deref()));
        let others = texture.extensions.iter().flat_map(|e| &e.others);
        self.asset.leave_out(&here, others.map(|(name, _)| name).filter(|name| *name != WEBP));
        self.asset.leave_out(place, info.extensions.iter().flat_map(|e| e.others.keys()));
        let (source, Decoded { width, height, colour, .. }) = self.image_of(texture, &here)?;
        let default = Sampler::default();
        let sampler = match texture.sampler {
            Some(sampler) => asset.get(sampler, "sampler", &here)?,
            None => &default,
        };
        let wrap = [wrap(sampler.wrap_s, &here)?, wrap(sampler.wrap_t, &here)?];
        let nearest = match sampler.mag_filter {
            None | Some(Checked::Valid(MagFilter::Linear)) => false,
            Some(Checked::Valid(MagFilter::Nearest)) => true,
            Some(Checked::Invalid) => {
                return Err(here.bad("the magFilter of its sampler is not one of glTF's"));
            }
        };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let to_uv = transform.map_or(ImageTexture::IDENTITY, to_uv);
        let (pixels, factor) = (Pixels::Srgb8(colour), [1.0; 3]);
        let second = set(info) != self.first_set;
        let shown = ImageTexture { width, height, pixels, to_uv, factor, wrap, nearest, second };
        Ok((source, shown))
    }

    /// Whether a texture names an image. Blender leaves out that of a lost one.
    pub(super) fn has_image(&self, info: &Info) -> bool {
        self.asset
            .root
            .textures
            .get(info.index.value())
            .is_none_or(|t| !sources(t).is_empty() || is_foreign(t))
    }

    /// The first image of a texture that can be had, and its index: of a picture and the same as WebP, one may not have
    /// been downloaded. A texture that names none is white.
    fn image_of(
        &mut self,
        texture: &gltf::json::Texture,
        place: &Place,
    ) -> Result<(usize, Decoded), LoadError> {
        let sources = sources(texture);
        if let (true, Some(extensions)) = (is_foreign(texture), &texture.extensions) {
            let names: Vec<&str> = extensions.others.keys().map(String::as_str).collect();
            return Err(place.unsupported(format_args!("an image of only {}", names.join(", "))));
        }
        let mut missing = None;
        for source in sources {
            match self.decoded(source, place) {
                Err(error @ LoadError { fault: LoadFault::Read(_), .. }) => missing = missing.or(Some(error)),
                decoded => return Ok((source.value(), decoded?)),
            }
        }
        if let Some(error) = missing {
            return Err(error);
        }
        self.asset.load.ignored(place, "it names no image: it is white");
        let white = Decoded { width: 1, height: 1, colour: Arc::new([[255; 3]]), alpha: None };
        Ok((NO_IMAGE, self.images.entry(NO_IMAGE).or_insert(white).clone()))
    }

    fn decoded(&mut self, index: Index<Image>, place: &Place) -> Result<Decoded, LoadError> {
        if let Some(decoded) = self.images.get(&index.value()) {
            return Ok(decoded.clone());
        }
        let image = self.asset.get(index, "image", place)?;
        let here = Place::part(self.asset.path, name("image", index.value(), image.name.as_deref()));
        self.asset.leave_out(&here, image.extensions.iter().flat_map(|e| e.others.keys()));
        let picture = match (image.buffer_view, &image.uri) {
            (Some(view), _) => {
                picture::decode(&self.asset.load.folder, self.asset.view(view, &here)?, &here)?
            }
            (None, Some(uri)) => {
                picture::decode(&self.asset.load.folder, &self.asset.resolve(uri, &here)?, &here)?
            }
            (None, None) => return Err(here.bad("it has neither a `bufferView` nor a `uri`")),
        };
        let rgba = match picture.samples {
            Samples::Eight(rgba) => rgba,
            Samples::Sixteen(rgba) => rgba.into_iter().map(|p| p.map(eight_bits)).collect(),
            Samples::Linear(_) => return Err(here.unsupported("an image that is neither PNG, JPEG nor WebP")),
        };
        self.count(rgba.len(), &here)?;
        let opaque = rgba.iter().all(|[.., a]| *a == 255);
        let decoded = Decoded {
            width: picture.width,
            height: picture.height,
            colour: rgba.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect(),
            alpha: (!opaque).then(|| rgba.iter().map(|[.., a]| *a).collect()),
        };
        self.images.insert(index.value(), decoded.clone());
        Ok(decoded)
    }

    /// Counts pixels against [`MAX_PIXELS`].
    fn count(&mut self, pixels: usize, place: &Place) -> Result<(), LoadError> {
        self.pixels += pixels as u64;
        place.at_most("pixels of images in all", self.pixels, MAX_PIXELS)
    }
}

/// The images that a texture names: a picture that anyone reads, and one of an extension.
fn sources(texture: &gltf::json::Texture) -> Vec<Index<Image>> {
    let webp = texture.extensions.as_ref().and_then(|e| e.others.get(WEBP)?.get("source")?.as_u64());
    let webp = webp.map(|index| Index::new(u32::try_from(index).unwrap_or(u32::MAX - 1)));
    let own = Some(texture.source).filter(|source| source.value() != NO_IMAGE);
    own.into_iter().chain(webp).collect()
}

/// Whether the only image of a texture is that of an extension which is not read.
fn is_foreign(texture: &gltf::json::Texture) -> bool {
    let others = texture.extensions.iter().flat_map(|e| &e.others);
    sources(texture).is_empty() && others.into_iter().any(|(_, value)| value.get("source").is_some())
}

/// A normal map as any texture. The types of the JSON leave its transform among unknown extensions.
pub(super) fn normal_info(normals: &NormalTexture) -> Info {
    let others = normals.extensions.as_ref().map(|e| &e.others);
    let extensions = others.and_then(|others| deserialize::from_value(Value::Object(others.clone())).ok());
    Info { index: normals.index, tex_coord: normals.tex_coord, extensions, extras: normals.extras.clone() }
}

/// The set of texture coordinates of a texture.
pub(super) fn set(info: &Info) -> u32 {
    let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
    transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord)
}

/// The nearest code of 8 bits.
fn eight_bits(code: u16) -> u8 {
    ((u32::from(code) * 255 + 32767) / 65535) as u8
}

fn wrap(mode: Checked<WrappingMode>, place: &Place) -> Result<Wrap, LoadError> {
    match mode {
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
        Checked::Invalid => Err(place.bad("a wrapping mode of its sampler is not one of glTF's")),
    }
}

/// The transform for texture coordinates with v = 0 at the bottom, where glTF has it at the top.
///
/// glTF scales, then rotates, then shifts: with s, c the sine and cosine,
/// u′ = c·sx·u + s·sy·v + ox and v′ = −s·sx·u + c·sy·v + oy. Here 1 − v stands for v on both sides.
fn to_uv(transform: &TextureTransform) -> [[f32; 3]; 2] {
    let (s, c) = transform.rotation.0.sin_cos();
    let [sx, sy] = transform.scale.0;
    let [ox, oy] = transform.offset.0;
    [[c * sx, -s * sy, s * sy + ox], [s * sx, c * sy, 1.0 - c * sy - oy]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use gltf::json::extensions::texture::{
        TextureTransformOffset, TextureTransformRotation, TextureTransformScale,
    };
    use std::f32::consts::FRAC_PI_2;

    /// Where the transform puts (u, v), both with v = 0 at the top as in glTF.
    fn moved(offset: [f32; 2], rotation: f32, scale: [f32; 2], [u, v]: [f32; 2]) -> [f32; 2] {
        let transform = TextureTransform {
            offset: TextureTransformOffset(offset),
            rotation: TextureTransformRotation(rotation),
            scale: TextureTransformScale(scale),
            ..TextureTransform::default()
        };
        let [x, y] = to_uv(&transform).map(|row| row[0] * u + row[1] * (1.0 - v) + row[2]);
        [x, 1.0 - y]
    }

    #[test]
    fn transforms_are_those_of_gltf() {
        let close = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).abs() < 1e-6 && (a[1] - b[1]).abs() < 1e-6;
        let p = [0.25, 0.75];
        assert!(close(moved([0.0; 2], 0.0, [1.0; 2], p), p));
        assert!(close(moved([0.5, 0.125], 0.0, [1.0; 2], p), [0.75, 0.875]));
        assert!(close(moved([0.0; 2], 0.0, [2.0, 3.0], p), [0.5, 2.25]));
        // A quarter turn counter-clockwise about the top left, v running down: right goes up
        assert!(close(moved([0.0; 2], FRAC_PI_2, [1.0; 2], [1.0, 0.0]), [0.0, -1.0]));
        assert!(close(moved([0.0; 2], FRAC_PI_2, [1.0; 2], [0.0, 1.0]), [1.0, 0.0]));
        // The example of the specification: the lower left quarter of the image, turned clockwise
        let example = |uv| moved([0.0, 1.0], FRAC_PI_2, [0.5; 2], uv);
        assert!(close(example([0.0, 0.0]), [0.0, 1.0]) && close(example([1.0, 1.0]), [0.5, 0.5]));
        // Scale first, shift last
        assert!(close(moved([0.5, 1.0], FRAC_PI_2, [2.0, 3.0], [1.0, 0.0]), [0.5, -1.0]));
    }

    #[test]
    fn codes_are_rounded() {
        assert_eq!([0, 128, 129, 32768, 65535].map(eight_bits), [0, 0, 1, 128, 255]);
    }
}
