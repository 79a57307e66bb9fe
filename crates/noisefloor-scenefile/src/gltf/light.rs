//! Lights without size: `KHR_lights_punctual`.

use super::asset::{Asset, name};
use super::nodes::Placed;
use super::notes::Notes;
use crate::{LoadError, Place};
use gltf::json::Index;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked;
use noisefloor_ptwne::{Falloff, Punctual, SceneBuilder};

/// Adds the light of a node. Candela become units of radiant intensity, and lux of irradiance, by their
/// numbers, as nits of emissive materials become units of radiance.
pub(super) fn add(
    asset: &Asset<'_>,
    placed: &Placed<'_>,
    index: Index<Light>,
    builder: &mut SceneBuilder,
    notes: &mut Notes,
) -> Result<(), LoadError> {
    let light = asset.get(index, "light", &placed.place)?;
    let place = Place::part(asset.path, name("light", index.value(), light.name.as_deref()));
    if light.range.is_some() {
        notes.warn(&place, "its range is ignored: light reaches any distance");
    }
    let power = light.color.map(|x| x * light.intensity);
    let position = placed.to_world.translation.as_vec3().to_array();
    let direction = (-placed.to_world.matrix3.z_axis).normalize_or_zero().as_vec3().to_array();
    let punctual = match (&light.type_, &light.spot) {
        (Checked::Valid(Type::Point), _) => Punctual::Point { position, intensity: power },
        (Checked::Valid(Type::Directional), _) => Punctual::Distant { direction, irradiance: power },
        (Checked::Valid(Type::Spot), Some(spot)) => {
            let [inner, outer] = [spot.inner_cone_angle, spot.outer_cone_angle].map(f32::to_degrees);
            // Exporters write equal angles for a hard edge
            let inner = inner.min(0.999 * outer);
            let falloff = Falloff::Squared;
            Punctual::Spot { position, direction, intensity: power, inner, outer, falloff }
        }
        _ => return Err(place.bad("it is not a point, directional or spot light with its properties")),
    };
    builder.punctual(punctual).map_err(|cause| LoadError::Scene { place, cause })
}
