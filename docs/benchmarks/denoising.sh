#!/usr/bin/env bash
# Renders what docs/denoising.md compares, and prints its tables. Goes on where it was stopped.
#
#   docs/benchmarks/denoising.sh FOLDER [SCENE…]
#
# Needs `cargo build --release --all-features --bin noisefloor --example validate_denoised`, Open Image Denoise
# (`noisefloor doctor --install oidn`) and, for the tables, Python with numpy. About four minutes a scene on one core.
set -euo pipefail
folder=$1
shift
scenes=("$@")
[ $# -gt 0 ] || scenes=(cornell-box courtyard glass-spheres softbox arcade door-ajar lanterns plates bulb)
here=$(cd "$(dirname "$0")" && pwd)
built=${CARGO_TARGET_DIR:-$here/../../target}/release

# Two independent halves and the converged picture, in one call each: what is there is finished
stack() {
    local name=$1 levels=$2 to
    shift 2
    to="$folder/$(basename "${scene%/scene.xml}")/$name"
    [ -e "$to.done" ] && return
    rm -rf "$to"
    mkdir -p "$(dirname "$to")"
    "$built/noisefloor" study stack "$scene" --size 192x192 --levels "$levels" --out "$to" "$@" && touch "$to.done"
}
for scene in "${scenes[@]}"; do
    stack a 2,4,8,16,32,64,128,256,512 --seed 1
    stack b 2,4,8,16,32,64,128,256,512 --seed 2
    stack t 2048,4096 --seed 3 --sampler sobol
done

"$built/examples/validate_denoised" "$folder"/*/ >"$folder/denoising.csv"
python3 "$here/denoising.py" "$folder/denoising.csv"
