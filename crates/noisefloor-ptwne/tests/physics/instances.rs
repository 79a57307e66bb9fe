//! Instances, against copies and against mathematics.

use crate::kit::{UP, agrees, batch, look, mean, scene, source};
use glam::{DAffine3, DMat3, DVec3, EulerRot, Vec3};
use noisefloor::ProgressiveSource;
use noisefloor_ptwne::{
    Emission, Environment, ImageTexture, Material, MaterialId, MaterialOptions, Mesh, Pixels, Ptwne, Relief,
    RenderOptions, Scene, SceneBuilder, SceneError, Texture,
};

fn rows(m: &DAffine3) -> [[f64; 4]; 3] {
    [0, 1, 2].map(|i| [m.matrix3.x_axis[i], m.matrix3.y_axis[i], m.matrix3.z_axis[i], m.translation[i]])
}

fn moved(scale: [f64; 3], turn: f64, at: [f64; 3]) -> DAffine3 {
    let turn = DMat3::from_euler(EulerRot::YXZ, turn, 0.3 * turn, 0.1);
    DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(scale.into()), at.into())
}

/// A bent sheet with a texture, shading normals and colours of corners.
struct Sheet {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colours: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
}

impl Sheet {
    fn new() -> Self {
        let n = 9u32;
        let at = |i: u32| [(i % n) as f32 / 8.0, (i / n) as f32 / 8.0];
        let height = |u: f32, v: f32| 0.2 * (5.0 * u).sin() * (4.0 * v).cos();
        let all: Vec<[f32; 2]> = (0..n * n).map(at).collect();
        let normal = |[u, v]: &[f32; 2]| {
            let (du, dv) =
                (height(u + 1e-3, *v) - height(u - 1e-3, *v), height(*u, v + 1e-3) - height(*u, v - 1e-3));
            Vec3::new(-du * 500.0, -dv * 500.0, 1.0).normalize().to_array()
        };
        let quad = |i: u32| [[i, i + 1, i + n + 1], [i, i + n + 1, i + n]];
        Self {
            positions: all.iter().map(|[u, v]| [2.0 * u - 1.0, 2.0 * v - 1.0, height(*u, *v)]).collect(),
            normals: all.iter().map(normal).collect(),
            colours: all.iter().map(|[u, v]| [0.9, *u, *v]).collect(),
            uvs: all,
            indices: (0..n * (n - 1)).filter(|i| i % n != n - 1).flat_map(quad).collect(),
        }
    }

    /// The sheet moved, with its fronts where they were.
    fn moved(mut self, m: &DAffine3) -> Self {
        let turn = m.matrix3.inverse().transpose();
        for p in &mut self.positions {
            *p = m.transform_point3(Vec3::from(*p).as_dvec3()).as_vec3().to_array();
        }
        for n in &mut self.normals {
            *n = (turn * Vec3::from(*n).as_dvec3()).normalize().as_vec3().to_array();
        }
        if m.matrix3.determinant() < 0.0 {
            self.indices.iter_mut().for_each(|t| t.swap(1, 2));
        }
        self
    }

    fn add(&self, builder: &mut SceneBuilder, smooth: bool, material: MaterialId) {
        let Self { positions, normals, uvs, colours, indices } = self;
        let normals = if smooth { normals.as_slice() } else { &[] };
        builder
            .mesh(&Mesh { positions, normals, uvs, colours, indices, ..Mesh::default() }, material, None)
            .unwrap();
    }
}

/// What the sheets are made of: textured with bumps, opaque; and one-sided, with holes.
fn materials(builder: &mut SceneBuilder) -> [MaterialId; 2] {
    let picture = |linear: bool| {
        let pixels: Vec<[f32; 3]> = (0..64)
            .map(|i| if linear { [(i % 7) as f32 / 7.0; 3] } else { [0.2, (i % 5) as f32 / 5.0, 0.6] })
            .collect();
        Texture::Image(ImageTexture::new(8, 8, Pixels::Float(pixels.into())))
    };
    let bumps = Relief::Heights { map: picture(true), scale: 0.05 };
    let first = MaterialOptions { relief: Some(bumps), ..MaterialOptions::default() };
    let holes =
        MaterialOptions { opacity: Some(picture(true)), one_sided: true, ..MaterialOptions::default() };
    let shiny = Material::RoughConductor { reflectance: picture(false), roughness: 0.4 };
    [(shiny, first), (Material::Diffuse { albedo: Texture::Corners(None) }, holes)]
        .map(|(material, options)| builder.material_with(material, options).unwrap())
}

/// The same thing twice: with instances, and with copies.
fn two_ways(smooth: bool, places: &[DAffine3], ball: bool) -> [Scene; 2] {
    [true, false].map(|shared| {
        scene(look([0.5, 3.0, 9.0], [0.0; 3], UP, 40.0), |b| {
            let sheets = materials(b);
            let grey = b.material(Material::diffuse([0.6, 0.5, 0.4])).unwrap();
            b.parallelogram([-9.0, -2.5, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], grey, None).unwrap();
            b.sphere([3.0, 5.0, 3.0], 0.3, grey, Some(Emission::front([30.0; 3]))).unwrap();
            b.environment(Environment::constant([0.2, 0.3, 0.4])).unwrap();
            let add = |b: &mut SceneBuilder, m: &DAffine3| {
                for (k, sheet) in sheets.into_iter().enumerate() {
                    let inside = DAffine3::from_translation(DVec3::Z * (0.7 * k as f64));
                    Sheet::new().moved(&(*m * inside)).add(b, smooth, sheet);
                }
                if ball {
                    let (at, size) = (m.transform_point3(DVec3::Y).as_vec3(), m.matrix3.x_axis.length());
                    b.sphere(at.to_array(), 0.3 * size as f32, grey, None).unwrap();
                    let at = |p| m.transform_point3(p).as_vec3();
                    let (c, e1, e2) = (at(DVec3::X), at(DVec3::ONE), at(DVec3::new(1.0, -0.5, 1.0)));
                    let edges = [e1 - c, e2 - c].map(|edge| edge.to_array());
                    b.disk(c.to_array(), edges, false, grey, None).unwrap();
                }
            };
            if shared {
                b.begin_object().unwrap();
                add(b, &DAffine3::IDENTITY);
                let object = b.end_object().unwrap();
                places.iter().for_each(|m| b.instance(object, rows(m)).unwrap());
            } else {
                places.iter().for_each(|m| add(b, m));
            }
        })
    })
}

/// A picture with instances is that with copies. Rays meet the same surfaces at the same places but for rounding; a
/// path that it turns elsewhere changes one pixel of one sample. Holes are chosen by random numbers of surfaces,
/// which copies number otherwise: there, means agree within five standard errors.
#[test]
fn instances_look_like_copies() {
    let even = [
        moved([1.0; 3], 0.4, [-1.5, 0.0, 0.0]),
        moved([0.7; 3], 2.5, [1.8, 0.3, -1.0]),
        moved([-1.2, 1.2, 1.2], -0.8, [0.5, -1.0, 2.0]),
    ];
    let stretched =
        [moved([0.5, 1.6, 1.0], 0.4, [-1.5, 0.0, 0.0]), moved([1.0, -0.4, 1.3], 2.0, [1.5, 0.5, 1.0])];
    for (smooth, places, ball) in [(true, even.as_slice(), true), (false, &stretched, false)] {
        let [shared, copied] = two_ways(smooth, places, ball);
        assert_eq!((shared.instances(), copied.instances()), (places.len(), 0));
        let inside = (copied.surfaces() - 2) / places.len();
        assert_eq!(shared.surfaces() - 2, inside);

        let hits = |scene: &Scene| {
            let mut source = source(scene.clone(), 64);
            source.first_hits(0, 1).unwrap().unwrap()
        };
        let (a, b) = (hits(&shared), hits(&copied));
        let same = |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3);
        let alike = a.normal.iter().zip(&b.normal).zip(a.albedo.iter().zip(&b.albedo));
        let alike = alike.filter(|((n, m), (a, b))| same(n, m) && same(a, b)).count();
        // What is seen through the holes differs: 7.6 % of the picture
        assert!(alike > 64 * 64 * 9 / 10, "{alike}");

        for channel in 0..3 {
            let options = RenderOptions { seed: 5, ..RenderOptions::default() };
            let other = RenderOptions { seed: 6, ..options };
            let (a, b) = (
                mean(shared.clone(), 32, 64, 16, channel, options),
                mean(copied.clone(), 32, 64, 16, channel, other),
            );
            agrees((a.0, a.1.hypot(b.1)), b.0, 0.0);
        }
    }
}

/// Without holes, the very same samples agree to rounding, but for those that it turns elsewhere.
#[test]
fn the_same_samples_agree() {
    let places = [
        moved([1.0; 3], 0.4, [-1.5, 0.0, 0.0]),
        moved([-0.7, 0.7, 0.7], 2.5, [1.8, 0.3, -1.0]),
        moved([1.2, 0.5, 1.2], -0.8, [0.5, -1.0, 2.0]),
    ];
    let pictures = [true, false].map(|shared| {
        let scene = scene(look([0.5, 3.0, 9.0], [0.0; 3], UP, 40.0), |b| {
            let m = b.material(Material::diffuse([0.6, 0.5, 0.4])).unwrap();
            b.environment(Environment::constant([0.2, 0.3, 0.4])).unwrap();
            let light = Some(Emission::front([9.0; 3]));
            b.parallelogram([-1.0, 6.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], m, light).unwrap();
            if shared {
                b.begin_object().unwrap();
                Sheet::new().add(b, false, m);
                let object = b.end_object().unwrap();
                places.iter().for_each(|place| b.instance(object, rows(place)).unwrap());
            } else {
                places.iter().for_each(|place| Sheet::new().moved(place).add(b, false, m));
            }
        });
        let mut source = source(scene, 48);
        batch(&mut source, 0, 4)
    });
    let [a, b] = &pictures;
    let close =
        a.iter().zip(b).filter(|(a, b)| a.iter().zip(*b).all(|(a, b)| (a - b).abs() <= 1e-3 * b.max(0.01)));
    let close = close.count();
    assert!(close > 48 * 48 * 999 / 1000, "{close} of {}", a.len());
}

/// A sphere that an instance stretches is an ellipsoid: x²/a² + y²/b² + z²/c² = 1 has its normal along (x/a², y/b²,
/// z/c²).
#[test]
fn stretched_spheres_are_ellipsoids() {
    let axes = DVec3::new(2.0, 0.5, 0.05);
    let turn = DMat3::from_euler(EulerRot::XYZ, 0.5, -0.4, 1.0);
    let middle = DVec3::new(30.0, -20.0, 10.0);
    for k in 0..40 {
        let (z, angle) = (2.0 * (f64::from(k) + 0.5) / 40.0 - 1.0, 2.4 * f64::from(k));
        let on_ball = DVec3::new((1.0 - z * z).sqrt() * angle.cos(), (1.0 - z * z).sqrt() * angle.sin(), z);
        let (point, normal) = (middle + turn * (axes * on_ball), (turn * (on_ball / axes)).normalize());
        let eye = point + normal * 5.0;
        let up = if normal.y.abs() < 0.9 { UP } else { [1.0, 0.0, 0.0] };
        let camera = look(eye.as_vec3().to_array(), point.as_vec3().to_array(), up, 0.001);
        let scene = scene(camera, |b| {
            let m = b.material(Material::diffuse([0.5; 3])).unwrap();
            b.begin_object().unwrap();
            b.sphere([7.0, 8.0, 9.0], 2.0, m, None).unwrap();
            let object = b.end_object().unwrap();
            let unit = DAffine3::from_scale(DVec3::splat(0.5))
                * DAffine3::from_translation(-DVec3::new(7.0, 8.0, 9.0));
            let matrix = DAffine3::from_mat3_translation(turn * DMat3::from_diagonal(axes), middle) * unit;
            b.instance(object, rows(&matrix)).unwrap();
        });
        assert_eq!((scene.surfaces(), scene.instances()), (1, 1));
        let seen = source(scene, 1).first_hits(0, 16).unwrap().unwrap();
        let off = (Vec3::from(seen.normal[0]).as_dvec3() - normal).length();
        assert!(off < 1e-3, "{k}: {:?}, not {normal}", seen.normal[0]);
    }
}

/// Convex bodies that reflect all of a uniform sky show it after one reflection, whatever the size of an instance and
/// of its object's coordinates: no ray meets the surface that it leaves, and none comes through it.
#[test]
fn rays_leave_instances_of_all_sizes() {
    for (size, inside, at) in [
        (1.0, 1e-4, [0.0; 3]),
        (1.0, 1e5, [0.0; 3]),
        (1e-3, 1.0, [900.0, -700.0, 300.0]),
        (1e4, 1.0, [9e4, 1e5, -5e4]),
        (1e5, 1e-3, [0.0; 3]),
    ] {
        for stretch in [[1.0; 3], [1.0, 0.01, 0.3]] {
            let at = DVec3::from(at);
            let eye = at + DVec3::new(1.0, 2.0, 4.0) * size;
            let camera = look(eye.as_vec3().to_array(), at.as_vec3().to_array(), UP, 35.0);
            let scene = scene(camera, |b| {
                let m = b.material(Material::diffuse([1.0; 3])).unwrap();
                b.environment(Environment::constant([1.0; 3])).unwrap();
                b.begin_object().unwrap();
                let (low, edge) = (-0.5 * inside as f32, inside as f32);
                let (x, y, z) = ([edge, 0.0, 0.0], [0.0, edge, 0.0], [0.0, 0.0, edge]);
                for (e1, e2, far) in [(x, y, z), (y, z, x), (z, x, y)] {
                    b.parallelogram([low; 3], e1, e2, m, None).unwrap();
                    b.parallelogram(far.map(|e| low + e), e1, e2, m, None).unwrap();
                }
                let object = b.end_object().unwrap();
                let matrix = moved(stretch.map(|s| s * size / inside), 0.7, at.to_array());
                b.instance(object, rows(&matrix)).unwrap();
            });
            // Paths that would need a third segment end, and what they lack shows
            let options = RenderOptions { max_depth: 2, roulette: 1000, ..RenderOptions::default() };
            let mut source = Ptwne::new(scene, 32, 32, options).unwrap();
            let pixels = batch(&mut source, 0, 64);
            // A sky of one colour is no light that is sampled: all samples are 1, up to rounding
            let worst = pixels.iter().map(|p| (p[0] - 1.0).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-5, "{size} {inside} {stretch:?}: {worst}");
        }
    }
}

/// Two instances of a surface that lets half of the light pass let a quarter pass: each decides for itself.
#[test]
fn instances_are_transparent_independently() {
    let scene = scene(look([0.0, 0.0, 5.0], [0.0; 3], UP, 1.0), |b| {
        let half = MaterialOptions { opacity: Some([0.5; 3].into()), ..MaterialOptions::default() };
        let black = b.material_with(Material::diffuse([0.0; 3]), half).unwrap();
        b.environment(Environment::constant([1.0; 3])).unwrap();
        b.begin_object().unwrap();
        b.parallelogram([-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], black, None).unwrap();
        let object = b.end_object().unwrap();
        for z in [0.0, 1.0] {
            b.instance(object, rows(&DAffine3::from_translation(DVec3::Z * z))).unwrap();
        }
    });
    assert!(scene.has_opacity());
    agrees(mean(scene, 8, 64, 64, 0, RenderOptions::default()), 0.25, 1e-6);
}

/// A thousand instances take a matrix each, and a share of the hierarchy over them.
#[test]
fn memory_is_shared() {
    let bytes = |instances: usize| {
        let scene = scene(look([0.0, 0.0, 50.0], [0.0; 3], UP, 40.0), |b| {
            let m = b.material(Material::diffuse([0.5; 3])).unwrap();
            b.begin_object().unwrap();
            Sheet::new().add(b, true, m);
            let object = b.end_object().unwrap();
            for i in 0..instances {
                let at = DVec3::new((i % 32) as f64, (i / 32) as f64, 0.0) * 3.0;
                b.instance(object, rows(&DAffine3::from_translation(at))).unwrap();
            }
        });
        assert_eq!((scene.surfaces(), scene.instances()), (128, instances));
        scene.geometry_bytes()
    };
    let (one, thousand) = (bytes(1), bytes(1000));
    // 88 bytes of matrices, and nodes of 224 bytes of which each has at least two children
    assert!(thousand - one < 1000 * (88 + 224), "{one} {thousand}");
    assert!(one > 128 * 50, "{one}");
}

#[test]
fn what_cannot_be_shown_is_an_error() {
    let mut b = SceneBuilder::new("test", look([0.0, 0.0, 5.0], [0.0; 3], UP, 40.0)).unwrap();
    let m = b.material(Material::diffuse([0.5; 3])).unwrap();
    assert!(matches!(b.end_object(), Err(SceneError::Object(_))));
    b.begin_object().unwrap();
    assert!(matches!(b.begin_object(), Err(SceneError::Object(_))));
    let lamp = b.sphere([0.0; 3], 1.0, m, Some(Emission::front([1.0; 3])));
    assert!(matches!(lamp, Err(SceneError::Object(_))));
    b.sphere([0.0; 3], 1.0, m, None).unwrap();
    let unended = b.clone();
    assert!(matches!(unended.build(), Err(SceneError::Object(_))));
    let object = b.end_object().unwrap();

    let flat = moved([1.0, 0.0, 1.0], 0.5, [0.0; 3]);
    assert_eq!(b.instance(object, rows(&flat)), Err(SceneError::Singular));
    let far = moved([1.0; 3], 0.5, [2e8, 0.0, 0.0]);
    assert!(matches!(b.instance(object, rows(&far)), Err(SceneError::Range { .. })));
    let nan = [[f64::NAN; 4]; 3];
    assert!(matches!(b.instance(object, nan), Err(SceneError::NotFinite { .. })));
    let mut other = SceneBuilder::new("other", look([0.0, 0.0, 5.0], [0.0; 3], UP, 40.0)).unwrap();
    assert!(matches!(other.instance(object, rows(&DAffine3::IDENTITY)), Err(SceneError::Object(_))));

    // An object of nothing can be shown, and is not there
    b.begin_object().unwrap();
    let empty = b.end_object().unwrap();
    b.instance(empty, rows(&DAffine3::IDENTITY)).unwrap();
    let scene = b.build().unwrap();
    assert_eq!((scene.surfaces(), scene.instances()), (1, 0));
}
