//! Two balls on a large one, under a lamp.

use rust_pathtracer::prelude::{
    AnalyticalLight, Camera3D, F, F3, LightSampleRec, Pinhole, Ray, Scene, State,
};
use std::any::Any;

/// Centre, radius, colour.
const BALLS: [([F; 3], F, [F; 3]); 3] = [
    ([0.0, -101.0, 0.0], 100.0, [0.7, 0.7, 0.68]),
    ([-0.9, -0.2, 0.0], 0.8, [0.75, 0.25, 0.2]),
    ([0.9, -0.4, 0.5], 0.6, [0.25, 0.4, 0.7]),
];

/// The scene.
pub(crate) struct Spheres {
    camera: Box<dyn Camera3D>,
    lights: Vec<AnalyticalLight>,
}

impl Default for Spheres {
    fn default() -> Self {
        let mut camera = Box::new(Pinhole::new());
        camera.set(F3::new(0.0, 1.0, 4.0), F3::new(0.0, -0.3, 0.0));
        camera.set_fov(50.0);
        let lamp = AnalyticalLight::spherical(F3::new(2.0, 3.5, 2.0), 0.8, F3::new(9.0, 8.0, 7.0));
        Self { camera, lights: vec![lamp] }
    }
}

/// Where a ray meets a ball.
fn meet(ray: &Ray, centre: [F; 3], radius: F) -> Option<F> {
    let [x, y, z] = centre;
    let to = ray.origin - F3::new(x, y, z);
    let b = to.dot(&ray.direction);
    let root = (b * b - to.dot(&to) + radius * radius).sqrt(); // NaN where it passes by
    [-b - root, -b + root].into_iter().find(|&t| t > 1e-3)
}

impl Scene for Spheres {
    fn new() -> Self {
        Self::default()
    }

    fn background(&self, _: &Ray) -> F3 {
        F3::new(0.1, 0.12, 0.15)
    }

    fn closest_hit(&self, ray: &Ray, state: &mut State, light: &mut LightSampleRec) -> bool {
        state.hit_dist = F::MAX;
        for (centre, radius, [r, g, b]) in BALLS {
            let Some(distance) = meet(ray, centre, radius).filter(|&t| t < state.hit_dist) else { continue };
            let [x, y, z] = centre;
            state.hit_dist = distance;
            state.normal = (ray.at(&distance) - F3::new(x, y, z)).normalize();
            state.material.rgb = F3::new(r, g, b);
            state.material.roughness = 1.0;
        }
        let found = state.hit_dist < F::MAX;
        self.sample_lights(ray, state, light, &self.lights) || found
    }

    fn any_hit(&self, ray: &Ray, within: F) -> bool {
        BALLS.iter().any(|&(centre, radius, _)| meet(ray, centre, radius).is_some_and(|t| t < within))
    }

    fn camera(&self) -> &Box<dyn Camera3D> {
        &self.camera
    }

    fn number_of_lights(&self) -> usize {
        self.lights.len()
    }

    fn light_at(&self, index: usize) -> &AnalyticalLight {
        &self.lights[index]
    }

    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
}
