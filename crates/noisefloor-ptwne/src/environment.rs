//! Light from infinitely far away: a smooth sky with a sun, or an image of all directions.

mod cells;
mod map;
mod sky;

#[cfg(test)]
mod tests;

pub(crate) use cells::Cells;
pub use map::EnvironmentMap;
pub(crate) use map::Map;
pub(crate) use sky::Dome;
pub use sky::{Environment, Sun};
