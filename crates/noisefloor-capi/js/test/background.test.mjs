// A session in a worker against one here, in Node. ../../tests/wasm.rs runs this with the module built.

import assert from "node:assert/strict";
import { test } from "node:test";
import { BackgroundSession } from "../background.js";
import { Session, load } from "../noisefloor.js";

await load();

const [width, height] = [96, 80];

function noise(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) | 0;
    const mixed = Math.imul(state ^ (state >>> 15), 0x2c1b3c6d);
    return ((mixed ^ (mixed >>> 12)) >>> 8) / 2 ** 23 - 1;
  };
}

function* passes(spp, count = Infinity) {
  const random = noise(11);
  for (let k = 0; k < count; k++) {
    yield Float32Array.from({ length: 3 * width * height }, () => 0.5 + (0.4 * random()) / Math.sqrt(spp));
  }
}

const own = ([r, g, b]) => [Math.min(1, r), Math.min(1, g * g), b / (1 + b)];

for (const curve of ["aces", own]) {
  test(`stops are those of a session that waits, with ${curve.name ?? curve}`, async () => {
    const options = { tile: 32, maxSpp: 400, toneMapping: { curve }, linear: true };
    const here = new Session(width, height, options);
    const there = await BackgroundSession.open(width, height, { ...options, waiting: 2 });
    assert.equal(there.nextSpp, here.nextSpp);
    for (const pixels of passes(16)) {
      if (here.isDone) break;
      here.push(pixels, { spp: 16 });
      here.judge();
      const buffer = there.buffer(pixels.length);
      buffer.set(pixels);
      await there.push(buffer, { spp: 16 });
      assert.equal(buffer.length, 0, "handed over without a copy");
    }
    assert.deepEqual(await there.finish(), here.states());
    assert.deepEqual([there.isDone, there.nextSpp, there.warnings], [true, Infinity, []]);
    assert.deepEqual(await there.image(), here.image());
    const again = await BackgroundSession.open(width, height, options);
    await again.resume("job", await there.checkpoint("job"));
    assert.deepEqual(again.states, here.states());
    [here, there, again].forEach((session) => session.close());
    await assert.rejects(there.image(), { code: "HANDLE" });
  });
}

test("passes that find no room become one, and nothing waits", async () => {
  for (const running of [false, true]) {
    const session = await BackgroundSession.open(width, height, { tile: 32, whenFull: "merge" });
    const sum = new Float64Array(3 * width * height);
    let k = 0;
    for (const pixels of passes(4, 12)) {
      k++;
      pixels.forEach((value, i) => (sum[i] += value));
      if (running) session.pushRunning(Float32Array.from(sum, (value) => value / k), { spp: 4 * k });
      else session.push(pixels, { spp: 4 });
    }
    const image = await session.image();
    const states = await session.finish();
    assert.ok(states.every(({ spp }) => spp === 48));
    // Some roundings of single precision
    image.forEach((value, i) => assert.ok(Math.abs(value - sum[i] / 12) < 1e-5));
    session.close();
  }
});

test("whoever asks renders nothing beyond the limit", async () => {
  for (const [running, whenFull] of [[false, "wait"], [true, "wait"], [false, "merge"]]) {
    const session = await BackgroundSession.open(width, height, { tile: 32, maxSpp: 100, linear: true, whenFull });
    let handed = 0;
    const sum = new Float64Array(3 * width * height);
    const images = passes(1);
    assert.equal(session.sppLeft, 100);
    for (const spp of [10, 40, 20, 7, 23]) {
      const image = images.next().value;
      image.forEach((value, i) => (sum[i] += spp * value));
      handed += spp;
      if (running) await session.pushRunning(sum.map((value) => value / handed), { spp: handed });
      else await session.push(image, { spp });
      assert.equal(session.sppLeft, 100 - handed, "judged or not");
    }
    await session.finish();
    assert.ok(session.isDone && session.states.every(({ spp }) => spp === 100));
    assert.equal(session.sppLeft, 0);
    session.close();
  }
  // One half is empty: no verdict can come of it, and the page is not kept waiting
  const session = await BackgroundSession.open(width, height, { tile: 32, maxSpp: 100 });
  await session.push(passes(1).next().value, { spp: 100 });
  await session.finish();
  assert.deepEqual([session.sppLeft, session.isDone], [1, false]);
  session.close();
});

test("half floats are read in the worker, and integers are refused", async () => {
  // Of several exponents: those of one are integers over a power of two, which are refused
  const bits = (seed) => {
    const random = noise(seed);
    return Uint16Array.from({ length: 3 * width * height }, () => 0x3000 + Math.floor(0xbff * random()));
  };
  const value = (bit) => 2 ** ((bit >> 10) - 25) * (1024 + (bit & 1023));
  for (const whenFull of ["wait", "merge"]) {
    const session = await BackgroundSession.open(width, height, { tile: 32, whenFull, linear: true });
    const pushed = [];
    for (let k = 0; k < 6; k++) {
      const pixels = session.buffer(3 * width * height, Uint16Array);
      pixels.set(bits(k + 1));
      const pass = session.push(pixels, { spp: 4, halfFloats: true });
      if (whenFull === "wait") assert.equal(pixels.length, 0, "handed over without a copy");
      await pass;
      pushed.push(bits(k + 1));
    }
    await session.finish();
    const image = await session.image();
    image.forEach((found, i) => {
      const mean = pushed.reduce((sum, pass) => sum + value(pass[i]), 0) / pushed.length;
      assert.ok(Math.abs(found - mean) < 1e-6);
    });
    for (const wrong of [new Uint8Array(3 * width * height), new Uint16Array(3 * width * height), "grey"]) {
      await assert.rejects(session.push(wrong, { spp: 4 }), { code: "ARGUMENT" });
      await assert.rejects(session.pushRunning(wrong, { spp: 4 }), { code: "ARGUMENT" });
    }
    const floats = new Float32Array(3 * width * height);
    await assert.rejects(session.push(floats, { spp: 4, halfFloats: true }), { code: "ARGUMENT" });
    assert.equal(session.pending, 0);
    session.close();
  }
});

test("what is wrong comes as an error of a later call", async () => {
  const session = await BackgroundSession.open(width, height, { tile: 32 });
  session.push(new Float32Array(3 * width * height).fill(NaN), { spp: 4 }).catch(() => {});
  await assert.rejects(session.finish(), { code: "FAULT" });
  await assert.rejects(session.push(new Float32Array(3), { spp: 4 }), { code: "FAULT" });
  session.close();
  await assert.rejects(BackgroundSession.open(0, 0), { code: "SIZE" });
  await assert.rejects(BackgroundSession.open(8, 8, { whenFull: "drop" }), { code: "ARGUMENT" });
});
