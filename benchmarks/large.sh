#!/usr/bin/env bash
# Time and memory of renders with a time limit, by size: docs/benchmarks/large.md. Needs GNU time.
# usage: benchmarks/large.sh NOISEFLOOR [SECONDS]
set -euo pipefail
noisefloor=$1 seconds=${2:-90}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
echo "size,asked_s,wall_s,peak_bytes_per_pixel,in_source_s,samples_per_pixel,folder_bytes_per_pixel"
for size in 512x512 3840x2160 7680x4320; do
    pixels=$((${size/x/*}))
    /usr/bin/time -f "%e %M" -o "$out/time" \
        "$noisefloor" render courtyard --size "$size" --time "$seconds" --max-spp 1000000 --threshold 0.999 \
        --quiet --out "$out/$size"
    read -r wall kib <"$out/time"
    python3 - "$out/$size" "$size" "$seconds" "$wall" "$kib" "$pixels" <<'PYTHON'
import json, os, sys
folder, size, asked, wall, kib, pixels = sys.argv[1:]
pixels, report = int(pixels), json.load(open(f"{folder}/report.json"))
on_disk = sum(os.path.getsize(f"{folder}/{name}") for name in os.listdir(folder))
print(f"{size},{asked},{wall},{int(kib) * 1024 / pixels:.1f},{report['seconds_source']:.1f},"
      f"{report['samples'] / pixels:.1f},{on_disk / pixels:.1f}")
PYTHON
    rm -rf "${out:?}/$size"
done
