//! Materials (glTF 2.0, §3.9) with their extensions.

use super::asset::Asset;
use super::clearcoat::{self, Clearcoat, Coat};
use super::gloss::Gloss;
use super::parts::{AddedMaterial, Corners, name};
use super::texture::{Encoding, Textures, normal_info, set};
use crate::{LoadError, Place};
use gltf::json::extensions::material::PbrSpecularGlossiness;
use gltf::json::material::{AlphaMode, Material as Source};
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use gltf::json::{Index, Value, extensions};
use noisefloor::{Rgb, display::luminance};
use noisefloor_ptwne::{Emission, ImageTexture, Material, MaterialOptions, Relief, SceneBuilder, Texture};
use std::collections::HashMap;

/// Indices of refraction that the renderer takes for a material that is not transparent.
const MIN_OPAQUE_IOR: f32 = 1.0;
const MAX_IOR: f32 = 4.0;

/// `KHR_materials_specular`, which the types of the JSON leave among unknown extensions.
const SPECULAR: &str = "KHR_materials_specular";

/// Materials, added to the scene when first asked for.
#[derive(Debug)]
pub(super) struct Materials<'a> {
    asset: &'a Asset<'a>,
    textures: Textures<'a>,
    /// By index, and what the corners of the mesh have.
    added: HashMap<(Option<usize>, Corners), AddedMaterial>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(asset: &'a Asset<'a>) -> Self {
        Self { asset, textures: Textures::new(asset), added: HashMap::new() }
    }

    /// The material of that index, named by `place`; or glTF's default material; times what `corners` have.
    pub(super) fn material(
        &mut self,
        index: Option<Index<Source>>,
        corners: Corners,
        place: &Place,
        builder: &mut SceneBuilder,
    ) -> Result<AddedMaterial, LoadError> {
        let key = (index.map(|index| index.value()), corners);
        if let Some(added) = self.added.get(&key) {
            return Ok(added.clone());
        }
        let default = Source::default();
        let (source, called) = match index {
            Some(index) => {
                let source = self.asset.get(index, "material", place)?;
                (source, name("material", index.value(), source.name.as_deref()))
            }
            None => (&default, "default material".to_owned()),
        };
        let place = Place::part(self.asset.path, called);
        let mut reader = Reader {
            asset: self.asset,
            source,
            place,
            sets: [None; 2],
            corners,
            textures: &mut self.textures,
        };
        let read = reader.read()?;
        let coat = if read.unlit { None } else { reader.coat()? };
        let (sets, place) = (reader.sets, reader.place);
        let Read { material, cover, emission, unlit } = read;
        let normal_map = cover.relief.is_some();
        let refused = place.refused();
        let id = match coat {
            None => builder.material_with(material, cover).map_err(refused)?,
            Some(coat) => coat.over(material, cover, builder).map_err(refused)?,
        };
        let added = AddedMaterial { id, emission, unlit, sets, normal_map };
        self.added.insert(key, added.clone());
        Ok(added)
    }
}

struct Reader<'m, 'a> {
    asset: &'a Asset<'a>,
    source: &'m Source,
    place: Place,
    sets: [Option<u32>; 2],
    corners: Corners,
    textures: &'m mut Textures<'a>,
}

struct Read {
    material: Material,
    cover: MaterialOptions,
    emission: Option<Emission>,
    unlit: bool,
}

impl<'m> Reader<'m, '_> {
    fn read(&mut self) -> Result<Read, LoadError> {
        let source = self.source;
        let pbr = &source.pbr_metallic_roughness;
        if source.occlusion_texture.is_some() {
            self.asset.load.ignored(&self.place, "an occlusion map is ignored: light is traced");
        }
        let others = source.extensions.iter().flat_map(|e| e.others.keys());
        let known = [clearcoat::NAME, SPECULAR];
        self.asset.leave_out(&self.place, others.filter(|name| !known.contains(&name.as_str())));
        self.asset.leave_out(&self.place, pbr.extensions.iter().flat_map(|e| e.others.keys()));

        // The first texture chooses the first set of texture coordinates, the first with another the second
        let gloss = self.extensions().and_then(|e| e.pbr_specular_glossiness.as_ref());
        let (base_texture, metal_texture) = match gloss {
            Some(gloss) => (&gloss.diffuse_texture, &gloss.specular_glossiness_texture),
            None => (&pbr.base_color_texture, &pbr.metallic_roughness_texture),
        };
        let [base_texture, metal_texture, emissive_texture] =
            [base_texture, metal_texture, &source.emissive_texture].map(Option::as_ref);
        let mut normals = source.normal_texture.as_ref().map(|normals| (normal_info(normals), normals.scale));
        // White changes no factor, but as a normal it would lean
        if normals.as_ref().is_some_and(|(info, _)| !self.textures.has_image(info)) {
            self.asset.load.ignored(&self.place, "its normal map names no image: it is left out");
            normals = None;
        }
        let all = [base_texture, metal_texture, normals.as_ref().map(|n| &n.0), emissive_texture];
        self.sets[0] = all.into_iter().flatten().map(set).next();
        self.textures.first_set = self.sets[0].unwrap_or_default();

        if self.extensions().is_some_and(|e| e.unlit.is_some()) {
            return self.unlit(base_texture);
        }
        let (material, roughness) = match (self.transmission(base_texture)?, gloss) {
            (Some(glass), _) => glass,
            (None, Some(gloss)) => (self.glossy(gloss)?, None),
            (None, None) => (self.opaque(base_texture, metal_texture)?, None),
        };
        let relief = match normals.filter(|(info, _)| self.fits(info)) {
            Some((info, scale)) => {
                let map = self.textures.colour(&info, Encoding::Linear, &self.place)?;
                let scale = self.within(scale, "scale of the normal map", -1e6, 1e6);
                Some(Relief::Normals { map: Texture::Image(map), scale, mirrors: true })
            }
            None => None,
        };
        // The inside of glass is part of it, and a pane has no inside
        let glass = matches!(material, Material::RoughGlass { .. } | Material::ThinGlass { .. });
        let (opacity, cutoff) = self.opacity(base_texture)?;
        let cover = MaterialOptions {
            opacity,
            cutoff,
            culled: !source.double_sided && !glass,
            roughness,
            relief,
            ..MaterialOptions::default()
        };
        let emission = self.emission(emissive_texture)?;
        Ok(Read { material, cover, emission, unlit: false })
    }

    /// `KHR_materials_clearcoat`.
    fn coat(&mut self) -> Result<Option<Coat>, LoadError> {
        let Some(value) = self.extensions().and_then(|e| e.others.get(clearcoat::NAME)) else {
            return Ok(None);
        };
        let Some(Clearcoat { factor, texture, roughness, roughness_texture }) =
            clearcoat::parse(self.asset, value, &self.place)?
        else {
            return Ok(None);
        };
        let share = match texture.filter(|info| self.fits(info)) {
            Some(info) => {
                let image = self.textures.red(&info, &self.place)?;
                Texture::Image(ImageTexture { factor: [factor; 3], ..image })
            }
            None => Texture::Colour([factor; 3]),
        };
        let alphas = match roughness_texture.filter(|info| self.fits(info)) {
            Some(info) => Some(self.textures.alphas(&info, roughness, &self.place)?),
            None => None,
        };
        Ok(Some(Coat { share, roughness: roughness * roughness, alphas }))
    }

    /// `KHR_materials_unlit`: shows its colour, and reflects nothing. In a traced scene that is light.
    fn unlit(&mut self, base: Option<&Info>) -> Result<Read, LoadError> {
        let [r, g, b, _] = self.source.pbr_metallic_roughness.base_color_factor.0;
        let radiance = [r, g, b].map(|x| self.within(x, "baseColorFactor", 0.0, 1.0));
        let texture = self.colour([1.0; 3], base, Encoding::Srgb)?;
        let texture = Some(self.tinted(texture)).filter(|texture| *texture != Texture::Colour([1.0; 3]));
        let (opacity, cutoff) = self.opacity(base)?;
        let cover = MaterialOptions {
            opacity,
            cutoff,
            culled: !self.source.double_sided,
            ..MaterialOptions::default()
        };
        let emission = Emission { radiance, texture, two_sided: self.source.double_sided };
        let emission = Some(emission).filter(|_| radiance != [0.0; 3]);
        Ok(Read { material: Material::diffuse([0.0; 3]), cover, emission, unlit: true })
    }

    /// `KHR_materials_pbrSpecularGlossiness`.
    fn glossy(&mut self, gloss: &PbrSpecularGlossiness) -> Result<Material, LoadError> {
        let [r, g, b, _] = gloss.diffuse_factor.0;
        let diffuse = [r, g, b].map(|x| self.within(x, "diffuseFactor", 0.0, 1.0));
        let specular = gloss.specular_factor.0.map(|x| self.within(x, "specularFactor", 0.0, 1.0));
        let glossiness = self.within(gloss.glossiness_factor.0, "glossinessFactor", 0.0, 1.0);
        let factor = Gloss { diffuse, specular, glossiness };
        self.asset
            .load
            .approximated(&self.place, "its specular colour and glossiness become metal and roughness");
        let of_diffuse = gloss.diffuse_texture.as_ref().filter(|info| self.fits(info));
        let of_specular = gloss.specular_glossiness_texture.as_ref();
        // Both become one picture
        let apart = of_specular.zip(of_diffuse).is_some_and(|(one, other)| set(one) != set(other));
        if apart {
            let what = "its specularGlossinessTexture is ignored: it uses another set of texture coordinates";
            self.asset.load.ignored(&self.place, what);
        }
        let of_specular = of_specular.filter(|info| !apart && self.fits(info));
        let (base, metallic_roughness) =
            self.textures.gloss(factor, [of_diffuse, of_specular], &self.place)?;
        let base = self.tinted(base);
        let ior = self.dielectric();
        Ok(Material::MetallicRoughness { base, metallic_roughness, ior })
    }

    /// Times the colours of corners, if the mesh has any.
    fn tinted(&self, base: Texture) -> Texture {
        match (self.corners != Corners::Nothing, &base) {
            (false, _) => base,
            (true, Texture::Colour([1.0, 1.0, 1.0])) => Texture::Corners(None),
            (true, _) => Texture::Corners(Some(Box::new(base))),
        }
    }

    fn colour(
        &mut self,
        factor: Rgb,
        texture: Option<&Info>,
        encoding: Encoding,
    ) -> Result<Texture, LoadError> {
        let Some(info) = texture.filter(|info| self.fits(info)) else { return Ok(factor.into()) };
        let image = self.textures.colour(info, encoding, &self.place)?;
        Ok(Texture::Image(ImageTexture { factor, ..image }))
    }

    /// Whether a texture uses one of the material's sets of texture coordinates: there can be two.
    fn fits(&mut self, info: &Info) -> bool {
        let set = set(info);
        if self.sets[0].is_none() {
            self.textures.first_set = set;
        }
        let first = *self.sets[0].get_or_insert(set);
        let fits = first == set || *self.sets[1].get_or_insert(set) == set;
        if !fits {
            let what = format_args!(
                "texture {} is ignored: it uses set {set} of texture coordinates, others the sets {first} and {}",
                info.index.value(),
                self.sets[1].unwrap_or_default()
            );
            self.asset.load.ignored(&self.place, what);
        }
        fits
    }

    fn opaque(&mut self, base: Option<&Info>, metal: Option<&Info>) -> Result<Material, LoadError> {
        let pbr = &self.source.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor.0;
        let factor = [r, g, b].map(|x| self.within(x, "baseColorFactor", 0.0, 1.0));
        let base = self.colour(factor, base, Encoding::Srgb)?;
        let base = self.tinted(base);
        let roughness = self.within(pbr.roughness_factor.0, "roughnessFactor", 0.0, 1.0);
        let metallic = self.within(pbr.metallic_factor.0, "metallicFactor", 0.0, 1.0);
        let metallic_roughness = self.colour([1.0, roughness, metallic], metal, Encoding::Linear)?;
        let ior = self.dielectric();
        Ok(Material::MetallicRoughness { base, metallic_roughness, ior })
    }

    /// `KHR_materials_transmission`: all or nothing. A smooth pane, unless `KHR_materials_volume` says
    /// that the surface bounds a volume.
    fn transmission(
        &mut self,
        base: Option<&Info>,
    ) -> Result<Option<(Material, Option<Texture>)>, LoadError> {
        let Some(transmission) = self.extensions().and_then(|e| e.transmission.as_ref()) else {
            return Ok(None);
        };
        if transmission.transmission_texture.is_some() {
            self.asset.load.ignored(&self.place, "its transmission texture is ignored, only its factor used");
        }
        let share = self.within(transmission.transmission_factor.0, "transmissionFactor", 0.0, 1.0);
        if share > 0.0 && share < 1.0 {
            let what = if share >= 0.5 { "1: all glass" } else { "0: opaque" };
            self.asset
                .load
                .ignored(&self.place, format_args!("a transmissionFactor of {share} is taken for {what}"));
        }
        if share < 0.5 {
            return Ok(None);
        }
        let pbr = &self.source.pbr_metallic_roughness;
        if base.is_some() {
            self.asset.load.ignored(&self.place, "its base colour texture is ignored: glass has one tint");
        }
        if self.corners != Corners::Nothing {
            self.asset.load.ignored(&self.place, "the colours of corners are ignored: glass has one tint");
        }
        let [r, g, b, _] = pbr.base_color_factor.0;
        let tint = [r, g, b].map(|x| self.within(x, "baseColorFactor", 0.0, 1.0));
        let roughness = self.within(pbr.roughness_factor.0, "roughnessFactor", 0.0, 1.0);
        let ior = self.ior(0.25);
        if self.is_solid() {
            let map = match &pbr.metallic_roughness_texture {
                Some(info) if self.fits(info) => Some(self.textures.alphas(info, roughness, &self.place)?),
                _ => None,
            };
            let glass = Material::RoughGlass { ior, tint, roughness: roughness * roughness };
            return Ok(Some((glass, map)));
        }
        if roughness > 0.0 {
            let what = format_args!("a roughness of {roughness} is ignored: panes are smooth");
            self.asset.load.ignored(&self.place, what);
        }
        Ok(Some((Material::ThinGlass { ior, tint }, None)))
    }

    /// Whether the surface bounds a volume, whose extent is that of the mesh: the thickness serves renderers
    /// that do not trace it.
    fn is_solid(&mut self) -> bool {
        let volume = self.extensions().and_then(|e| e.volume.as_ref());
        let Some(volume) = volume.filter(|volume| volume.thickness_factor.0 > 0.0) else { return false };
        if volume.attenuation_distance.0.is_finite() && volume.attenuation_color.0 != [1.0; 3] {
            self.asset.load.ignored(&self.place, "the attenuation in its volume is ignored: glass is clear");
        }
        true
    }

    /// The opacity, and the least that counts as opaque: the alphas of factor, texture and corners,
    /// multiplied.
    fn opacity(&mut self, base: Option<&Info>) -> Result<(Option<Texture>, Option<f32>), LoadError> {
        let [.., alpha] = match self.extensions().and_then(|e| e.pbr_specular_glossiness.as_ref()) {
            Some(gloss) => gloss.diffuse_factor.0,
            None => self.source.pbr_metallic_roughness.base_color_factor.0,
        };
        let cutoff = match self.source.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => return Ok((None, None)),
            Checked::Valid(AlphaMode::Blend) => None,
            Checked::Valid(AlphaMode::Mask) => Some(self.source.alpha_cutoff.unwrap_or_default().0),
            Checked::Invalid => return Err(self.place.bad("its alphaMode is not one of glTF's")),
        };
        let factor = self.within(alpha, "alpha of baseColorFactor", 0.0, 1.0);
        let image = match base.filter(|info| self.sets.contains(&Some(set(info)))) {
            Some(info) => self.textures.opacity(info, &self.place)?,
            None => None,
        };
        let opacity = match image {
            Some(image) => Texture::Image(ImageTexture { factor: [factor; 3], ..image }),
            None => Texture::Colour([factor; 3]),
        };
        if self.corners == Corners::ColoursAndAlphas {
            return Ok((Some(Texture::Corners(Some(Box::new(opacity)))), cutoff));
        }
        Ok(match (opacity, cutoff) {
            // The same everywhere, and often 1
            (Texture::Colour(_), None) if factor >= 1.0 => (None, None),
            (Texture::Colour(_), Some(cutoff)) if factor >= cutoff => (None, None),
            (opacity, cutoff) => (Some(opacity), cutoff),
        })
    }

    fn emission(&mut self, texture: Option<&Info>) -> Result<Option<Emission>, LoadError> {
        let strength = self
            .extensions()
            .and_then(|e| e.emissive_strength.as_ref())
            .map_or(1.0, |e| e.emissive_strength.0);
        let factor = self.source.emissive_factor.0;
        let radiance = factor.map(|x| self.within(x * strength, "emission", 0.0, f32::MAX));
        if radiance == [0.0; 3] {
            return Ok(None);
        }
        let two_sided = self.source.double_sided;
        let texture = match texture {
            // A lamp that shines all over instead of in places would be worse than none
            Some(info) if !self.fits(info) => return Ok(None),
            Some(_) => Some(self.colour([1.0; 3], texture, Encoding::Srgb)?),
            None => None,
        };
        Ok(Some(Emission { radiance, texture, two_sided }))
    }

    /// Index of refraction of what is no metal; with `KHR_materials_specular` that of the same grey
    /// reflection at normal incidence.
    fn dielectric(&mut self) -> f32 {
        let ior = self.ior(MIN_OPAQUE_IOR);
        let Some(value) = self.extensions().and_then(|e| e.others.get(SPECULAR)) else { return ior };
        let number = |value: Option<&Value>| value.and_then(Value::as_f64).map_or(1.0, |x| x as f32);
        let share = number(value.get("specularFactor"));
        let colour = [0, 1, 2].map(|i| number(value.get("specularColorFactor").and_then(|c| c.get(i))));
        if value.get("specularTexture").or(value.get("specularColorTexture")).is_some() {
            self.asset.load.ignored(&self.place, "the textures of its KHR_materials_specular are ignored");
        }
        if share == 1.0 && colour == [1.0; 3] {
            return ior;
        }
        let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2) * share * luminance(colour);
        let root = f0.clamp(0.0, 1.0).sqrt();
        let nearest = ((1.0 + root) / (1.0 - root)).min(MAX_IOR);
        let what =
            format_args!("its KHR_materials_specular is replaced by an index of refraction of {nearest:.3}");
        self.asset.load.approximated(&self.place, what);
        nearest
    }

    /// Index of refraction.
    fn ior(&mut self, min: f32) -> f32 {
        let ior = self.extensions().and_then(|e| e.ior.as_ref()).map_or(1.5, |e| e.ior.0);
        self.within(ior, "index of refraction", min, MAX_IOR)
    }

    /// The nearest number in a range, with a warning if it is another.
    fn within(&mut self, x: f32, what: &str, min: f32, max: f32) -> f32 {
        let nearest = x.clamp(min, max);
        if nearest != x {
            self.asset.load.ignored(&self.place, format_args!("{what} is {x}, taken for {nearest}"));
        }
        nearest
    }

    fn extensions(&self) -> Option<&'m extensions::material::Material> {
        self.source.extensions.as_ref()
    }
}
