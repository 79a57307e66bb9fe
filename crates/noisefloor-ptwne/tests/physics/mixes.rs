use crate::kit::{agrees, batch, mean, scene};
use noisefloor_ptwne::{
    Camera, Environment, Material, MaterialId, MaterialOptions, Optics, Ptwne, RenderOptions, Sampling,
    Scene, SceneBuilder, Texture,
};

const CAMERA: Camera =
    Camera { eye: [0.0, 0.0, 4.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], vertical_fov: 20.0 };

/// What fills the picture, in a sky of radiance 1: of a perspective view; of a parallel one, whose rays all have one
/// direction and length; and of a parallel one on a tilted plane.
fn views(fill: impl Fn(&mut SceneBuilder) -> MaterialId) -> [Scene; 3] {
    [(false, 0.0), (true, 0.0), (true, 3.0)].map(|(parallel, tilt)| {
        scene(CAMERA, |b| {
            if parallel {
                b.optics(Optics { parallel_height: Some(2.0), ..Optics::default() }).unwrap();
            }
            let material = fill(b);
            b.parallelogram([-9.0, -9.0, -tilt], [18.0, 0.0, 2.0 * tilt], [0.0, 18.0, 0.0], material, None)
                .unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        })
    })
}

fn red_and_green(b: &mut SceneBuilder) -> [MaterialId; 2] {
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|colour| b.material(Material::diffuse(colour)).unwrap())
}

fn mixed(b: &mut SceneBuilder, [first, second]: [MaterialId; 2], share: f32) -> MaterialId {
    b.mixed_material(first, second, Texture::Colour([share; 3]), MaterialOptions::default()).unwrap()
}

type Build = fn(&mut SceneBuilder) -> MaterialId;

/// A mix, one in the first and one in the second part of another, and one of mixes: the share of green.
const MIXES: [(Build, f64); 5] = [
    (
        |b| {
            let parts = red_and_green(b);
            mixed(b, parts, 0.25)
        },
        0.25,
    ),
    (
        |b| {
            let parts = red_and_green(b);
            mixed(b, parts, 0.75)
        },
        0.75,
    ),
    (
        |b| {
            let parts = red_and_green(b);
            let inner = mixed(b, parts, 0.5);
            mixed(b, [parts[0], inner], 0.5)
        },
        0.25,
    ),
    (
        |b| {
            let parts = red_and_green(b);
            let inner = mixed(b, parts, 0.5);
            mixed(b, [inner, parts[0]], 0.5)
        },
        0.25,
    ),
    (
        |b| {
            let parts = red_and_green(b);
            let inner = mixed(b, parts, 0.125);
            let other = mixed(b, [inner, parts[1]], 0.25);
            mixed(b, [inner, other], 0.5)
        },
        0.125 * 0.875 + 0.125,
    ),
];

/// Points of a sequence share out the parts of a mix, whatever the view and however mixes nest: the first 64 of a
/// pixel have one number in each 64th. The shares of the last mix are no multiples of a 64th, but each colour has at
/// most five intervals of numbers, which end between points.
#[test]
fn mixes_have_their_shares_in_every_view() {
    for (mix, (fill, green)) in MIXES.into_iter().enumerate() {
        for (view, scene) in views(fill).into_iter().enumerate() {
            let mut source = Ptwne::new(scene, 16, 16, RenderOptions::default()).unwrap();
            let tolerance = if mix < 4 { 1e-6 } else { 5.0 / 64.0 };
            for pixel in batch(&mut source, 0, 64) {
                let off = [f64::from(pixel[0]) - (1.0 - green), f64::from(pixel[1]) - green];
                assert!(off.iter().all(|off| off.abs() < tolerance), "mix {mix} in view {view}: {pixel:?}");
            }
        }
    }
}

#[test]
fn independent_samples_and_the_reference_mix_alike() {
    for (fill, green) in MIXES {
        for scene in views(fill) {
            let options = RenderOptions { sampling: Sampling::Independent, ..RenderOptions::default() };
            agrees(mean(scene.clone(), 16, 64, 16, 1, options), green, 1e-6);
            let mut source = Ptwne::new(scene, 8, 8, RenderOptions::default()).unwrap();
            let picture = source.reference().unwrap().pixels;
            let mean = picture.iter().map(|p| f64::from(p[1])).sum::<f64>() / picture.len() as f64;
            assert!((mean - green).abs() < 0.02, "{mean}, expected {green}");
        }
    }
}

/// A sheet of opacity 1/4 stops a quarter of a pixel's rays. Two of 1/2, whose sequences are independent, let a quarter
/// of all pixels' rays pass, and no pixel all or none.
#[test]
fn opacity_has_its_share_in_every_pixel() {
    let sheets = |opacities: &[f32]| {
        scene(CAMERA, |b| {
            b.optics(Optics { parallel_height: Some(2.0), ..Optics::default() }).unwrap();
            for (opacity, z) in opacities.iter().zip([0.0f32, -1.0]) {
                let options =
                    MaterialOptions { opacity: Some([*opacity; 3].into()), ..MaterialOptions::default() };
                let m = b.material_with(Material::diffuse([0.0; 3]), options).unwrap();
                b.parallelogram([-9.0, -9.0, z], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], m, None).unwrap();
            }
            b.environment(Environment::constant([1.0; 3])).unwrap();
        })
    };
    let pixels = |scene| batch(&mut Ptwne::new(scene, 16, 16, RenderOptions::default()).unwrap(), 0, 64);
    assert!(pixels(sheets(&[0.25])).iter().all(|p| p[0] == 0.75));
    let two = pixels(sheets(&[0.5, 0.5]));
    assert!(two.iter().all(|p| (0.03..0.47).contains(&p[0])));
    agrees(mean(sheets(&[0.5, 0.5]), 16, 64, 16, 0, RenderOptions::default()), 0.25, 1e-6);
}
