//! Tells progressive Monte Carlo renderers, tile by tile, when people stop seeing noise.

mod source;
mod tile;

pub use source::{Batch, ProgressiveSource, Reference, Request, Rgb, SourceError, SourceInfo, Unit};
pub use tile::{
    DEFAULT_TILE, MAX_EDGE, MAX_PIXELS, MAX_TILE, MIN_TILE, Tile, TileError, TileGrid, check_image,
};
