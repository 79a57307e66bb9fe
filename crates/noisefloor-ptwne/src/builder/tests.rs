//! Bad input, and triangles without area.

use super::{Emission, MaterialId, Mesh, SceneBuilder};
use crate::camera::Camera;
use crate::error::SceneError;
use crate::material::Material;

fn builder() -> SceneBuilder {
    let camera = Camera { eye: [0.0, 0.0, 5.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], vertical_fov: 40.0 };
    SceneBuilder::new("test", camera).unwrap()
}

#[test]
fn bad_input_is_a_typed_error() {
    let mut b = builder();
    assert!(matches!(b.material(Material::diffuse([1.2; 3])), Err(SceneError::Range { .. })));
    assert!(matches!(b.material(Material::diffuse([-0.1; 3])), Err(SceneError::Range { .. })));
    assert!(b.material(Material::Glass { ior: f32::NAN, tint: [1.0; 3] }).is_err());
    let noisy = Material::RoughConductor { reflectance: [0.5; 3].into(), roughness: 1.5 };
    assert!(b.material(noisy).is_err());
    let m = b.material(Material::diffuse([0.5; 3])).unwrap();
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    assert_eq!(b.parallelogram([0.0; 3], x, y, MaterialId(9), None), Err(SceneError::Material(9)));
    let nan = b.parallelogram([f32::NAN, 0.0, 0.0], x, y, m, None);
    assert!(matches!(nan, Err(SceneError::NotFinite { .. })));
    let light = Some(Emission::front([1.0; 3]));
    assert_eq!(b.parallelogram([0.0; 3], x, x, m, light), Err(SceneError::EmptyEmitter));
    assert!(b.parallelogram([0.0; 3], x, y, m, Some(Emission::front([-1.0; 3]))).is_err());
    assert!(b.sphere([0.0; 3], 0.0, m, None).is_err());
    assert!(b.sphere([1e30, 0.0, 0.0], 1.0, m, None).is_err());
    let positions = [[0.0; 3], x, y];
    let mesh = Mesh { positions: &positions, indices: &[[0, 1, 3]], ..Mesh::default() };
    assert_eq!(b.mesh(&mesh, m, None), Err(SceneError::Index { index: 3, vertices: 3 }));
    let mesh = Mesh { positions: &positions, uvs: &[[0.0; 2]], indices: &[[0, 1, 2]], ..Mesh::default() };
    assert!(matches!(b.mesh(&mesh, m, None), Err(SceneError::Lengths { .. })));
    assert_eq!(b.build().unwrap().surfaces(), 0);
}

#[test]
fn triangles_without_area_are_left_out() {
    let mut b = builder();
    let m = b.material(Material::diffuse([0.5; 3])).unwrap();
    let positions = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = Mesh { positions: &positions, indices: &[[0, 1, 2], [0, 0, 3], [0, 1, 3]], ..Mesh::default() };
    let light = || Some(Emission::front([1.0; 3]));
    assert_eq!(b.mesh(&mesh, m, None), Ok(2));
    assert_eq!(b.mesh(&mesh, m, light()), Ok(2));
    let mesh = Mesh { indices: &[[0, 1, 2]], ..mesh };
    assert_eq!(b.mesh(&mesh, m, light()), Err(SceneError::EmptyEmitter));
    let scene = b.build().unwrap();
    assert_eq!((scene.surfaces(), scene.lights()), (2, 1));
}

#[test]
fn too_little_memory_is_an_error() {
    let bytes = usize::MAX / 4;
    assert_eq!(crate::check_memory(bytes), Err(SceneError::Memory { bytes }));
    assert_eq!(crate::check_memory(1000), Ok(()));
    let said = SceneError::Memory { bytes: 7 }.to_string();
    assert!(said.starts_with("there is no memory for 7 bytes more"), "{said}");
}
