//! Direct light in closed form, and the ray-traced reference.

use crate::kit::{agrees, batch, look, mean, scene};
use noisefloor::ProgressiveSource;
use noisefloor_ptwne::{Camera, Emission, Environment, Material, Options, Ptwne, Scene, Sun, scenes};

const DIRECT: u32 = 2;

/// A camera that sees a spot around the origin of the plane y = 0.
fn spot() -> Camera {
    look([1.0, 1.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 0.05)
}

/// A floor of albedo 0.5 and one light.
fn lit(light: impl FnOnce(&mut noisefloor_ptwne::SceneBuilder, noisefloor_ptwne::MaterialId)) -> Scene {
    scene(spot(), |b| {
        let grey = b.material(Material::diffuse([0.5; 3])).unwrap();
        let black = b.material(Material::diffuse([0.0; 3])).unwrap();
        b.parallelogram([-9.0, 0.0, -9.0], [0.0, 0.0, 18.0], [18.0, 0.0, 0.0], grey, None).unwrap();
        light(b, black);
    })
}

/// Checks both estimators and the reference. The spot's size and f32 are good for 2e-3, the quadrature for 1e-2.
fn check(scene: &Scene, expected: f64) {
    for mis in [true, false] {
        let options = Options { mis, max_depth: DIRECT, ..Options::default() };
        agrees(mean(scene.clone(), 4, 64, 100, 0, options), expected, 2e-3);
    }
    let mut source = Ptwne::new(scene.clone(), 4, 4, Options::default()).unwrap();
    let reference = f64::from(source.reference().unwrap().unwrap().pixels[5][0]);
    assert!((reference - expected).abs() < 1e-2 * expected, "reference {reference}, expected {expected}");
}

/// Form factor of a parallel rectangle with a corner straight above (Howell's catalogue, C-11): a, b are its edges over the
/// distance.
fn corner(a: f64, b: f64) -> f64 {
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / p * (b / p).atan() + b / q * (a / q).atan()) / (2.0 * std::f64::consts::PI)
}

#[test]
fn a_rectangle_lights_by_its_form_factor() {
    // x −0.5…1.5, z −1…0.5 at height 2: four rectangles with a corner above the origin
    let scene = lit(|b, m| {
        b.parallelogram(
            [-0.5, 2.0, -1.0],
            [2.0, 0.0, 0.0],
            [0.0, 0.0, 1.5],
            m,
            Some(Emission::front([3.0; 3])),
        )
        .unwrap();
    });
    let f: f64 =
        [(0.25, 0.5), (0.75, 0.5), (0.25, 0.25), (0.75, 0.25)].iter().map(|&(a, b)| corner(a, b)).sum();
    check(&scene, 0.5 * 3.0 * f);
}

#[test]
fn triangles_light_like_the_rectangle_they_make() {
    let positions = [[-0.5, 2.0, -1.0], [1.5, 2.0, -1.0], [1.5, 2.0, 0.5], [-0.5, 2.0, 0.5]];
    let mesh = noisefloor_ptwne::Mesh {
        positions: &positions,
        indices: &[[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    };
    let scene = lit(|b, m| assert_eq!(b.mesh(&mesh, m, Some(Emission::front([3.0; 3]))), Ok(0)));
    let f: f64 =
        [(0.25, 0.5), (0.75, 0.5), (0.25, 0.25), (0.75, 0.25)].iter().map(|&(a, b)| corner(a, b)).sum();
    check(&scene, 0.5 * 3.0 * f);
}

/// A ball of radius r at distance d wholly above the horizon: E = πL (r/d)² cos θ.
#[test]
fn a_ball_lights_by_its_projected_solid_angle() {
    for (radius, radiance) in [(0.8f32, 2.0f32), (0.01, 5e4), (1e-6, 1e12)] {
        let scene =
            lit(|b, m| b.sphere([1.0, 2.0, -1.0], radius, m, Some(Emission::front([radiance; 3]))).unwrap());
        let expected = 0.5 * f64::from(radiance) * f64::from(radius).powi(2) / 6.0 * 2.0 / 6f64.sqrt();
        check(&scene, expected);
    }
}

/// The sun: a cone of half angle r, E = πL sin² r cos θ.
#[test]
fn the_sun_lights_by_its_projected_solid_angle() {
    let direction = [0.3, 0.8, -0.2];
    let sun = Sun { direction, angular_radius: 2.0, radiance: [100.0; 3] };
    let dark = Environment::constant([0.0; 3]);
    let scene = lit(|b, _| b.environment(Environment { sun: Some(sun), ..dark }).unwrap());
    let cos = 0.8 / (0.77f64).sqrt();
    check(&scene, 0.5 * 100.0 * 2f64.to_radians().sin().powi(2) * cos);
}

/// In the Cornell box, cut to direct light, the reference is what the path tracer converges to.
#[test]
fn the_reference_is_converged_direct_light() {
    let options = Options { max_depth: DIRECT, ..Options::default() };
    let mut source = Ptwne::new(scenes::by_name("cornell-box").unwrap(), 48, 48, options).unwrap();
    let reference = source.reference().unwrap().unwrap().pixels;
    assert_eq!(reference, source.reference().unwrap().unwrap().pixels);
    let halves = [batch(&mut source, 0, 512), batch(&mut source, 512, 512)];
    // Leave out the rows of the light itself: it is thirty times brighter than what it lights, and its edges come in steps
    // of 1/16 of a pixel
    let bright: Vec<usize> = (0..48 * 48).filter(|&i| reference[i][1] > 2.0).map(|i| i / 48).collect();
    let (first, last) = (bright[0] - 1, bright[bright.len() - 1] + 1);
    let (mut bias, mut noise, mut total) = (0.0, 0.0, 0.0);
    let (mut signed, mut sum) = (0.0, 0.0);
    for (i, r) in reference.iter().enumerate().filter(|(i, _)| !(first..=last).contains(&(i / 48))) {
        let [a, b] = [&halves[0], &halves[1]].map(|h| f64::from(h[i][1]));
        // E[(a − r)(b − r)] is the squared bias alone, as the halves are independent
        bias += (a - f64::from(r[1])) * (b - f64::from(r[1]));
        noise += (a - b).powi(2) / 2.0;
        signed += 0.5 * (a + b) - f64::from(r[1]);
        sum += f64::from(r[1]);
        total += f64::from(r[1]).powi(2);
    }
    // An edge goes through one pixel in six at this size; sixteen rays find its share of the pixel to about 1/16, and the
    // contrast is at most the picture's: bias² up to 1/6·1/256 = 6.5e-4 of the total. The noise of the product's mean is
    // noise²/√2000 pixels, below 1e-5 of the total
    assert!(bias < 6.5e-4 * total, "bias² {}, noise² {}", bias / total, noise / total);
    assert!(noise / 45.0 < 1e-5 * total);
    // Errors at edges have both signs: the mean must agree much better. Its standard error is below 1e-3·√noise²/total
    assert!(signed.abs() < 3e-3 * sum, "{signed} of {sum}");
}
