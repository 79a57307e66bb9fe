//! Shapes for the built-in scenes.

use crate::{
    Camera, Emission, Environment, Material, MaterialId, Mesh, Scene, SceneBuilder, SceneError, Texture,
};
use noisefloor::Rgb;
use std::f32::consts::PI;

pub(super) type P = [f32; 3];

/// A builder with the shapes of rooms and still lifes. It keeps the first error, so that scenes read as
/// lists.
pub(super) struct Kit {
    builder: SceneBuilder,
    error: Option<SceneError>,
}

/// A camera for a scene with +y up.
pub(super) fn look_at(eye: P, target: P, vertical_fov: f32) -> Camera {
    Camera { eye, target, up: [0.0, 1.0, 0.0], vertical_fov }
}

pub(super) fn emission(radiance: Rgb) -> Option<Emission> {
    Some(Emission::front(radiance))
}

impl Kit {
    pub(super) fn new(name: &str, camera: Camera) -> Result<Self, SceneError> {
        Ok(Self { builder: SceneBuilder::new(name, camera)?, error: None })
    }

    fn keep(&mut self, result: Result<(), SceneError>) {
        if let (Err(error), None) = (result, &self.error) {
            self.error = Some(error);
        }
    }

    pub(super) fn build(self) -> Result<Scene, SceneError> {
        match self.error {
            Some(error) => Err(error),
            None => self.builder.build(),
        }
    }

    pub(super) fn material(&mut self, material: Material) -> Result<MaterialId, SceneError> {
        self.builder.material(material)
    }

    pub(super) fn diffuse(&mut self, albedo: impl Into<Texture>) -> Result<MaterialId, SceneError> {
        self.builder.material(Material::Diffuse { albedo: albedo.into() })
    }

    pub(super) fn checker(&mut self, colours: [Rgb; 2], scale: [f32; 2]) -> Result<MaterialId, SceneError> {
        self.diffuse(Texture::Checker { colours, scale })
    }

    pub(super) fn noise(&mut self, colours: [Rgb; 2], scale: [f32; 2]) -> Result<MaterialId, SceneError> {
        self.diffuse(Texture::Noise { colours, scale })
    }

    pub(super) fn brick(
        &mut self,
        [brick, mortar]: [Rgb; 2],
        scale: [f32; 2],
    ) -> Result<MaterialId, SceneError> {
        self.diffuse(Texture::Brick { brick, mortar, scale })
    }

    pub(super) fn metal(&mut self, colour: Rgb, roughness: f32) -> Result<MaterialId, SceneError> {
        self.builder.material(Material::RoughConductor { reflectance: colour.into(), roughness })
    }

    pub(super) fn sky(&mut self, environment: Environment) {
        let result = self.builder.environment(environment);
        self.keep(result);
    }

    pub(super) fn quad(&mut self, corner: P, e1: P, e2: P, material: MaterialId, light: Option<Emission>) {
        let result = self.builder.parallelogram(corner, e1, e2, material, light);
        self.keep(result);
    }

    pub(super) fn ball(&mut self, centre: P, radius: f32, material: MaterialId, light: Option<Emission>) {
        let result = self.builder.sphere(centre, radius, material, light);
        self.keep(result);
    }

    pub(super) fn mesh(&mut self, mesh: &Mesh<'_>, material: MaterialId) {
        let result = self.builder.mesh(mesh, material, None).map(|_| ());
        self.keep(result);
    }

    /// A horizontal rectangle at height `y` over x0…x1 and z0…z1, front up or down.
    pub(super) fn floor(
        &mut self,
        y: f32,
        x: [f32; 2],
        z: [f32; 2],
        up: bool,
        m: MaterialId,
        light: Option<Emission>,
    ) {
        let (ex, ez) = ([x[1] - x[0], 0.0, 0.0], [0.0, 0.0, z[1] - z[0]]);
        let corner = [x[0], y, z[0]];
        if up {
            self.quad(corner, ez, ex, m, light);
        } else {
            self.quad(corner, ex, ez, m, light);
        }
    }

    /// An upright wall from (x0, z0) to (x1, z1) between two heights.
    pub(super) fn wall(&mut self, from: [f32; 2], to: [f32; 2], y: [f32; 2], m: MaterialId) {
        let along = [to[0] - from[0], 0.0, to[1] - from[1]];
        self.quad([from[0], y[0], from[1]], along, [0.0, y[1] - y[0], 0.0], m, None);
    }

    pub(super) fn cuboid(&mut self, low: P, high: P, m: MaterialId) {
        let size = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
        let centre = [0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])];
        self.turned(centre, size, 0.0, m);
    }

    /// A box that stands on `base`, the centre of its lower face, turned around the vertical by `angle`
    /// degrees.
    pub(super) fn turned(&mut self, base: P, size: P, angle: f32, m: MaterialId) {
        let (sin, cos) = angle.to_radians().sin_cos();
        let x = [cos * size[0], 0.0, -sin * size[0]];
        let z = [sin * size[2], 0.0, cos * size[2]];
        let y = [0.0, size[1], 0.0];
        let add = |a: P, b: P| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let low = [base[0] - 0.5 * (x[0] + z[0]), base[1], base[2] - 0.5 * (x[2] + z[2])];
        // Front faces outward; u runs along the ground on the four sides
        let minus = |a: P| a.map(|c| -c);
        self.quad(low, x, z, m, None);
        self.quad(add(low, y), z, x, m, None);
        self.quad(add(low, x), minus(x), y, m, None);
        self.quad(add(low, z), x, y, m, None);
        self.quad(low, z, y, m, None);
        self.quad(add(add(low, x), z), minus(z), y, m, None);
    }

    /// A surface of revolution around the vertical through `base`: `profile` is a list of (radius, height),
    /// from the bottom up. Smooth around, and along the profile if `smooth`.
    pub(super) fn lathe(&mut self, base: P, profile: &[[f32; 2]], sides: u32, smooth: bool, m: MaterialId) {
        let (mut positions, mut normals, mut uvs, mut indices) = (vec![], vec![], vec![], vec![]);
        let slope = |i: usize, j: usize| {
            let (a, b) = (profile[i], profile[j]);
            let (dr, dy) = (b[0] - a[0], b[1] - a[1]);
            let length = (dr * dr + dy * dy).sqrt().max(1e-9);
            [dy / length, -dr / length]
        };
        for k in 1..profile.len() {
            // Each band has its own vertices, so that its ends can have their own normals
            let mut ends = [slope(k - 1, k); 2];
            if smooth {
                let before = if k > 1 { slope(k - 2, k - 1) } else { ends[0] };
                let after = if k + 1 < profile.len() { slope(k, k + 1) } else { ends[1] };
                ends = [
                    [ends[0][0] + before[0], ends[0][1] + before[1]],
                    [ends[1][0] + after[0], ends[1][1] + after[1]],
                ];
            }
            let first = positions.len() as u32;
            for s in 0..=sides {
                let (sin, cos) = (2.0 * PI * s as f32 / sides as f32).sin_cos();
                for (end, [r, y]) in [profile[k - 1], profile[k]].into_iter().enumerate() {
                    positions.push([base[0] + r * cos, base[1] + y, base[2] - r * sin]);
                    normals.push([ends[end][0] * cos, ends[end][1], -ends[end][0] * sin]);
                    uvs.push([s as f32 / sides as f32, y]);
                }
            }
            for s in 0..sides {
                let a = first + 2 * s;
                indices.extend([[a, a + 2, a + 1], [a + 1, a + 2, a + 3]]);
            }
        }
        let (positions, normals, uvs, indices) = (&positions, &normals, &uvs, &indices);
        self.mesh(&Mesh { positions, normals, uvs, indices, ..Mesh::default() }, m);
    }
}
