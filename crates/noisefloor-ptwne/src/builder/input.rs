//! What a builder is given.

use crate::checks::{check_reflectance, position};
use crate::error::SceneError;
use crate::texture::Texture;
use noisefloor::Rgb;

/// Largest number of surfaces (triangles, parallelograms, spheres, ellipses) of a scene.
pub const MAX_SURFACES: usize = 1 << 26;
/// Largest number of instances of a scene.
pub const MAX_INSTANCES: usize = 1 << 22;
/// Planar surfaces with less area than this, in squared scene units, are left out.
pub const MIN_AREA: f32 = 1e-18;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MaterialId(pub(super) u32);

/// Light that a surface emits, equally in all directions, besides what it reflects.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Linear radiance, 0…1e12.
    pub radiance: Rgb,
    /// A factor on the radiance, by the texture coordinates of the surface. Not for spheres.
    pub texture: Option<Texture>,
    /// Whether the back emits too. The front of a triangle is where its corners run counter-clockwise, that
    /// of a parallelogram or ellipse is where `e1`×`e2` points, that of a sphere is its outside.
    pub two_sided: bool,
}

impl Emission {
    pub fn front(radiance: Rgb) -> Self {
        Self { radiance, texture: None, two_sided: false }
    }

    pub fn two_sided(radiance: Rgb) -> Self {
        Self { two_sided: true, ..Self::front(radiance) }
    }
}

/// Indexed triangles, borrowed from the caller.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mesh<'a> {
    /// Corners, in scene units.
    pub positions: &'a [[f32; 3]],
    /// One shading normal per position, or none for flat faces. They need not have length 1; triangles with a
    /// normal of length 0 are flat.
    pub normals: &'a [[f32; 3]],
    /// One pair of texture coordinates per position, or none: then (0, 0), (1, 0), (0, 1) on each triangle.
    pub uvs: &'a [[f32; 2]],
    /// One colour per position for [`Texture::Corners`], each channel in 0…1, or none.
    pub colours: &'a [[f32; 3]],
    /// One opacity of 0…1 per position for an opacity of [`Texture::Corners`], or none.
    pub alphas: &'a [f32],
    /// A second pair of texture coordinates per position for images that are
    /// [`second`](crate::ImageTexture::second), or none. Only beside `uvs`.
    pub second_uvs: &'a [[f32; 2]],
    /// One tangent per position for a [`Relief::Normals`](crate::Relief::Normals), or none: its red is along
    /// x, y and z, its green along the cross product of the shading normal and that, times the fourth number,
    /// 1 or −1 (glTF 2.0, §3.7.2.1).
    pub tangents: &'a [[f32; 4]],
    /// Three indices per triangle, counter-clockwise as seen from the front.
    pub indices: &'a [[u32; 3]],
}

impl Mesh<'_> {
    /// Checks that all numbers are in range, and that lengths and indices fit.
    pub(super) fn check(&self) -> Result<(), SceneError> {
        let vertices = self.positions.len();
        for (what, found) in [
            ("normals", self.normals.len()),
            ("texture coordinates", self.uvs.len()),
            ("colours", self.colours.len()),
            ("alphas", self.alphas.len()),
            ("second texture coordinates", self.second_uvs.len()),
            ("tangents", self.tangents.len()),
        ] {
            if found != 0 && found != vertices {
                return Err(SceneError::Lengths { what, positions: vertices, found });
            }
        }
        if !self.uvs.iter().chain(self.second_uvs).flatten().all(|x| x.is_finite()) {
            return Err(SceneError::NotFinite { what: "a texture coordinate" });
        }
        for p in self.positions.iter().chain(self.normals) {
            position(*p)?;
        }
        self.colours.iter().try_for_each(|c| check_reflectance(*c))?;
        self.alphas.iter().try_for_each(|a| check_reflectance([*a; 3]))?;
        for [x, y, z, _] in self.tangents {
            position([*x, *y, *z])?;
        }
        match self.indices.iter().flatten().find(|i| **i as usize >= vertices) {
            Some(&index) => Err(SceneError::Index { index, vertices }),
            None => Ok(()),
        }
    }
}
