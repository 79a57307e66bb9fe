#!/usr/bin/env bash
# Renders what docs/denoising.md compares, and prints its tables. Goes on where it was stopped.
#
#   benchmarks/denoising.sh FOLDER [SCENE…]
#
# Needs `cargo build --release --all-features --bin noisefloor --example validate_denoised`, Open Image Denoise
# (`noisefloor doctor --install oidn`) and, for the tables, Python with numpy. About four minutes a scene on one core.
# A scene that begins with `mitsuba:` is rendered by Mitsuba, at 128x128, up to 256 spp, with a truth of 2,048.
set -euo pipefail
folder=$1
shift
scenes=("$@")
[ $# -gt 0 ] || scenes=(cornell-box courtyard glass-spheres softbox arcade door-ajar lanterns plates bulb)
here=$(cd "$(dirname "$0")" && pwd)
built=${CARGO_TARGET_DIR:-$here/../target}/release

# Two independent halves and the converged picture, in one call each: what is there is finished
stack() {
    local to="$into/$1" levels=$2
    shift 2
    [ -e "$to.done" ] && return
    rm -rf "$to"
    mkdir -p "$into"
    "$built/noisefloor" study stack "$scene" "${with[@]}" --levels "$levels" --out "$to" "$@" && touch "$to.done"
}
# Albedo and normals, which a render of a few samples writes beside other things
guide() {
    local to="$into/$1"
    [ -e "$to/normal.exr" ] && return
    "$built/noisefloor" render "$scene" "${with[@]}" --seed "$2" --denoise oidn --lost 5 --batch 4 --max-spp 4 \
        --tile 64 --quiet --force --out "$to"
}
for typed in "${scenes[@]}"; do
    scene=${typed#mitsuba:}
    name=$(basename "${scene%/scene.xml}" .xml)
    if [ "$scene" = "$typed" ]; then
        into="$folder/$name" with=(--size 192x192) halves=2,4,8,16,32,64,128,256,512
        truth=(2048,4096 --sampler sobol)
    else
        into="$folder/$name-mitsuba" with=(--size 128x128 --source mitsuba) halves=2,4,8,16,32,64,128
        truth=(1024,2048)
    fi
    stack a $halves --seed 1
    stack b $halves --seed 2
    stack t "${truth[0]}" --seed 3 "${truth[@]:1}"
    guide ga 1
    guide gb 2
done

"$built/examples/validate_denoised" "$folder"/*/ >"$folder/denoising.csv"
python3 "$here/denoising.py" "$folder/denoising.csv"
