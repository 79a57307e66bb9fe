//! Options that several commands have.

pub mod denoiser;
pub mod eyes;
pub mod layer;
pub mod oracle;
pub mod renderer;
pub mod scenes;
pub mod tone;
pub mod values;
pub mod viewing;
