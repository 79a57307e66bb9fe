#!/usr/bin/env bash
# Makes the study of docs/studies.md, ready to serve: spread.sh FOLDER [noisy|denoised]. Renders its pictures with
# noisefloor's own renderer: some ten minutes of one core for each of the four scenes, and denoises them with Open Image
# Denoise (`noisefloor doctor --install oidn`) if the second word says so. What is there already is kept.
set -euo pipefail
folder=$1
kind=${2:-noisy}
here=$(cd "$(dirname "$0")" && pwd)
lab=${NOISEFLOOR_LAB:-noisefloor-lab}
case $kind in
    noisy) denoise=() levels=8,11,15,20,27,36,48,65,88,119,161,217,293,396,534,721,974,1315,1775,4096 ;;
    # Denoised pictures are as good from a few dozen samples on, and tiles nearer than a factor of four to an end are left out
    denoised) denoise=(--denoise oidn) levels=2,3,4,5,7,9,12,16,22,30,40,54,73,99,133,180,243,328,443,4096 ;;
    *) echo "the pictures are noisy or denoised, not $kind" >&2 && exit 2 ;;
esac
mkdir -p "$folder"
for scene in cornell-box softbox arcade bulb; do
    stack=$folder/$kind-$scene
    [ -e "$stack" ] && continue
    # Complete or not there
    "$lab" study stack "$scene" --size 256x256 --levels "${LEVELS:-$levels}" \
        ${denoise[@]+"${denoise[@]}"} --out "$stack.part"
    mv "$stack.part" "$stack"
done
sed "s/KIND/$kind/g" "$here/spread.toml" >"$folder/spread-$kind.toml"
"$lab" study simulate "$folder/spread-$kind.toml" --observers 10 >/dev/null
echo "to rehearse: $lab study analyse $folder/spread-$kind.toml --simulated --out $folder/rehearsal-$kind"
echo "to begin:    $lab study serve $folder/spread-$kind.toml"
