#!/usr/bin/env bash
# Makes the package for npm from the work tree: release/npm.sh FOLDER. The package is installed into an empty folder at last,
# and judges a tile there; and into the newest template of Vite, in which TypeScript compiles the README's snippet by strict options, and
# Chromium shows the package in pages.
set -euo pipefail
folder=$(mkdir -p "$1" && cd "$1" && pwd)
js=$(cd "$(dirname "$0")/../crates/noisefloor-capi/js" && pwd)
"$js/build.sh"

empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
mkdir "$empty/package"
# Links to licences become files, which npm would leave out
cp -L "$js"/{package.json,README.md,LICENSE-*,noisefloor.*,background.*,pixels.js,worker.js} "$empty/package"
file=$(cd "$empty/package" && npm pack --silent --pack-destination "$folder")
cd "$empty"
echo '{ "type": "module" }' >package.json
npm install --silent --no-audit --no-fund --ignore-scripts "$folder/$file"
for name in noisefloor.js noisefloor.d.ts pixels.js noisefloor.wasm background.js background.d.ts worker.js LICENSE-APACHE LICENSE-MIT README.md; do
    [ -s "node_modules/noisefloor/$name" ] || { echo "$file lacks $name"; exit 1; }
done
node --input-type module --eval '
import { Session, version } from "noisefloor";
import { readFileSync } from "node:fs";
const session = await Session.open(32, 32, { tile: 32, toneMapping: { curve: "linear" }, minSpp: 20 });
let state = 1;
const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
while (!session.isDone) {
  for (const { spp } of session.requests()) {
    session.push(Float32Array.from({ length: 3072 }, () => 0.5 + 0.01 * random()), { spp });
  }
  session.judge();
}
const [{ reason, spp }] = session.stops();
session.close();
const { version: packed } = JSON.parse(readFileSync("node_modules/noisefloor/package.json"));
const isRight = reason === "converged" && version() === packed;
if (!isRight) throw new Error(`${reason} at ${spp}, ${version()} in ${packed}`);
'
npx --yes create-vite@latest app --template vanilla-ts --no-interactive >/dev/null
cd app
npm install --silent --no-audit --no-fund --ignore-scripts "$folder/$file"
rm -r src/*
node "$js/test/readme.mjs" >src/main.ts
npx tsc --project . --strict --noUncheckedIndexedAccess --exactOptionalPropertyTypes
npm install --silent --no-audit --no-fund --ignore-scripts playwright-core@1.65.1
node "$js/test/page.mjs"
echo "$folder/$file"
