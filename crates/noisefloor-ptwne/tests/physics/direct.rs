//! Direct light in closed form, and the ray-traced reference.

use crate::kit::{agrees, batch, look, mean, reference, scene, source};
use noisefloor_ptwne::{
    Camera, Emission, Environment, EnvironmentMap, Estimator, Falloff, Gloss, ImageTexture, Lobes, Material,
    MaterialId, MaterialOptions, Mesh, Pixels, Ptwne, Punctual, RenderOptions, Scene, SceneBuilder, Sun,
    Texture, scenes,
};

const DIRECT: u32 = 2;

/// A camera that sees a spot around the origin of the plane y = 0.
fn spot() -> Camera {
    look([1.0, 1.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], 0.05)
}

/// A floor of albedo 0.5 and one light.
pub(crate) fn lit(light: impl FnOnce(&mut SceneBuilder, MaterialId)) -> Scene {
    scene(spot(), |b| {
        let grey = b.material(Material::diffuse([0.5; 3])).unwrap();
        let black = b.material(Material::diffuse([0.0; 3])).unwrap();
        b.parallelogram([-9.0, 0.0, -9.0], [0.0, 0.0, 18.0], [18.0, 0.0, 0.0], grey, None).unwrap();
        light(b, black);
    })
}

/// Checks next event estimation and the reference. 2e-3 allows for the spot's size and f32. The reference
/// promises 0.36/255 as displayed, which is at most 0.8 % of a radiance, since the slope of Reinhard's curve
/// and sRGB over the logarithm is at most 0.19. That is 0.2 % for the mean of 16 pixels that see the same.
pub(crate) fn check(scene: &Scene, expected: f64) {
    check_samples(scene, expected);
    let reference = reference(scene.clone(), 4, 0);
    assert!((reference - expected).abs() < 1e-2 * expected, "reference {reference}, expected {expected}");
}

/// Checks next event estimation, with and without scattered rays that hit lights.
fn check_samples(scene: &Scene, expected: f64) {
    for estimator in [Estimator::Mis, Estimator::NextEvents] {
        let options = RenderOptions { estimator, max_depth: DIRECT, ..RenderOptions::default() };
        agrees(mean(scene.clone(), 4, 64, 100, 0, options), expected, 2e-3);
    }
}

/// Checks brute force, for lights so large that at least one path in ten hits them.
fn check_brute_force(scene: &Scene, expected: f64) {
    let options =
        RenderOptions { estimator: Estimator::BruteForce, max_depth: DIRECT, ..RenderOptions::default() };
    agrees(mean(scene.clone(), 4, 64, 200, 0, options), expected, 2e-3);
}

/// Form factor of a parallel rectangle with a corner straight above (Howell's catalogue, C-11); a and b are
/// its edges divided by the distance.
fn corner(a: f64, b: f64) -> f64 {
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / p * (b / p).atan() + b / q * (a / q).atan()) / (2.0 * std::f64::consts::PI)
}

/// Of x −0.5…1.5, z −1…0.5 at height 2: four rectangles with a corner above the origin.
fn panel() -> f64 {
    [(0.25, 0.5), (0.75, 0.5), (0.25, 0.25), (0.75, 0.25)].iter().map(|&(a, b)| corner(a, b)).sum()
}

#[test]
fn a_rectangle_lights_by_its_form_factor() {
    let scene = lit(|b, m| {
        let light = Some(Emission::front([3.0; 3]));
        b.parallelogram([-0.5, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 1.5], m, light).unwrap();
    });
    check(&scene, 0.5 * 3.0 * panel());
    check_brute_force(&scene, 0.5 * 3.0 * panel());
}

#[test]
fn triangles_light_like_the_rectangle_they_make() {
    let positions = [[-0.5, 2.0, -1.0], [1.5, 2.0, -1.0], [1.5, 2.0, 0.5], [-0.5, 2.0, 0.5]];
    let mesh = Mesh { positions: &positions, indices: &[[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
    let scene = lit(|b, m| assert_eq!(b.mesh(&mesh, m, Some(Emission::front([3.0; 3]))), Ok(0)));
    check(&scene, 0.5 * 3.0 * panel());
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

/// ∫ cos cos / πd² over an ellipse, in f64, by midpoint rule over its disk: the form factor from the origin.
fn ellipse(centre: [f64; 3], e1: [f64; 3], e2: [f64; 3], normal: [f64; 3]) -> f64 {
    let n = 400;
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let area = std::f64::consts::PI * (dot(e1, e1) * dot(e2, e2) - dot(e1, e2).powi(2)).sqrt();
    let mut sum = 0.0;
    for i in 0..n * n {
        let r = ((f64::from(i / n) + 0.5) / f64::from(n)).sqrt();
        let (sin, cos) = ((f64::from(i % n) + 0.5) / f64::from(n) * std::f64::consts::TAU).sin_cos();
        let p: [f64; 3] = std::array::from_fn(|k| centre[k] + r * (cos * e1[k] + sin * e2[k]));
        let d2 = dot(p, p);
        sum += p[1] * -dot(p, normal) / (std::f64::consts::PI * d2 * d2);
    }
    sum * area / f64::from(n * n)
}

/// A disc straight above: F = r²/(h² + r²), which also checks the quadrature that ellipses elsewhere are
/// compared with.
#[test]
fn discs_light_by_their_form_factor() {
    let light = || Some(Emission::front([3.0; 3]));
    let round = |r: f32| {
        lit(|b, m| b.disk([0.0, 2.0, 0.0], [[r, 0.0, 0.0], [0.0, 0.0, r]], false, m, light()).unwrap())
    };
    let closed = 0.5 * 3.0 * 0.64 / 4.64;
    let summed = ellipse([0.0, 2.0, 0.0], [0.8, 0.0, 0.0], [0.0, 0.0, 0.8], [0.0, -1.0, 0.0]);
    assert!((0.5 * 3.0 * summed - closed).abs() < 1e-4 * closed);
    check(&round(0.8), closed);
    check_brute_force(&round(0.8), closed);
    check(&round(0.01), 0.5 * 3.0 * 1e-4 / 4.0001);
    let aslant = lit(|b, m| {
        b.disk([0.7, 1.5, -0.4], [[0.6, 0.3, 0.0], [0.0, 0.0, 0.3]], false, m, light()).unwrap();
    });
    // e1 × e2 = (0.09, −0.18, 0)
    let normal = [1.0 / 5f64.sqrt(), -2.0 / 5f64.sqrt(), 0.0];
    check(&aslant, 1.5 * ellipse([0.7, 1.5, -0.4], [0.6, 0.3, 0.0], [0.0, 0.0, 0.3], normal));
}

/// Lights without size: E = I cos θ / d², with glTF's fade for spots; and E = E₀ cos θ from far away.
#[test]
fn punctual_lights_have_no_noise() {
    let (position, down, intensity) = ([1.0, 2.0, -1.0], [0.0, -3.0, 0.0], [5.0; 3]);
    let point = 5.0 / 6.0 * 2.0 / 6f64.sqrt() * 0.5 / std::f64::consts::PI;
    check(&lit(|b, _| b.punctual(Punctual::Point { position, intensity }).unwrap()), point);
    let spot = |inner, outer| {
        let light =
            Punctual::Spot { position, direction: down, intensity, inner, outer, falloff: Falloff::Squared };
        lit(|b, _| b.punctual(light).unwrap())
    };
    // The origin is seen 35.26° off the axis
    let cos = |degrees: f64| degrees.to_radians().cos();
    let fade = (2.0 / 6f64.sqrt() - cos(50.0)) / (cos(20.0) - cos(50.0));
    check(&spot(20.0, 50.0), point * fade * fade);
    check(&spot(40.0, 50.0), point);
    // Outside the cone there is no light, and scattered rays never hit a point
    let by_chance = RenderOptions { estimator: Estimator::BruteForce, ..RenderOptions::default() };
    for (scene, options) in [(spot(10.0, 35.0), RenderOptions::default()), (spot(40.0, 50.0), by_chance)] {
        let mut dark = Ptwne::new(scene, 4, 4, options).unwrap();
        assert_eq!(batch(&mut dark, 0, 16), vec![[0.0; 3]; 16]);
    }
    let distant = Punctual::Distant { direction: [0.5, -1.0, 0.5], irradiance: [2.0; 3] };
    let expected = 2.0 * 0.5 / std::f64::consts::PI / 1.5f64.sqrt();
    check(&lit(|b, _| b.punctual(distant).unwrap()), expected);
}

/// A thousand points and spots, strong and weak, above and below the floor, and parallel light: the sum of
/// each by itself.
#[test]
fn many_lights_add_up() {
    // A spiral of golden angles in a cube around the origin
    let at = |i: usize, step: f64| (i as f64 * step).fract();
    let (mut expected, mut lights) = (0.0, vec![]);
    for i in 0..1000 {
        let position = [0.618_034, 0.754_878, 0.569_840].map(|step| 6.0 * at(i, step) - 3.0);
        let intensity = 10f64.powf(2.0 * at(i, 0.414_214) - 2.0);
        let d2 = position.iter().map(|x| x * x).sum::<f64>();
        let [x, y, z] = position.map(|x| x as f32);
        // Every third is a spot of 60° that shines down
        let spot = i % 3 == 0;
        let down = position[1] / d2.sqrt();
        let fade = if spot { ((down - 0.5) / 0.5).clamp(0.0, 1.0).powi(2) } else { 1.0 };
        expected += intensity * fade * position[1].max(0.0) / d2.powf(1.5);
        let (position, intensity) = ([x, y, z], [intensity as f32; 3]);
        let (direction, inner, outer, falloff) = ([0.0, -1.0, 0.0], 0.0, 60.0, Falloff::Squared);
        lights.push(match spot {
            true => Punctual::Spot { position, direction, intensity, inner, outer, falloff },
            false => Punctual::Point { position, intensity },
        });
    }
    lights.push(Punctual::Distant { direction: [0.5, -1.0, 0.5], irradiance: [2.0; 3] });
    expected += 2.0 / 1.5f64.sqrt();
    let scene = lit(|b, _| lights.iter().for_each(|light| b.punctual(*light).unwrap()));
    check_samples(&scene, 0.5 / std::f64::consts::PI * expected);
}

/// An image of all directions: one bright pixel on grey, and light from one half, against a quadrature of the
/// interpolated image in f64.
#[test]
fn environment_maps_light_by_their_image() {
    let (width, height) = (16usize, 8usize);
    let one = (0..width * height).map(|i| if i == 2 * width + 5 { 200.0 } else { 0.3 });
    let half = (0..width * height).map(|i| if i % width < width / 2 { 1.0 } else { 0.0 });
    for values in [one.collect::<Vec<f64>>(), half.collect()] {
        let at = |x: i64, y: i64| {
            values[y.clamp(0, height as i64 - 1) as usize * width + x.rem_euclid(width as i64) as usize]
        };
        let sub = 32;
        let (columns, rows) = (width * sub, height * sub);
        let mut irradiance = 0.0;
        for i in 0..columns * rows {
            let [u, v] =
                [(i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5].map(|x| x / sub as f64 - 0.5);
            let (x, y) = (u.floor(), v.floor());
            let (fx, fy) = (u - x, v - y);
            let row = |y| at(x as i64, y) * (1.0 - fx) + at(x as i64 + 1, y) * fx;
            let radiance = row(y as i64) * (1.0 - fy) + row(y as i64 + 1) * fy;
            let (sin, cos) = ((v + 0.5) / height as f64 * std::f64::consts::PI).sin_cos();
            irradiance += radiance * cos.max(0.0) * sin;
        }
        irradiance *= 2.0 * std::f64::consts::PI.powi(2) / (columns * rows) as f64;
        let pixels = values.iter().map(|v| [*v as f32; 3]).collect();
        let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let map = EnvironmentMap { width, height, pixels, to_world, poles: false };
        let scene = lit(|b, _| b.environment_map(map).unwrap());
        let expected = 0.5 / std::f64::consts::PI * irradiance;
        check(&scene, expected);
        check_brute_force(&scene, expected);
    }
}

/// Four quarters of radiance 0, 1, 2, 4, each with a corner above the origin.
#[test]
fn textured_lights_shine_by_their_image() {
    let pixels = [0.0, 0.25, 0.5, 1.0].map(|x| [x; 3]);
    let mut image = ImageTexture::new(2, 2, Pixels::Float(pixels.into()));
    image.nearest = true;
    let (positions, uvs) = (
        [[-1.0, 2.0, -1.0], [2.0, 2.0, -1.0], [2.0, 2.0, 0.5], [-1.0, 2.0, 0.5]],
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
    );
    let mesh = Mesh { positions: &positions, uvs: &uvs, indices: &[[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
    let light = Emission { texture: Some(Texture::Image(image)), ..Emission::front([4.0; 3]) };
    let scene = lit(|b, m| assert_eq!(b.mesh(&mesh, m, Some(light)), Ok(0)));
    // The image's middle is x = 0.5, z = −0.25; v = 0, its bottom row, is at z = −1
    let rect = |x: [f64; 2], z: [f64; 2]| {
        let f = |a: f64, b: f64| corner(a.abs() / 2.0, b.abs() / 2.0) * a.signum() * b.signum();
        f(x[1], z[1]) - f(x[0], z[1]) - f(x[1], z[0]) + f(x[0], z[0])
    };
    let ([left, right], [far, near]) = ([[-1.0, 0.5], [0.5, 2.0]], [[-1.0, -0.25], [-0.25, 0.5]]);
    let f = 1.0 * rect(right, near) + 2.0 * rect(left, far) + 4.0 * rect(right, far);
    check(&scene, 0.5 * f);
    check_brute_force(&scene, 0.5 * f);
}

/// A plate between floor and light that stops half of all rays, or is half transparent.
#[test]
fn transparent_surfaces_let_light_through() {
    let with = |opacity: Texture, light: &dyn Fn(&mut SceneBuilder, MaterialId)| {
        lit(|b, m| {
            let options = MaterialOptions { opacity: Some(opacity), ..MaterialOptions::default() };
            let plate = b.material_with(Material::diffuse([0.0; 3]), options).unwrap();
            b.parallelogram([-2.0, 1.5, -2.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0], plate, None).unwrap();
            light(b, m);
        })
    };
    let point = |b: &mut SceneBuilder, _| {
        b.punctual(Punctual::Point { position: [0.5, 2.0, 0.5], intensity: [5.0; 3] }).unwrap();
    };
    let panel = |b: &mut SceneBuilder, m| {
        let light = Some(Emission::front([3.0; 3]));
        b.parallelogram([-1.0, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], m, light).unwrap();
    };
    let whole = (5.0 * 2.0 / 4.5f64.powf(1.5) * 0.5 / std::f64::consts::PI, 1.5 * 4.0 * corner(0.5, 0.5));
    check_samples(&with([0.3, 0.4, 0.5].into(), &point), 0.6 * whole.0);
    check(&with([0.5; 3].into(), &point), 0.5 * whole.0);
    check(&with([0.5; 3].into(), &panel), 0.5 * whole.1);
    // Texture coordinates run in scene units: the left half of four is opaque
    let mut image = ImageTexture::new(2, 1, Pixels::Linear8([[255; 3], [0; 3]].into()));
    (image.nearest, image.to_uv) = (true, [[0.25, 0.0, 0.0], [0.0, 0.25, 0.0]]);
    check(&with(Texture::Image(image.clone()), &panel), 0.5 * whole.1);
    check(&with(Texture::Image(image), &point), whole.0);
}

/// Through two black plates with opacities of 1/3 and 1/2, to a sky of radiance 1.
#[test]
fn transparent_surfaces_are_seen_through() {
    let camera = look([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 20.0);
    let scene = scene(camera, |b| {
        for (z, opacity) in [(0.0, 1.0 / 3.0), (-1.0, 0.5)] {
            let options =
                MaterialOptions { opacity: Some([opacity; 3].into()), ..MaterialOptions::default() };
            let m = b.material_with(Material::diffuse([0.0; 3]), options).unwrap();
            b.parallelogram([-9.0, -9.0, z], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], m, None).unwrap();
        }
        b.environment(Environment::constant([1.0; 3])).unwrap();
    });
    agrees(mean(scene, 16, 64, 16, 0, RenderOptions::default()), 1.0 / 3.0, 1e-6);
}

/// Panels above and below a floor that reflects 0.4 and lets 0.3 through; and a smooth boundary that reflects 0.7 of
/// a sky, since the camera sees it at 72°, where reflection from inside is total.
#[test]
fn lobes_are_lit_from_both_sides() {
    let floor = |lobes: Lobes, light: &dyn Fn(&mut SceneBuilder)| {
        scene(spot(), |b| {
            let m = b.material(lobes.into()).unwrap();
            b.parallelogram([-9.0, 0.0, -9.0], [0.0, 0.0, 18.0], [18.0, 0.0, 0.0], m, None).unwrap();
            light(b);
        })
    };
    let lobes = Lobes { diffuse: [0.4; 3].into(), through: [0.3; 3].into(), ..Lobes::default() };
    let panels = floor(lobes, &|b| {
        let black = b.material(Material::diffuse([0.0; 3])).unwrap();
        for (y, radiance) in [(2.0, 3.0), (-2.0, 5.0)] {
            let light = Some(Emission::two_sided([radiance; 3]));
            b.parallelogram([-1.0, y, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], black, light).unwrap();
        }
    });
    let expected = (0.4 * 3.0 + 0.3 * 5.0) * 4.0 * corner(0.5, 0.5);
    check(&panels, expected);
    check_brute_force(&panels, expected);
    let gloss = Gloss::Dielectric { ior: 1.0 / 1.5 };
    let lobes = Lobes { diffuse: [0.1; 3].into(), mirror: [0.7; 3].into(), gloss, ..Lobes::default() };
    let sky = floor(lobes, &|b| b.environment(Environment::constant([1.0; 3])).unwrap());
    check(&sky, 0.8);
    check_brute_force(&sky, 0.8);
}

/// Through a ball before a sky of radiance 1: rays have to pass two sides, by the opacity that each has
/// where it is met.
#[test]
fn balls_stop_rays_on_both_sides() {
    let ball = |albedo: f32, opacity: Texture, height: f32| {
        let camera = look([0.0, height, 4.0], [0.0, height, 0.0], [0.0, 1.0, 0.0], 2.0);
        scene(camera, |b| {
            let options = MaterialOptions { opacity: Some(opacity), ..MaterialOptions::default() };
            let m = b.material_with(Material::diffuse([albedo; 3]), options).unwrap();
            b.sphere([0.0; 3], 1.0, m, None).unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        })
    };
    let seen = |scene: Scene| {
        let quick = reference(scene.clone(), 16, 1);
        (mean(scene, 16, 64, 16, 0, RenderOptions::default()), quick)
    };
    let (traced, quick) = seen(ball(0.0, [0.4; 3].into(), 0.0));
    agrees(traced, 0.36, 1e-6);
    assert!((quick - 0.36).abs() < 0.01, "{quick}");
    // An albedo of ρ: inside, the radiance is I = ½ + ½ρI, and outside ½ρ + ½I
    let (traced, _) = seen(ball(0.6, [0.5; 3].into(), 0.0));
    agrees(traced, 0.3 + 0.25 / 0.7, 1e-4);
    // The northern half is opaque, the southern is not there
    let mut image = ImageTexture::new(1, 2, Pixels::Linear8([[255; 3], [0; 3]].into()));
    image.nearest = true;
    for (height, expected) in [(0.5, 0.0), (-0.5, 1.0)] {
        let ((traced, _), quick) = seen(ball(0.0, Texture::Image(image.clone()), height));
        assert!((traced - expected).abs() < 1e-6 && (quick - expected).abs() < 1e-6, "{traced} {quick}");
    }
}

#[test]
fn backs_of_one_sided_surfaces_are_black() {
    for (z, expected) in [(4.0, 0.5), (-4.0, 0.0)] {
        let scene = scene(look([0.0, 0.0, z], [0.0; 3], [0.0, 1.0, 0.0], 20.0), |b| {
            let options = MaterialOptions { one_sided: true, ..MaterialOptions::default() };
            let m = b.material_with(Material::diffuse([0.5; 3]), options).unwrap();
            b.parallelogram([-9.0, -9.0, 0.0], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], m, None).unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        });
        let mut source = source(scene, 4);
        let mut all = batch(&mut source, 0, 4);
        all.extend(source.reference().unwrap().pixels);
        assert!(all.iter().flatten().all(|x| (x - expected).abs() < 1e-5), "{all:?}");
    }
}

/// In the Cornell box with direct light only, the path tracer converges to the reference.
#[test]
fn the_reference_is_converged_direct_light() {
    let options = RenderOptions { max_depth: DIRECT, ..RenderOptions::default() };
    let mut source = Ptwne::new(scenes::by_name("cornell-box").unwrap(), 48, 48, options).unwrap();
    let reference = source.reference().unwrap().pixels;
    assert_eq!(reference, source.reference().unwrap().pixels);
    let halves = [batch(&mut source, 0, 512), batch(&mut source, 512, 512)];
    // Leave out the rows of the light itself: it is thirty times brighter than what it lights, and its edges
    // are accurate to 1/16 of a pixel
    let bright: Vec<usize> = (0..48 * 48).filter(|&i| reference[i][1] > 2.0).map(|i| i / 48).collect();
    let (first, last) = (bright[0] - 1, bright[bright.len() - 1] + 1);
    let (mut bias, mut noise, mut total) = (0.0, 0.0, 0.0);
    let (mut signed, mut sum) = (0.0, 0.0);
    for (i, r) in reference.iter().enumerate().filter(|(i, _)| !(first..=last).contains(&(i / 48))) {
        let [a, b] = [&halves[0], &halves[1]].map(|h| f64::from(h[i][1]));
        // E[(a − r)(b − r)] is the squared bias, since the halves are independent
        bias += (a - f64::from(r[1])) * (b - f64::from(r[1]));
        noise += (a - b).powi(2) / 2.0;
        signed += 0.5 * (a + b) - f64::from(r[1]);
        sum += f64::from(r[1]);
        total += f64::from(r[1]).powi(2);
    }
    // At this size, an edge crosses one pixel in six. Sixteen rays find its share of the pixel to about 1/16,
    // and its contrast is at most the picture's: bias² up to 1/6·1/256 = 6.5e-4 of the total. The noise of
    // the product's mean is noise²/√2000 pixels, below 1e-5 of the total
    assert!(bias < 6.5e-4 * total, "bias² {}, noise² {}", bias / total, noise / total);
    assert!(noise / 45.0 < 1e-5 * total);
    // Errors at edges have both signs, so the mean must agree much better. Its standard error is below
    // 1e-3·√noise²/total
    assert!(signed.abs() < 3e-3 * sum, "{signed} of {sum}");
}
