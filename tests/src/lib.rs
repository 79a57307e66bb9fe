//! Tests that cross crates: see `tests/`. Implementers find `check_source` in `noisefloor-testkit`.
