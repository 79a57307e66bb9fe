#!/usr/bin/env bash
# Builds noisefloor.wasm beside noisefloor.js; `rustup target add wasm32-unknown-unknown` comes first.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cd "$here/../../.."
export CARGO_TARGET_DIR=$PWD/target/wasm
# Vector instructions: in every browser since March 2023
export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS="-C target-feature=+simd128"
cargo rustc --profile wasm --locked --package noisefloor-capi --lib --crate-type cdylib \
    --target wasm32-unknown-unknown
cp "$CARGO_TARGET_DIR/wasm32-unknown-unknown/wasm/noisefloor_capi.wasm" "$here/noisefloor.wasm"
printf '%s: %d bytes, %d compressed\n' noisefloor.wasm "$(wc -c <"$here/noisefloor.wasm")" \
    "$(gzip -9c "$here/noisefloor.wasm" | wc -c)"
