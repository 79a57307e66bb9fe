// What the table of a curve, interpolated as Rust does, says of that curve. That the curves are those of
// three.js is tested in a browser, by three.js itself: examples/10-three-gpu-pathtracer/test.mjs.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Session, curves, load, toneMappingOf, toneTable } from "../noisefloor.js";

const [EDGE, TOE, STOPS] = [49, 2 ** -8, 16];

/** log2, made linear between powers of two. */
function stops(x) {
  const whole = Math.floor(Math.log2(x));
  return whole + x / 2 ** whole - 1;
}

function show(table, colour) {
  const places = colour.map((x) => {
    const place = Math.min((stops(1 + x / TOE) / STOPS) * (EDGE - 1), EDGE - 1);
    const below = Math.min(Math.floor(place), EDGE - 2);
    return [below, place - below];
  });
  const shown = [0, 0, 0];
  for (let corner = 0; corner < 8; corner++) {
    const [r, g, b] = places.map(([below, share], i) => {
      const up = (corner >> i) & 1;
      return [below + up, up ? share : 1 - share];
    });
    const at = 3 * ((b[0] * EDGE + g[0]) * EDGE + r[0]);
    for (let c = 0; c < 3; c++) shown[c] += r[1] * g[1] * b[1] * table[at + c];
  }
  return shown;
}

const encode = (x) => {
  const linear = Math.min(Math.max(x, 0), 1);
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
};

for (const [name, curve] of Object.entries(curves)) {
  test(`the table of ${name} is as good as 8 bits`, () => {
    const table = toneTable(curve);
    let [state, sum, largest, count] = [1, 0, 0, 20000];
    const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
    for (let i = 0; i < count; i++) {
      // Greys and colours, 12 stops down and 6 up
      const level = 2 ** (18 * random() - 12);
      const colour = [0, 0, 0].map(() => level * (0.1 + 0.9 * random()));
      const differences = show(table, colour).map((x, c) => Math.abs(x - encode(curve(colour)[c])));
      sum += Math.max(...differences);
      largest = Math.max(largest, ...differences);
    }
    console.log(
      `${name}: ${((255 * sum) / count).toFixed(3)} of 255 on average, ${(255 * largest).toFixed(2)}`,
    );
    assert.ok(sum / count < 0.5 / 255 && largest < 7 / 255);
  });
}

test("white is white and black is black", () => {
  for (const [name, curve] of Object.entries(curves)) {
    const table = toneTable(curve);
    assert.ok(Math.max(...table.subarray(0, 3)) < 0.01, name);
    assert.ok(Math.min(...table.subarray(-3)) > 0.98, name);
  }
});

test("curves reach the session", async () => {
  await load();
  const spread = (toneMapping) => {
    const session = new Session(32, 32, { tile: 32, toneMapping });
    let state = 1;
    const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
    for (let i = 0; i < 10; i++) {
      session.push(
        Float32Array.from({ length: 3072 }, () => 0.2 + 0.3 * random()),
        { spp: 10 },
      );
      session.judge();
    }
    const [{ probability }] = session.states();
    session.close();
    return probability;
  };
  // Where it is darker still, light may lack that few samples meet
  const darkest = spread({ curve: "aces", exposure: 0.1 });
  for (const curve of ["linear", ...Object.keys(curves)]) {
    const probability = spread({ curve, exposure: 1 });
    assert.ok(probability < darkest, `${curve}: ${probability} ${darkest}`);
  }
  assert.equal(spread({ curve: (colour) => curves.agx(colour) }), spread({ curve: "agx" }));
  assert.notEqual(spread({}), spread({ key: 0.5 }));
  assert.throws(() => new Session(32, 32, { toneMapping: { curve: "sepia" } }), /linear, reinhard/);
});

test("the constants of three.js are known", () => {
  const of = (toneMapping) => toneMappingOf({ toneMapping, toneMappingExposure: 2 });
  assert.deepEqual(of(0), { curve: "linear", exposure: 1 });
  assert.deepEqual(of(4), { curve: "aces", exposure: 2 });
  assert.deepEqual(of(7), { curve: "neutral", exposure: 2 });
  assert.throws(() => of(5), /give your own/);
});
