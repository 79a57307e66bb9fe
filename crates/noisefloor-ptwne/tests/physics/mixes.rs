use crate::kit::{agrees, batch, mean, reference, scene, source};
use noisefloor_ptwne::{
    Camera, Environment, Material, MaterialId, MaterialOptions, Optics, RenderOptions, Sampling, Scene,
    SceneBuilder, Texture,
};

const CAMERA: Camera =
    Camera { eye: [0.0, 0.0, 4.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], vertical_fov: 20.0 };

/// What fills the picture, in a sky of radiance 1: of a perspective view; of a parallel one, whose rays all have one
/// direction and length; and of a parallel one on a tilted plane.
fn views(mixes: Mixes) -> [Scene; 3] {
    [(false, 0.0), (true, 0.0), (true, 3.0)].map(|(parallel, tilt)| {
        scene(CAMERA, |b| {
            if parallel {
                b.optics(Optics { parallel_height: Some(2.0), ..Optics::default() }).unwrap();
            }
            let material = mixed(b, mixes);
            b.parallelogram([-9.0, -9.0, -tilt], [18.0, 0.0, 2.0 * tilt], [0.0, 18.0, 0.0], material, None)
                .unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        })
    })
}

/// The last of some mixes.
fn mixed(b: &mut SceneBuilder, mixes: Mixes) -> MaterialId {
    let plain = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Material::diffuse);
    let mut all = plain.map(|colour| b.material(colour).unwrap()).to_vec();
    for (first, second, share) in mixes {
        let (share, options) = (Texture::Colour([*share; 3]), MaterialOptions::default());
        all.push(b.mixed_material(all[*first], all[*second], share, options).unwrap());
    }
    all[all.len() - 1]
}

/// Mixes of two materials of those before them, by their share of the second, where the first two are red and green.
type Mixes = &'static [(usize, usize, f32)];

/// A mix, one in the first and one in the second part of another, and one of mixes: the share of green.
const MIXES: [(Mixes, f64); 5] = [
    (&[(0, 1, 0.25)], 0.25),
    (&[(0, 1, 0.75)], 0.75),
    (&[(0, 1, 0.5), (0, 2, 0.5)], 0.25),
    (&[(0, 1, 0.5), (2, 0, 0.5)], 0.25),
    (&[(0, 1, 0.125), (2, 1, 0.25), (2, 3, 0.5)], 0.125 * 0.875 + 0.125),
];

/// Points of a sequence share out the parts of a mix, whatever the view and however mixes nest: the first 64 of a
/// pixel have one number in each 64th. The shares of the last mix are no multiples of a 64th, but each colour has at
/// most five intervals of numbers, which end between points.
#[test]
fn mixes_have_their_shares_in_every_view() {
    for (mix, (mixes, green)) in MIXES.into_iter().enumerate() {
        for (view, scene) in views(mixes).into_iter().enumerate() {
            let mut source = source(scene, 16);
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
    for (mixes, green) in MIXES {
        for scene in views(mixes) {
            let options = RenderOptions { sampling: Sampling::Independent, ..RenderOptions::default() };
            agrees(mean(scene.clone(), 16, 64, 16, 1, options), green, 1e-6);
            let mean = reference(scene, 8, 1);
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
    let pixels = |scene| batch(&mut source(scene, 16), 0, 64);
    assert!(pixels(sheets(&[0.25])).iter().all(|p| p[0] == 0.75));
    let two = pixels(sheets(&[0.5, 0.5]));
    assert!(two.iter().all(|p| (0.03..0.47).contains(&p[0])));
    agrees(mean(sheets(&[0.5, 0.5]), 16, 64, 16, 0, RenderOptions::default()), 0.25, 1e-6);
}
