//! rs_pbrt behind [`ProgressiveSource`]: path tracing pixel by pixel, and bidirectional path tracing of whole
//! pictures.

use noisefloor::{Batch, ProgressiveSource, Repeats, Request, Rgb, SourceError, SourceInfo, Tile};
use rayon::prelude::*;
use rs_pbrt::core::api::RenderOptions;
use rs_pbrt::core::camera::Camera;
use rs_pbrt::core::geometry::{Point2f, Point2i, Ray};
use rs_pbrt::core::integrator::{Integrator, SamplerIntegrator};
use rs_pbrt::core::lightdistrib::create_light_sample_distribution;
use rs_pbrt::core::pbrt::Spectrum;
use rs_pbrt::core::sampler::Sampler;
use rs_pbrt::core::scene::Scene;
use rs_pbrt::integrators::bdpt::{
    BDPTIntegrator, Vertex, connect_bdpt, generate_camera_subpath, generate_light_subpath,
};
use std::sync::Arc;

/// An integrator of rs_pbrt on a scene of its.
pub(crate) struct Pbrt {
    scene: Scene,
    integrator: Integrator,
    camera: Arc<Camera>,
    /// Copied for every job; the random sampler, which can be given any seed.
    sampler: Box<Sampler>,
    seed: u64,
}

impl Pbrt {
    /// The scene and the integrator that the options describe. The sampler has to be `random`.
    pub(crate) fn new(options: &RenderOptions, seed: u64) -> Result<Self, String> {
        let scene = options.make_scene();
        let mut integrator = *options.make_integrator(0, &None).ok_or("there is no such integrator")?;
        let (camera, sampler) = match &mut integrator {
            Integrator::Sampler(path) => {
                path.preprocess(&scene);
                (path.get_camera(), path.get_sampler().clone_with_seed(0))
            }
            Integrator::BDPT(both) => (both.get_camera(), both.get_sampler().clone_with_seed(0)),
            _ => return Err("neither a path tracer nor a bidirectional one".into()),
        };
        Ok(Self { scene, integrator, camera, sampler, seed })
    }

    fn size(&self) -> (usize, usize) {
        let resolution = self.camera.get_film().full_resolution;
        (resolution.x as usize, resolution.y as usize)
    }

    /// The sampler for one sample of one pixel: all random numbers follow from (seed, pixel, sample).
    fn start(&self, sampler: &mut Sampler, pixel: Point2i, sample: u64) {
        let place = (pixel.y as u64) << 32 | pixel.x as u64;
        sampler.reseed(hash(self.seed ^ hash(place ^ hash(sample))));
        sampler.start_pixel(pixel);
    }

    /// Path tracing of one tile.
    fn trace(&self, path: &SamplerIntegrator, r: &Request) -> Batch {
        let pixel = |i: usize| {
            let mut sampler = self.sampler.clone_with_seed(0);
            let at =
                Point2i { x: (r.tile.x + i % r.tile.width) as i32, y: (r.tile.y + i / r.tile.width) as i32 };
            let mut sum = [0.0; 3];
            for sample in r.first..r.first + r.spp {
                self.start(&mut sampler, at, sample);
                let mut ray = Ray::default();
                let weight = self.camera.generate_ray_differential(&sampler.get_camera_sample(at), &mut ray);
                let light = path.li(&mut ray, &self.scene, &mut sampler, 0);
                add(&mut sum, &light, weight);
            }
            sum.map(|c| (c / r.spp as f64) as f32)
        };
        let mean = (0..r.tile.pixels()).into_par_iter().map(pixel).collect();
        Batch::new(r.tile, r.spp, mean)
    }

    /// Bidirectional path tracing of the whole picture. Paths from the lights meet the camera in any pixel,
    /// so that tiles cannot be rendered alone.
    fn trace_both(&self, both: &BDPTIntegrator, first: u64, samples: u64) -> Vec<Rgb> {
        let (width, height) = self.size();
        let row = |y: usize| {
            let (mut own, mut splats) = (vec![[0.0; 3]; width], Vec::new());
            let mut sampler = self.sampler.clone_with_seed(0);
            for (x, sum) in own.iter_mut().enumerate() {
                let at = Point2i { x: x as i32, y: y as i32 };
                for sample in first..first + samples {
                    self.start(&mut sampler, at, sample);
                    self.connect(both, &mut sampler, at, sum, &mut splats);
                }
            }
            (own, splats)
        };
        // Sums in the order of rows, whoever was ready first
        let rows: Vec<_> = (0..height).into_par_iter().map(row).collect();
        let (own, splats): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let mut sums: Vec<[f64; 3]> = own.concat();
        for (place, light) in splats.into_iter().flatten() {
            add(&mut sums[place], &light, 1.0);
        }
        sums.into_iter().map(|sum| sum.map(|c| (c / samples as f64) as f32)).collect()
    }

    /// One path from the camera and one from a light, connected in every way.
    fn connect(
        &self,
        both: &BDPTIntegrator,
        sampler: &mut Sampler,
        at: Point2i,
        sum: &mut [f64; 3],
        splats: &mut Vec<(usize, Spectrum)>,
    ) {
        let Some(lights) = create_light_sample_distribution(both.get_light_sample_strategy(), &self.scene)
        else {
            return;
        };
        let (scene, camera, depth) = (&self.scene, &self.camera, both.max_depth);
        let shift = sampler.get_2d();
        let film = Point2f { x: at.x as f32 + shift.x, y: at.y as f32 + shift.y };
        let (mut seen, mut lit): (Vec<Vertex<'_>>, Vec<Vertex<'_>>) = (Vec::new(), Vec::new());
        let (cameras, start, time) =
            generate_camera_subpath(scene, sampler, depth + 2, camera, film, &mut seen);
        let lights = lights.lookup(&start);
        let emitted = generate_light_subpath(scene, sampler, depth + 1, time, lights.clone(), &mut lit);
        for t in 1..=cameras {
            for s in 0..=emitted {
                if (s, t) == (1, 1) || s + t < 2 || s + t > depth as usize + 2 {
                    continue;
                }
                let (mut place, mut weight) = (film, Some(0.0));
                let lights = lights.clone();
                let light = connect_bdpt(
                    scene,
                    &lit,
                    &seen,
                    s,
                    t,
                    lights,
                    camera,
                    sampler,
                    &mut place,
                    weight.as_mut(),
                );
                if t > 1 {
                    add(sum, &light, 1.0);
                } else if let Some(pixel) = self.pixel(place).filter(|_| !light.is_black()) {
                    splats.push((pixel, light));
                }
            }
        }
    }

    fn pixel(&self, at: Point2f) -> Option<usize> {
        let (width, height) = self.size();
        let inside = at.x >= 0.0 && at.y >= 0.0 && (at.x as usize) < width && (at.y as usize) < height;
        inside.then(|| at.y as usize * width + at.x as usize)
    }
}

impl ProgressiveSource for Pbrt {
    fn info(&self) -> SourceInfo {
        let (width, height) = self.size();
        let aims = matches!(self.integrator, Integrator::Sampler(_));
        let name = if aims { "rs_pbrt path" } else { "rs_pbrt bdpt" };
        SourceInfo::new(name, width, height).with_aims(aims).with_repeats(Repeats::Samples)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        match (&self.integrator, requests.first()) {
            (Integrator::Sampler(path), _) => Ok(requests.iter().map(|r| self.trace(path, r)).collect()),
            (Integrator::BDPT(both), Some(&Request { first, spp: samples, .. })) => {
                let picture = self.trace_both(both, first, samples);
                let cut =
                    |tile: Tile| tile.rows(self.size().0).flat_map(|row| picture[row].to_vec()).collect();
                Ok(requests.iter().map(|r| Batch::new(r.tile, samples, cut(r.tile))).collect())
            }
            _ => Ok(Vec::new()),
        }
    }
}

fn add(sum: &mut [f64; 3], light: &Spectrum, weight: f32) {
    sum.iter_mut().zip(light.c).for_each(|(sum, c)| *sum += f64::from(c * weight));
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014).
fn hash(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
