#!/usr/bin/env bash
# What rounds waste, and what a merge costs: the numbers of farm.md.
#   farm.sh waste FOLDER             two built-in scenes, on one machine and on a farm of two processes
#   farm.sh merge FOLDER             shards of noise; needs 4 GB of disk
# NOISEFLOOR names the command, MERGE_COST the example `merge_cost` of noisefloor-farm (cargo build --examples).
set -euo pipefail
verb=$1 folder=$2
noisefloor=${NOISEFLOOR:-target/release/noisefloor}
merge_cost=${MERGE_COST:-target/release/examples/merge_cost}
mkdir -p "$folder"

waste() {
    local scene batch one farm
    for scene in cornell-box softbox; do
        for batch in 100 10; do
            options=("$scene" --size 128x128 --tile 32 --batch "$batch" --max-spp 3000)
            one=$folder/$scene-$batch-one farm=$folder/$scene-$batch-farm
            rm -rf "$one" "$farm"
            "$noisefloor" render --quiet --out "$one" "${options[@]}"
            "$noisefloor" farm plan "$farm" --tasks 16 -- "${options[@]}" >/dev/null
            "$noisefloor" farm run "$farm" --local 2 --quiet
            cmp "$one/stops.csv" "$farm/frame/stops.csv" # or it was all in vain
            python3 - "$one" "$farm" "$scene, a verdict every $batch spp" <<'PYTHON'
import json, sys
one, farm, name = sys.argv[1:]
report = json.load(open(one + "/report.json"))
state = json.load(open(farm + "/frame/state.json"))
rounds = json.load(open(farm + "/round.json"))["number"] - 1
used, taken = state["samples"], state["sampled"]
print(f"{name}: {used / 16384:.0f} spp used, {100 * (taken / used - 1):.1f} % more taken, {rounds} rounds for "
      f"{state['rounds']} verdicts; render {report['samples'] / 16384:.0f} spp in {report['seconds_total']:.1f} s; "
      f"farm {state['source_seconds']:.1f} s in sources, {state['merge_seconds']:.2f} s merging")
PYTHON
        done
    done
}

merge() {
    local scratch=$folder/shards
    for job in "1920 1080 256" "3840 2160 16" "3840 2160 64" "3840 2160 256" "3840 2160 1024"; do
        rm -rf "$scratch"
        mkdir "$scratch"
        # shellcheck disable=SC2086
        "$merge_cost" "$scratch" $job 64
    done
    rm -rf "$scratch"
}

"$verb"
