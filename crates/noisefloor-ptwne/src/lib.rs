//! The reference renderer of `noisefloor`: path tracing with next event estimation (Shirley et al. 1996;
//! Takouachet et al. 2017, §4.2), and the ray-traced reference of the paper (§4.3). It opens no files.
//!
//! - [`Ptwne`] renders a [`Scene`] as a [`ProgressiveSource`](noisefloor::ProgressiveSource), as
//!   [`RenderOptions`] says.
//! - [`scenes`] has scenes ready to render. [`SceneBuilder`] makes others of [`Mesh`], [`Material`],
//!   [`Emission`], [`Environment`] and [`Camera`].
//! - [`SceneError`] and [`RenderError`] report invalid input. No input panics.
//!
//! Scene units are the caller's, skies have +y up, colours are linear Rec.709 RGB, and angles are in degrees.
//!
//! ```
//! use noisefloor::{Counts, ProgressiveSource, Request, TileGrid};
//! use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
//!
//! let scene = scenes::by_name("cornell-box").ok_or("no such scene")?;
//! let mut source = Ptwne::new(scene, 64, 64, RenderOptions { seed: 7, ..RenderOptions::default() })?;
//! let requests: Vec<_> =
//!     TileGrid::new(64, 64, 32)?.tiles().map(|tile| Request::new(tile, 0, 4)).collect();
//! let batches = source.sample(&requests)?;
//! assert!(batches.iter().all(|batch| batch.mean.len() == 32 * 32));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Where things are
//! `integrator` traces paths, `bsdf` scatters light, `light` samples emitters, `illumination` and
//! `intersection` are what a scene answers them, and `accel` is its hierarchy. The reference is in
//! `reference`, its samples in `direct`, and its choice of lights in `guide`. `first_hits` has albedo and
//! normals for denoisers. `relief` turns shading normals, along `tangents`. `builder` fills `parts`, of
//! which `scene` is made. Absent on purpose: state between samples, allocation along paths, and any number
//! that depends on threads.

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

mod accel;
mod alias;
mod bsdf;
mod builder;
mod camera;
mod checks;
mod direct;
mod environment;
mod error;
mod filter;
mod first_hits;
mod geometry;
mod guide;
mod integrator;
mod intersection;
mod light;
mod material;
mod math;
mod parts;
mod reference;
mod relief;
mod renderer;
mod rng;
mod sampler;
mod scene;
pub mod scenes;
mod texture;

pub use bsdf::{Facets, MIN_ROUGHNESS};
pub use builder::{
    Emission, MAX_INSTANCES, MAX_SURFACES, MIN_AREA, MaterialId, Mesh, ObjectId, SceneBuilder,
};
pub use camera::{Camera, FovAxis, Optics};
pub use checks::{MAX_COORDINATE, check_memory};
pub use environment::{Environment, EnvironmentMap, Sun};
pub use error::{RenderError, SceneError};
pub use filter::Filter;
pub use integrator::Estimator;
pub use light::{Falloff, Profile, Punctual};
pub use material::{Dialect, Gloss, Lobes, Material, MaterialOptions, Principled};
pub use reference::ReferenceNoise;
pub use relief::Relief;
pub use renderer::{MAX_DEPTH, MAX_THREADS, Ptwne, RenderOptions, SampleCounts};
pub use sampler::Sampling;
pub use scene::Scene;
pub use texture::{ImageTexture, MAX_TEXTURE_PIXELS, Pixels, Texture, Wrap};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
