//! `KHR_materials_clearcoat`.

use super::asset::Asset;
use crate::{LoadError, Place};
use gltf::json::texture::Info;
use gltf::json::{Value, deserialize};
use noisefloor_ptwne::{Material, MaterialId, MaterialOptions, SceneBuilder, SceneError, Texture};

pub(super) const NAME: &str = "KHR_materials_clearcoat";

/// What the extension says of a coat.
#[derive(Debug)]
pub(super) struct Clearcoat {
    pub(super) factor: f32,
    pub(super) texture: Option<Info>,
    pub(super) roughness: f32,
    pub(super) roughness_texture: Option<Info>,
}

/// A clear coat over a material. It has the smooth normals of the mesh.
#[derive(Debug)]
pub(super) struct Coat {
    pub(super) share: Texture,
    pub(super) roughness: f32,
    /// The same by place, if it varies.
    pub(super) alphas: Option<Texture>,
}

/// Reads the extension; none if there is no coat.
pub(super) fn parse(asset: &Asset<'_>, value: &Value, place: &Place) -> Result<Option<Clearcoat>, LoadError> {
    let factor = number(value, "clearcoatFactor", place)?;
    let roughness = number(value, "clearcoatRoughnessFactor", place)?;
    if factor == 0.0 {
        return Ok(None);
    }
    if value.get("clearcoatNormalTexture").is_some() {
        asset.load.ignored(place, "the normal map of its coat is ignored: the coat is smooth");
    }
    let texture = |name: &str| {
        let info = value.get(name).map(|info| deserialize::from_value::<Info>(info.clone()));
        info.transpose().map_err(|e| place.bad(format_args!("its {NAME}: {e}")))
    };
    let (texture, roughness_texture) = (texture("clearcoatTexture")?, texture("clearcoatRoughnessTexture")?);
    Ok(Some(Clearcoat { factor, texture, roughness, roughness_texture }))
}

/// A factor of 0…1; 0 if it is missing.
fn number(value: &Value, name: &str, place: &Place) -> Result<f32, LoadError> {
    let Some(number) = value.get(name) else { return Ok(0.0) };
    let number = number.as_f64().filter(|x| (0.0..=1.0).contains(x));
    number.map(|x| x as f32).ok_or_else(|| place.bad(format_args!("its {name} is no number of 0…1")))
}

impl Coat {
    pub(super) fn over(
        self,
        material: Material,
        cover: MaterialOptions,
        builder: &mut SceneBuilder,
    ) -> Result<MaterialId, SceneError> {
        let MaterialOptions { opacity, cutoff, culled, roughness, relief, .. } = cover;
        let sides = MaterialOptions { culled, ..MaterialOptions::default() };
        let base = builder.material_with(material, MaterialOptions { roughness, relief, ..sides.clone() })?;
        let film = Material::RoughConductor { reflectance: [1.0; 3].into(), roughness: self.roughness };
        let coat = MaterialOptions { roughness: self.alphas, ..sides.clone() };
        let film = builder.material_with(film, coat)?;
        builder.coated_material(base, film, self.share, MaterialOptions { opacity, cutoff, ..sides })
    }
}
