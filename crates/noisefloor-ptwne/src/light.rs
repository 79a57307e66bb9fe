//! Emitters: how points on them are sampled, and how one of many is chosen.

mod choice;
mod cluster;
mod cone;
mod emitter;
mod node;
mod patch;
mod punctual;
mod receiver;
mod split;
mod tree;

#[cfg(test)]
mod tests;

pub(crate) use choice::{Lights, Prospect};
pub use cone::Falloff;
pub(crate) use emitter::{Light, LightSample, LightShape};
pub use punctual::{Profile, Punctual};
pub(crate) use receiver::Receiver;
