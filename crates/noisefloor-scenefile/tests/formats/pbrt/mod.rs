//! pbrt scenes.

mod bad; // what is broken or not supported, and where
mod defaults; // what is taken where a parameter is not given
mod limits; // what is too large, or not in proportion to its files
mod looks; // what scenes look like
