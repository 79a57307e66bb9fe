//! A Cornell box, put together from the renderer's own parts.

use rs_pbrt::core::api::RenderOptions;
use rs_pbrt::core::geometry::{Point3f, Vector3f};
use rs_pbrt::core::light::Light;
use rs_pbrt::core::material::Material;
use rs_pbrt::core::medium::MediumInterface;
use rs_pbrt::core::pbrt::Spectrum;
use rs_pbrt::core::primitive::{GeometricPrimitive, Primitive};
use rs_pbrt::core::shape::Shape;
use rs_pbrt::core::transform::Transform;
use rs_pbrt::lights::diffuse::DiffuseAreaLight;
use rs_pbrt::materials::matte::MatteMaterial;
use rs_pbrt::shapes::triangle::{Triangle, TriangleMesh};
use rs_pbrt::textures::constant::ConstantTexture;
use std::sync::Arc;

const WHITE: [f32; 3] = [0.73, 0.73, 0.71];
const RED: [f32; 3] = [0.61, 0.06, 0.05];
const GREEN: [f32; 3] = [0.13, 0.44, 0.10];
const LIGHT: [f32; 3] = [22.0, 18.0, 12.5];
/// Longest path in bounces, pbrt's own choice. Bidirectional paths are always that long, and connected
/// everywhere.
const MAX_DEPTH: i32 = 5;

/// The built-in scene cornell-box of noisefloor-ptwne, for `path` or `bdpt`.
pub(crate) fn cornell_box(width: usize, height: usize, integrator: &str) -> RenderOptions {
    let mut options = RenderOptions { integrator_name: integrator.into(), ..Default::default() };
    options.film_params.add_int("xresolution".into(), width as i32);
    options.film_params.add_int("yresolution".into(), height as i32);
    options.sampler_name = "random".into();
    options.integrator_params.add_int("maxdepth".into(), MAX_DEPTH);
    options.integrator_params.add_string("lightsamplestrategy".into(), "uniform".into());

    // Of the shorter side. pbrt's coordinates are left-handed: seen from a mirrored camera, the scene is as
    // it should be
    options.camera_params.add_float("fov".into(), 39.0);
    let eye = Point3f { x: 0.0, y: 1.0, z: 3.82 };
    let target = Point3f { x: 0.0, y: 1.0, z: 0.0 };
    let up = Vector3f { x: 0.0, y: 1.0, z: 0.0 };
    let to_camera = Transform::scale(-1.0, 1.0, 1.0) * Transform::look_at(&eye, &target, &up);
    options.camera_to_world.t = [Transform::inverse(&to_camera); 2];

    // Corners go around as seen from inside
    let (l, r, near, far) = (-1.0, 1.0, 1.0, -1.0);
    quad(&mut options, [[l, 0.0, near], [r, 0.0, near], [r, 0.0, far], [l, 0.0, far]], WHITE, None);
    quad(&mut options, [[l, 2.0, far], [r, 2.0, far], [r, 2.0, near], [l, 2.0, near]], WHITE, None);
    quad(&mut options, [[l, 0.0, far], [r, 0.0, far], [r, 2.0, far], [l, 2.0, far]], WHITE, None);
    quad(&mut options, [[l, 0.0, near], [l, 0.0, far], [l, 2.0, far], [l, 2.0, near]], RED, None);
    quad(&mut options, [[r, 0.0, far], [r, 0.0, near], [r, 2.0, near], [r, 2.0, far]], GREEN, None);
    cuboid(&mut options, [-0.34, -0.32], [0.3, 1.2], 18.0);
    cuboid(&mut options, [0.36, 0.34], [0.3, 0.6], -17.0);
    let (x, y, z) = (0.24, 1.995, [-0.22, 0.18]);
    let lamp = [[-x, y, z[0]], [x, y, z[0]], [x, y, z[1]], [-x, y, z[1]]];
    quad(&mut options, lamp, WHITE, Some(LIGHT));
    options
}

/// Four sides and the top of a box that stands on the floor, turned about its axis.
fn cuboid(options: &mut RenderOptions, [x, z]: [f32; 2], [half, height]: [f32; 2], degrees: f32) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let corner = |[a, b]: [f32; 2], y: f32| {
        let (a, b) = (a * half, b * half);
        [x + cos * a + sin * b, y, z - sin * a + cos * b]
    };
    let around = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    for side in 0..4 {
        let (a, b) = (around[side], around[(side + 1) % 4]);
        quad(options, [corner(a, 0.0), corner(b, 0.0), corner(b, height), corner(a, height)], WHITE, None);
    }
    quad(options, around.map(|at| corner(at, height)), WHITE, None);
}

/// Two triangles. They emit on the side from which their corners go around counter-clockwise.
fn quad(options: &mut RenderOptions, corners: [[f32; 3]; 4], colour: [f32; 3], emission: Option<[f32; 3]>) {
    let kd = Arc::new(ConstantTexture::new(Spectrum::from_rgb(&colour)));
    let sigma = Arc::new(ConstantTexture::new(0.0));
    let matte = Arc::new(Material::Matte(Box::new(MatteMaterial::new(kd, sigma, None))));
    let points = corners.map(|[x, y, z]| Point3f { x, y, z }).to_vec();
    let (to_world, none) = (Transform::default(), MediumInterface::default());
    let (indices, triangles) = (vec![0, 1, 2, 0, 2, 3], 2);
    let mesh = Arc::new(TriangleMesh::new(
        to_world,
        to_world,
        false,
        triangles,
        indices,
        4,
        points,
        vec![],
        vec![],
        vec![],
        None,
        None,
    ));
    for triangle in 0..triangles {
        let shape = Arc::new(Shape::Trngl(Triangle::new(Arc::clone(&mesh), triangle)));
        let light = emission.map(|emission| {
            let (emission, shape) = (Spectrum::from_rgb(&emission), Arc::clone(&shape));
            Arc::new(Light::DiffuseArea(Box::new(DiffuseAreaLight::new(
                &to_world, &none, &emission, 1, shape, false,
            ))))
        });
        options.lights.extend(light.clone());
        let primitive =
            GeometricPrimitive::new(shape, Some(Arc::clone(&matte) as Arc<Material>), light, None);
        options.primitives.push(Arc::new(Primitive::Geometric(Box::new(primitive))));
    }
}
