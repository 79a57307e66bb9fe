//! Metrics of a final picture against a converged one. Not available while rendering: they judge the results
//! of criteria.
//!
//! | metric | feature | compares | threshold of visibility |
//! |---|---|---|---|
//! | [`cvvdp`] | | display values | 10 JOD: no difference; 9: three of four people prefer the reference |
//! | [`relative_mse`] | | linear radiance | |
//! | [`psnr`] | | display values | |
//! | `flip` | `flip` | display values, 8 bits | near 0; none published |
//! | `butteraugli` | `butteraugli` | display values | maximum below 1 |
//!
//! [`MetricPair`] has all of them at once, with maps. Pictures are row-major, `width`×`height` pixels.

mod arithmetic;
#[cfg(feature = "butteraugli")]
mod butteraugli;
mod cvvdp;
#[cfg(feature = "flip")]
mod flip;
mod pair;

#[cfg(feature = "butteraugli")]
pub use self::butteraugli::butteraugli;
pub use arithmetic::{psnr, relative_mse};
pub use cvvdp::{cvvdp, cvvdp_of_tiles};
#[cfg(feature = "flip")]
pub use flip::flip;
pub use pair::{MetricMaps, MetricPair, MetricScores};
