//! Normal maps, bumps, coats and colours of corners, in closed form.

use crate::kit::{UP, agrees, batch, look, mean, scene};
use noisefloor::Rgb;
use noisefloor_ptwne::{
    Camera, Emission, Environment, ImageTexture, Material, MaterialOptions, Mesh, Pixels, Ptwne, Punctual,
    Relief, RenderOptions, Scene, SceneBuilder, Texture, Wrap,
};
use std::f32::consts::PI;

fn with(relief: Option<Relief>) -> MaterialOptions {
    MaterialOptions { relief, ..MaterialOptions::default() }
}

/// Normals of one direction in the frame of u, v and the normal.
fn normals(n: [f32; 3]) -> Option<Relief> {
    Some(Relief::Normals { map: Texture::Colour(n.map(|x| 0.5 + 0.5 * x)), scale: 1.0, mirrors: false })
}

/// A floor from −9 to 9 whose u runs along +x and whose v runs along −z, so that its front is up.
fn floor(b: &mut SceneBuilder, material: Material, relief: Option<Relief>) {
    let m = b.material_with(material, with(relief)).unwrap();
    b.parallelogram([-9.0, 0.0, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], m, None).unwrap();
}

/// Seen from above, almost straight down, in a narrow view.
fn above() -> Camera {
    look([0.0, 4.0, 0.01], [0.0; 3], [0.0, 0.0, -1.0], 0.5)
}

fn picture(scene: Scene, spp: u64) -> Vec<Rgb> {
    let options = RenderOptions { seed: 4, ..RenderOptions::default() };
    batch(&mut Ptwne::new(scene, 8, 8, options).unwrap(), 0, spp)
}

#[test]
fn a_map_of_the_normal_itself_changes_nothing() {
    let materials = [
        Material::diffuse([0.7, 0.5, 0.3]),
        Material::RoughConductor { reflectance: [0.9; 3].into(), roughness: 0.3 },
        Material::MetallicRoughness {
            base: [0.5; 3].into(),
            metallic_roughness: [1.0, 0.4, 0.5].into(),
            ior: 1.5,
        },
        Material::Glass { ior: 1.5, tint: [1.0; 3] },
        Material::RoughGlass { ior: 1.5, tint: [1.0; 3], roughness: 0.2 },
        Material::Mirror { reflectance: [0.8; 3] },
    ];
    for material in materials {
        let with = |relief: Option<Relief>| {
            let scene = scene(look([3.0, 3.0, 5.0], [0.0, 0.5, 0.0], UP, 40.0), |b| {
                floor(b, Material::diffuse([0.5; 3]), relief.clone());
                let m = b.material_with(material.clone(), self::with(relief)).unwrap();
                b.sphere([0.0, 1.0, 0.0], 1.0, m, None).unwrap();
                b.disk([2.0, 0.5, 0.0], [[0.5, 0.0, 0.0], [0.0, 0.5, 0.2]], false, m, None).unwrap();
                let light = b.material(Material::diffuse([0.0; 3])).unwrap();
                b.sphere([2.0, 5.0, 2.0], 0.5, light, Some(Emission::front([20.0; 3]))).unwrap();
                b.environment(Environment::constant([0.2; 3])).unwrap();
            });
            picture(scene, 8)
        };
        let flat = Relief::Heights { map: Texture::Colour([0.3; 3]), scale: 2.0 };
        assert_eq!(with(None), with(normals([0.0, 0.0, 1.0])), "{material:?}");
        assert_eq!(with(None), with(Some(flat)), "{material:?}");
    }
}

/// Lambert's law of the turned normal, for light from one direction: ρ/π·E·n·l.
#[test]
fn turned_normals_reflect_as_turned_planes() {
    let to_light = [0.48, 0.8, 0.36];
    for n in [[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.36, 0.48, 0.8], [0.0, -0.28, 0.96]] {
        // u is +x, v is −z, the normal +y
        let world: [f32; 3] = [n[0], n[2], -n[1]];
        let cos: f32 = world.iter().zip(to_light).map(|(a, b)| a * b).sum();
        let lit = |b: &mut SceneBuilder| {
            let direction = to_light.map(|x: f32| -x);
            b.punctual(Punctual::Distant { direction, irradiance: [2.0; 3] }).unwrap();
        };
        let relieved = picture(
            scene(above(), |b| {
                floor(b, Material::diffuse([0.6; 3]), normals(n));
                lit(b);
            }),
            1,
        );
        // A small plane that is really turned
        let turned = picture(
            scene(above(), |b| {
                let m = b.material(Material::diffuse([0.6; 3])).unwrap();
                let [x, y, z] = world;
                // Two edges across it: (y, −x, 0) and (0, −z, y), counter-clockwise as seen from where it points
                b.parallelogram([-0.5 * y, 0.5 * (x + z), -0.5 * y], [0.0, -z, y], [y, -x, 0.0], m, None)
                    .unwrap();
                lit(b);
            }),
            1,
        );
        let expected = 0.6 / PI * 2.0 * cos.max(0.0);
        for (a, b) in relieved.iter().zip(&turned) {
            assert!((a[0] - expected).abs() < 1e-4 * expected, "{n:?}: {a:?}, {expected}");
            assert!((b[0] - expected).abs() < 1e-4 * expected, "{n:?}: {b:?}, {expected}");
        }
    }
}

/// Bumps are slopes of the surface: of a ramp, a tilted plane. Mirrored texture coordinates change nothing.
#[test]
fn bumps_reflect_as_slopes() {
    let ramp: Vec<Rgb> = (0..64).map(|i| [(i as f32 + 0.5) / 64.0; 3]).collect();
    let map = ImageTexture { wrap: [Wrap::Clamp; 2], ..ImageTexture::new(64, 1, Pixels::Float(ramp.into())) };
    // 4.5 higher over the 18 units of the floor: a slope of 1/4 along +x
    let map = Texture::Image(map);
    let positions = [[-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0], [-9.0, 0.0, -9.0]];
    for uvs in
        [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]]
    {
        let relief = Some(Relief::Heights { map: map.clone(), scale: 4.5 });
        let pixels = picture(
            scene(above(), |b| {
                let m = b.material_with(Material::diffuse([0.5; 3]), with(relief)).unwrap();
                let indices = [[0, 1, 2], [0, 2, 3]];
                let mesh = Mesh { positions: &positions, uvs: &uvs, indices: &indices, ..Mesh::default() };
                b.mesh(&mesh, m, None).unwrap();
                let direction = [1.0, -1.0, 0.0];
                b.punctual(Punctual::Distant { direction, irradiance: [1.0; 3] }).unwrap();
            }),
            1,
        );
        // n = (−1, 4, 0)/√17, l = (−1, 1, 0)/√2
        let expected = 0.5 / PI * 5.0 / 34f32.sqrt();
        for p in pixels {
            assert!((p[0] - expected).abs() < 1e-3 * expected, "{p:?}, expected {expected}");
        }
    }
}

/// Under a white sky, a diffuse surface whose normal is turned by θ keeps of its cosine-weighted hemisphere what
/// lies above the geometric plane: (1 + cos θ)/2. No light comes through from below.
#[test]
fn turned_normals_lose_what_lies_below_the_surface() {
    for n in [[0.6, 0.0, 0.8], [0.0, 0.8, 0.6]] {
        let scene = scene(above(), |b| {
            floor(b, Material::diffuse([1.0; 3]), normals(n));
            b.environment(Environment::constant([1.0; 3])).unwrap();
        });
        agrees(mean(scene, 4, 64, 100, 1, RenderOptions::default()), f64::from(0.5 * (1.0 + n[2])), 1e-3);
    }
}

/// A mirror with normals at random is as bright as its sky, from any angle: no reflection ends in the surface, and
/// none comes through it from the black lamp-lit side below.
#[test]
fn mirrors_with_relief_have_no_black_pixels() {
    let mut state = 1u32;
    let mut number = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let pixels: Vec<Rgb> = (0..256).map(|_| [number(), number(), 0.5 + 0.5 * number()]).collect();
    let map = Texture::Image(ImageTexture::new(16, 16, Pixels::Float(pixels.into())));
    let polished = Material::RoughConductor { reflectance: [1.0; 3].into(), roughness: 0.0 };
    for (height, material) in [(4.0, polished.clone()), (0.3, polished), (0.3, Material::diffuse([1.0; 3]))] {
        let shiny = material != Material::diffuse([1.0; 3]);
        let relief = Relief::Normals { map: map.clone(), scale: 1.0, mirrors: false };
        let scene = scene(look([0.0, height, 4.0], [0.0; 3], UP, 4.0), |b| {
            floor(b, material, Some(relief));
            // What leaks through from below would be bright
            let lamp = b.material(Material::diffuse([0.0; 3])).unwrap();
            let light = Some(Emission::two_sided([1000.0; 3]));
            b.parallelogram([-9.0, -1.0, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], lamp, light).unwrap();
            b.environment(Environment { ground: [0.0; 3], ..Environment::constant([1.0; 3]) }).unwrap();
        });
        for p in picture(scene, 64) {
            assert!(p[1] < 1.0001 && p[1] > if shiny { 0.999 } else { 0.3 }, "at {height}: {p:?}");
        }
    }
}

/// A white coat over black, head on and at an angle: Schlick's term.
#[test]
fn coats_reflect_by_schlicks_term() {
    for (degrees, share) in [(0.1f32, 1.0), (60.0, 1.0), (60.0, 0.5), (80.0, 1.0)] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let camera = look([4.0 * sin, 4.0 * cos, 0.0], [0.0; 3], [0.0, 0.1, 1.0], 0.5);
        let scene = scene(camera, |b| {
            let base = b.material(Material::diffuse([0.0; 3])).unwrap();
            let film = Material::RoughConductor { reflectance: [1.0; 3].into(), roughness: 0.0 };
            let film = b.material(film).unwrap();
            let coated =
                b.coated_material(base, film, [share; 3].into(), MaterialOptions::default()).unwrap();
            b.parallelogram([-9.0, 0.0, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], coated, None).unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        });
        let expected = f64::from(share) * (0.04 + 0.96 * f64::from(1.0 - cos).powi(5));
        // 0.5° of view
        agrees(mean(scene, 8, 64, 400, 1, RenderOptions::default()), expected, 6e-3);
    }
}

#[test]
fn colours_of_corners_are_interpolated() {
    let positions = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    // Red grows along x, green towards −z
    let colours = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 1.0, 0.5], [0.0, 1.0, 0.5]];
    let camera = look([0.0, 4.0, 0.0], [0.0; 3], [0.0, 0.0, -1.0], 2.0 * (0.25f32).atan().to_degrees());
    for (texture, factor) in
        [(Texture::Corners(None), 1.0), (Texture::Corners(Some(Box::new([0.5; 3].into()))), 0.5)]
    {
        let scene = scene(camera, |b| {
            let m = b.material(Material::Diffuse { albedo: texture }).unwrap();
            let indices = [[0, 1, 2], [0, 2, 3]];
            let mesh =
                Mesh { positions: &positions, colours: &colours, indices: &indices, ..Mesh::default() };
            b.mesh(&mesh, m, None).unwrap();
            b.punctual(Punctual::Distant { direction: [0.0, -1.0, 0.0], irradiance: [PI; 3] }).unwrap();
        });
        for (i, p) in picture(scene, 64).iter().enumerate() {
            let at = |k: usize| (k as f32 + 0.5) / 8.0;
            let expected = [factor * at(i % 8), factor * (1.0 - at(i / 8)), factor * 0.5];
            let close = p.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.02);
            assert!(close, "pixel {i}: {p:?}, expected {expected:?}");
        }
    }
}

#[test]
fn what_is_out_of_range_is_refused() {
    let mut b = SceneBuilder::new("test", above()).unwrap();
    for scale in [f32::NAN, 2e6] {
        let relief = Relief::Heights { map: [0.5; 3].into(), scale };
        assert!(b.material_with(Material::diffuse([0.5; 3]), with(Some(relief))).is_err());
    }
    let relief = Relief::Normals { map: [2.0; 3].into(), scale: 1.0, mirrors: true };
    assert!(b.material_with(Material::diffuse([0.5; 3]), with(Some(relief))).is_err());
    let m = b.material(Material::diffuse([0.5; 3])).unwrap();
    let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for colours in [vec![[0.5; 3]; 2], vec![[1.5; 3]; 3], vec![[f32::NAN; 3]; 3]] {
        let mesh =
            Mesh { positions: &positions, colours: &colours, indices: &[[0, 1, 2]], ..Mesh::default() };
        assert!(b.mesh(&mesh, m, None).is_err(), "{colours:?}");
    }
}
