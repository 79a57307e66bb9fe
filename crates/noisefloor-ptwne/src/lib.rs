//! The reference renderer of `noisefloor`: path tracing with next event estimation (Shirley et al. 1996; Takouachet et al.
//! 2017, §4.2), and the quick ray-traced reference (§4.3). It opens no files.
//!
//! - [`Ptwne`] renders a [`Scene`] as a [`ProgressiveSource`](noisefloor::ProgressiveSource); [`Options`] say how
//! - [`scenes`] has scenes ready to render; [`SceneBuilder`] makes others from a [`Mesh`], a [`Material`], an [`Emission`], an
//!   [`Environment`], a [`Camera`]
//! - [`SceneError`] and [`RenderError`] say what was wrong: no input panics
//!
//! Units: scene units are the caller's own, +y is up for skies, colours are linear Rec.709 RGB, angles are in degrees.
//!
//! ```
//! use noisefloor::{ProgressiveSource, Request, TileGrid};
//! use noisefloor_ptwne::{Options, Ptwne, scenes};
//!
//! let scene = scenes::by_name("cornell-box").ok_or("no such scene")?;
//! let mut source = Ptwne::new(scene, 64, 64, Options { seed: 7, ..Options::default() })?;
//! let requests: Vec<_> =
//!     TileGrid::new(64, 64, 32)?.tiles().map(|tile| Request { tile, first: 0, samples: 4 }).collect();
//! let batches = source.sample(&requests)?;
//! assert!(batches.iter().all(|batch| batch.mean.len() == 32 * 32));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Where things are
//! Light transport is in `integrator`, scattering in `bsdf`, emitters in `light`, rays meeting surfaces in `accel`, random
//! numbers in `rng`, the reference in `reference`, its samples in `direct`, its choice of lights in `guide`. What is absent: state between samples, allocation along paths, and any
//! number that depends on threads.

mod accel;
mod alias;
mod bsdf;
mod builder;
mod camera;
mod direct;
mod environment;
mod error;
mod filter;
mod guide;
mod integrator;
mod light;
mod material;
mod math;
mod reference;
mod renderer;
mod rng;
mod sampler;
mod scene;
pub mod scenes;
mod texture;

pub use builder::{Emission, MAX_COORDINATE, MAX_SURFACES, MIN_AREA, MaterialId, Mesh, SceneBuilder};
pub use camera::Camera;
pub use environment::{Environment, EnvironmentMap, Sun};
pub use error::{RenderError, SceneError};
pub use filter::Filter;
pub use integrator::Estimator;
pub use light::Punctual;
pub use material::{Cover, MIN_ROUGHNESS, Material};
pub use reference::ReferenceNoise;
pub use renderer::{Counts, MAX_DEPTH, MAX_THREADS, Options, Ptwne};
pub use sampler::Sampling;
pub use scene::{Needs, Scene};
pub use texture::{ImageTexture, MAX_TEXTURE_PIXELS, Pixels, Texture, Wrap};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
