use crate::direct::{check, lit};
use crate::kit::{batch, source};
use noisefloor_ptwne::{Falloff, ImageTexture, Pixels, Profile, Punctual, Texture};

/// Spots that fade in other ways, and projectors, whose picture is red on the side of u.
#[test]
fn spots_and_projectors_keep_their_profiles() {
    let (position, intensity) = ([1.0, 2.0, -1.0], [5.0; 3]);
    let point = 5.0 / 6.0 * 2.0 / 6f64.sqrt() * 0.5 / std::f64::consts::PI;
    // The origin is seen 35.26° off the axis
    let cos = |degrees: f64| degrees.to_radians().cos();
    let x = (2.0 / 6f64.sqrt() - cos(50.0)) / (cos(20.0) - cos(50.0));
    let angle = (2.0 / 6f64.sqrt()).acos().to_degrees();
    for (falloff, fade) in [
        (Falloff::Linear, (50.0 - angle) / 30.0),
        (Falloff::Smooth, x * x * (3.0 - 2.0 * x)),
        (Falloff::Fourth, x.powi(4)),
    ] {
        let direction = [0.0, -1.0, 0.0];
        let spot = Punctual::Spot { position, direction, intensity, inner: 20.0, outer: 50.0, falloff };
        check(&lit(|b, _| b.punctual(spot).unwrap()), point * fade);
    }
    // u runs along −x, on which side the origin is; v along z
    let axes = [[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    let pixels = Pixels::Linear8([[0, 255, 0], [255, 0, 0]].into());
    let picture = Texture::Image(ImageTexture { nearest: true, ..ImageTexture::new(2, 1, pixels) });
    let even = 5.0 / 4.0 * 0.5 / std::f64::consts::PI;
    let inner_outer = |outer| Profile::Spot { inner: 20.0, outer, falloff: Falloff::Squared };
    for (extent, profile, expected) in [
        ([1.0, 1.0], Profile::EvenPlane, even),
        ([0.51, 0.51], Profile::EvenPlane, even),
        ([1.0, 1.0], inner_outer(50.0), point * x * x),
        ([1.0, 0.49], Profile::EvenPlane, 0.0),
        ([0.49, 1.0], Profile::EvenPlane, 0.0),
        ([1.0, 1.0], inner_outer(35.0), 0.0),
    ] {
        let projector = Punctual::Projector { position, axes, extent, intensity, profile };
        let scene = lit(|b, _| b.projector(projector, picture.clone()).unwrap());
        let mut source = source(scene.clone(), 4);
        let pixels = batch(&mut source, 0, 16);
        assert!(pixels.iter().all(|p| p[1] == 0.0 && p[2] == 0.0), "{pixels:?}");
        if expected == 0.0 {
            assert!(pixels.iter().all(|p| p[0] == 0.0), "{pixels:?}");
        } else {
            check(&scene, expected);
        }
    }
}
