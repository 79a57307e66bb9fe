#!/usr/bin/env bash
# Builds noisefloor.wasm beside noisefloor.js, with the standard library of `rustup target add
# wasm32-unknown-unknown`. Where that cannot be downloaded: `build.sh --debian` takes a compiler and the
# sources of its standard library from Debian's packages (rustc-web), unpacks them below target/ and
# compiles both.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cd "$here/../../.."
export CARGO_TARGET_DIR=$PWD/target/wasm
# Vector instructions: in every browser since March 2023
export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS="-C target-feature=+simd128"
options=()

# The name of a package that another one depends on.
dependency() { apt-cache depends "$1" | sed -n "s/^ *Depends: \($2[0-9.-]*\)$/\1/p" | head -n 1; }

if [ "${1-}" = --debian ]; then
    unpacked=$CARGO_TARGET_DIR/debian
    host=$(rustc -vV | sed -n 's/^host: //p')
    # The linker for WebAssembly is in every toolchain of rustup
    CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$(rustc --print sysroot)/lib/rustlib/$host/bin/rust-lld
    export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER
    # Unpacked once, the compiler is kept until Debian has another
    newest=$(apt-cache policy rustc-web | sed -n 's/^ *Candidate: //p')
    if [ "$(cat "$unpacked/version" 2>/dev/null)" != "$newest" ]; then
        std=$(dependency libstd-rust-web-dev libstd-rust-web-)
        llvm=$(dependency "$std" libllvm)
        rm -rf "$unpacked" "$unpacked.deb" "$unpacked.part" && mkdir -p "$unpacked.deb"
        (cd "$unpacked.deb" && apt-get download -qq rustc-web rust-web-src libstd-rust-web-dev "$std" "$llvm")
        for package in "$unpacked.deb"/*.deb; do
            dpkg-deb -x "$package" "$unpacked.part"
        done
        echo "$newest" >"$unpacked.part/version"
        mv "$unpacked.part" "$unpacked"
        rm -r "$unpacked.deb"
    fi
    export RUSTC=$unpacked/usr/bin/rustc LD_LIBRARY_PATH=$unpacked/usr/lib/$(uname -m)-linux-gnu
    export RUSTC_BOOTSTRAP=1 # for build-std, which stable toolchains lack
    options=(-Z build-std=std,panic_abort)
fi
cargo rustc --profile wasm --locked --package noisefloor-capi --lib --crate-type cdylib \
    --target wasm32-unknown-unknown "${options[@]}"
cp "$CARGO_TARGET_DIR/wasm32-unknown-unknown/wasm/noisefloor_capi.wasm" "$here/noisefloor.wasm"
printf '%s: %d bytes, %d compressed\n' noisefloor.wasm "$(wc -c <"$here/noisefloor.wasm")" \
    "$(gzip -9c "$here/noisefloor.wasm" | wc -c)"
