//! Tests that cross crates: see `tests/`. Implementers find `check_source` in `noisefloor-testkit`.

pub mod mistakes;

/// The Rust blocks of README and docs, run as doctests.
#[cfg(doctest)]
mod documents {
    #[doc = include_str!("../../README.md")]
    struct Readme;
    #[doc = include_str!("../../docs/embedding.md")]
    struct Embedding;
}
