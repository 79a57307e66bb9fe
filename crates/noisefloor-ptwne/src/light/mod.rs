//! Emitters: how points on them are sampled, and how one of many is chosen.

mod choice;
mod emitter;
mod punctual;

#[cfg(test)]
mod tests;

pub(crate) use choice::Lights;
pub(crate) use emitter::{Light, LightSample, LightShape};
pub use punctual::Punctual;
