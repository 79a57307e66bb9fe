//! Emitters: how points on them are sampled, and how one of many is chosen.

mod choice;
mod cluster;
mod emitter;
mod node;
mod punctual;
mod receiver;
mod tree;

#[cfg(test)]
mod tests;

pub(crate) use choice::Lights;
pub(crate) use emitter::{Light, LightSample, LightShape};
pub use punctual::{Falloff, Profile, Punctual};
pub(crate) use receiver::Receiver;
