// What the package promises, in Node. ../../tests/wasm.rs runs this with the module built.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import {
  NoisefloorError,
  REASONS,
  SCHEDULES,
  STATUS,
  STRUCTS,
  Session,
  load,
  version,
  viewing,
} from "../noisefloor.js";

await load();

/** Of the same session always the same: a wall with noise that shrinks as it should. */
function noise(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) | 0;
    const mixed = Math.imul(state ^ (state >>> 15), 0x2c1b3c6d);
    return ((mixed ^ (mixed >>> 12)) >>> 8) / 2 ** 23 - 1;
  };
}

function batch(pixels, spp, random, level = 0.5) {
  return Float32Array.from({ length: 3 * pixels }, () => level + (0.4 * random()) / Math.sqrt(spp));
}

const options = { tile: 32, maxSpp: 400 };

/** Those of tests/tests/it/bindings.rs, to the bit. */
function samples({ width, light, noise, holes }, tile, spp, batch) {
  const number = (place) => {
    const mixed = (Math.imul(place, 0x9e3779b1) + Math.imul(batch, 0x85ebca77)) >>> 0;
    const more = Math.imul(mixed ^ (mixed >>> 15), 0x2c1b3c6d);
    return (more ^ (more >>> 12)) >>> 8;
  };
  return Float32Array.from({ length: 3 * tile.width * tile.height }, (_, place) => {
    const pixel = Math.floor(place / 3);
    const [x, y] = [tile.x + (pixel % tile.width), tile.y + Math.floor(pixel / tile.width)];
    const lit = light * (0.2 + x / width) * ((x + 2 * y) % 50 < 20 ? 0.3 : 1);
    const hole = holes && number(3 * pixel) % 499 === 0;
    const random = number(place) / 2 ** 23 - 1;
    return hole ? NaN : Math.max(lit * (1 + (noise * random) / Math.sqrt(spp)), 0);
  });
}

/** Logarithms come from another library than in Rust, so P may differ by 10⁻⁵; no stop of these hangs on so little. */
test("sessions are those of Rust, also if they are resumed", () => {
  const file = new URL("../../../../fixtures/sessions.json", import.meta.url);
  for (const [number, kept] of JSON.parse(readFileSync(file, "utf8")).entries()) {
    const { width, height, people, running, rounds, params } = kept;
    const { tile, schedule, step, consecutive, viewing, exposure } = params;
    const [slope, offset] = params.audience;
    const toneMapping = params.tone_mapping && { curve: "linear", exposure };
    const limits = { minSpp: params.min_spp, maxSpp: params.max_spp, consecutive, people };
    const shown = { viewing, toneMapping, audience: { slope, offset }, onWarning() {} };
    const begin = () => new Session(width, height, { tile, schedule, step, ...limits, ...shown });
    let [session, batch] = [begin(), 0];
    const sums = session.tiles.map((tile) => [0, new Float64Array(3 * tile.width * tile.height)]);
    for (const states of rounds) {
      for (const { tile, spp } of session.requests()) {
        const [mean, sum] = [samples(kept, tile, spp, batch++), sums[tile.index]];
        sum[0] += spp;
        mean.forEach((x, i) => (sum[1][i] += x * spp));
        if (running) session.pushRunning(Float32Array.from(sum[1], (x) => x / sum[0]), { spp: sum[0], tile });
        else session.push(mean, { spp, tile });
      }
      session.judge();
      for (const { tile, spp, reason, probability } of session.states()) {
        const [keptSpp, keptReason, p] = states[tile.index];
        const where = `session ${number}, tile ${tile.index}`;
        assert.deepEqual([spp, reason], [keptSpp, keptReason === "max-spp" ? "maxSpp" : keptReason], where);
        assert.equal(probability === null, p === null, where);
        assert.ok(Math.abs(probability - p) < 1e-5, `${where}: P is ${probability} instead of ${p}`);
      }
      if (number % 2) {
        const checkpoint = session.checkpoint("wall");
        session.close();
        session = begin();
        assert.throws(() => session.resume("hall", checkpoint), { code: "CHECKPOINT", message: /its job is wall/ });
        assert.throws(() => session.resume("wall", checkpoint.slice(0, -9)), { code: "CHECKPOINT" });
        session.resume("wall", checkpoint);
      }
    }
    assert.deepEqual([session.isDone, session.nextSpp], [true, Infinity]);
    assert.equal(session.warnings().length, kept.warnings);
    session.close();
  }
});

test("options that there are not are errors", () => {
  for (const [wrong, name] of [
    [{ minspp: 20 }, "minspp"],
    [{ toneMapping: { curve: "linear", exposur: 2 } }, "toneMapping.exposur"],
    [{ audience: { slop: 2 } }, "audience.slop"],
  ]) {
    assert.throws(
      () => new Session(32, 32, wrong),
      (error) => error.code === "ARGUMENT" && error.message.includes(`no option ${name};`),
    );
  }
  new Session(32, 32, { maxSpp: undefined }).close();
});

test("a picture is rendered until all tiles are done", () => {
  const session = new Session(96, 80, options);
  assert.equal(session.tiles.length, 9);
  assert.deepEqual(session.tiles[8], { index: 8, x: 64, y: 64, width: 32, height: 16 });
  const random = noise(7);
  const stops = [];
  const [{ first, spp }] = session.requests();
  assert.equal(session.nextSpp, first + spp);
  while (!session.isDone) {
    for (const { tile, first, spp } of session.requests()) {
      assert.equal(first, session.states()[tile.index].spp);
      session.push(batch(tile.width * tile.height, spp, random), { spp, tile });
    }
    stops.push(...session.judge());
  }
  assert.deepEqual(new Set(stops.map((stop) => stop.tile.index)).size, 9, "each is reported once");
  assert.deepEqual(
    session.stops(),
    stops.sort((a, b) => a.tile.index - b.tile.index),
  );
  const [image, map] = [session.image(), session.visibleNoise()];
  assert.deepEqual([image.length, map.length], [3 * 96 * 80, 96 * 80]);
  assert.ok(Math.abs(image.reduce((sum, x) => sum + x) / image.length - 0.5) < 1e-3);
  assert.ok(map.every((seen) => seen >= 0));
  assert.deepEqual(session.warnings(), []);
  session.close();
  session.close();
  assert.throws(() => session.judge(), { code: "HANDLE" });
  assert.match(version(), /^\d+\.\d+\.\d+/);
});

test("a tile that is open again is reported a second time", () => {
  // Its exposure moves when the last tile of the picture turns dark; below 100 samples no tile of a small picture stops
  const session = new Session(160, 32, { tile: 32, maxSpp: 2000, onWarning() {} });
  const [random, stops] = [noise(7), []];
  while (!session.isDone) {
    for (const { tile, first, spp } of session.requests()) {
      const [level, sigma] = tile.index < 4 ? [0.05, 0.01] : [first < 160 ? 0.5 : 0.01, 1];
      const pixel = () => level + (sigma * random()) / Math.sqrt(spp);
      session.push(Float32Array.from({ length: 3 * 32 * 32 }, pixel), { spp, tile });
    }
    stops.push(...session.judge());
  }
  const first = stops.filter(({ tile }) => tile.index === 0).map(({ spp }) => spp);
  assert.equal(first.length, 2);
  assert.ok(first[1] > first[0], `${first}`);
  assert.equal(session.stops()[0].spp, first[1]);
  session.close();
});

/** The same picture in every shape that renderers have. */
test("pixels may lie in any way", () => {
  const [width, height] = [50, 50];
  const plain = batch(width * height, 50, noise(3));
  const shape = (channels, stride, fromBottom) => {
    const floats = new Float32Array(stride * height).fill(NaN);
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        const to = (fromBottom ? height - 1 - y : y) * stride + x * channels;
        floats.set(plain.subarray(3 * (y * width + x), 3 * (y * width + x) + 3), to);
      }
    }
    return floats;
  };
  const pushed = (floats, layout) => {
    const session = new Session(width, height, options);
    session.push(floats, { spp: 50, ...layout });
    const image = session.image();
    session.close();
    return image;
  };
  const expected = pushed(plain);
  assert.deepEqual(expected, plain);
  for (const channels of [3, 4]) {
    for (const fromBottom of [false, true]) {
      const near = shape(channels, channels * width, fromBottom);
      assert.deepEqual(pushed(near, { fromBottom }), expected, `${channels} channels, by length`);
      const wide = shape(channels, channels * width + 7, fromBottom);
      const layout = { fromBottom, channels, stride: channels * width + 7 };
      assert.deepEqual(pushed(wide, layout), expected, `${channels} channels with a stride`);
    }
  }
  // One tile of its own, upside down with an alpha
  const session = new Session(width, height, options);
  const { width: w, height: h } = session.tiles[3];
  const tile = Float32Array.from({ length: 4 * w * h }, (_, i) => Math.floor(i / 4 / w));
  session.push(tile, { spp: 50, tile: 3, fromBottom: true });
  assert.equal(session.image()[3 * (32 * width + 32)], h - 1);
  session.close();
});

test("what is likely wrong is a warning", () => {
  const warnings = (sharedPixels) => {
    const told = [];
    const onWarning = (text) => told.push(text);
    const session = new Session(128, 128, { tile: 64, sharedPixels, linear: true, onWarning });
    const random = noise(9);
    for (let i = 0; i < 6; i++) {
      // A filter of three pixels, along rows
      const samples = batch(128 * 128, 1, random);
      const filtered = samples.map((x, at) => (x + (samples[at - 3] ?? x) + (samples[at + 3] ?? x)) / 3);
      session.push(filtered, { spp: 20 });
      session.judge();
    }
    const said = session.warnings();
    assert.equal(session.sampleCounts().warnings, said.length);
    assert.deepEqual(told, said, "each once");
    // A resumed session says all again, since its user has heard none
    session.resume("filter", session.checkpoint("filter"));
    session.judge();
    assert.deepEqual(told, [...said, ...said]);
    session.close();
    return said;
  };
  assert.match(warnings(false).join(), /neighbouring pixels/);
  assert.deepEqual(warnings(true), []);
});

test("types name all that is exported, and no more", async () => {
  const types = readFileSync(new URL("../noisefloor.d.ts", import.meta.url), "utf8");
  const named = [...types.matchAll(/^export (?:function|class|const) (\w+)/gm)].map(([, name]) => name);
  // The layout of C, which the test below needs
  const inner = ["OPEN_FOR", "REASONS", "SCHEDULES", "STATUS", "STRUCTS"];
  const exported = Object.keys(await import("../noisefloor.js"));
  assert.deepEqual([...named, ...inner].sort(), exported.sort());
  // What a session has, and nothing that it lacks
  const [, body] = /^export class Session \{([^]*?)^\}/m.exec(types);
  const members = [...body.matchAll(/^  (?!static|constructor)(?:readonly )?(\w+)[(:]/gm)].map(([, name]) => name);
  const session = new Session(32, 32);
  for (const name of members) assert.ok(name in session, name);
  const own = Object.getOwnPropertyNames(Session.prototype).filter((name) => name !== "constructor");
  assert.deepEqual(new Set(members), new Set([...own, ...Object.keys(session)]));
  session.close();
});

test("errors have the words of Rust", () => {
  const session = new Session(64, 32, options);
  const floats = new Float32Array(3 * 64 * 32).fill(0.5);
  const says = (code, message) => (error) =>
    error instanceof NoisefloorError && error.code === code && message.test(error.message);
  assert.throws(() => new Session(64, 32, { tile: 7 }), says("SIZE", /tile size 7 is outside 16…512/));
  assert.throws(() => new Session(64, 32, { tile: 0.5 }), says("ARGUMENT", /whole number/));
  assert.throws(() => new Session(64, 32, { people: 2 }), says("ARGUMENT", /between 0 and 1/));
  assert.throws(() => new Session(64, 32, { viewing: "moon" }), says("ARGUMENT", /"moon"/));
  assert.throws(() => new Session(64, 32, { schedule: "never" }), says("ARGUMENT", /spaced/));
  assert.throws(() => new Session(0, 32), says("SIZE", /0/));
  assert.throws(() => session.push(floats, { spp: 0 }), says("BATCH", /./));
  assert.throws(() => session.push(floats, { spp: 1.5 }), says("ARGUMENT", /1.5/));
  assert.throws(() => session.push(floats.subarray(1), { spp: 1 }), says("SIZE", /64x32/));
  assert.throws(() => session.push(floats, { spp: 1, channels: 4 }), says("SIZE", /64x32/));
  assert.throws(() => session.push(floats, { spp: 1, stride: 1 }), says("SIZE", /stride of 1/));
  assert.throws(() => session.push(floats, { spp: 1, tile: 2 }), says("BATCH", /tile 2 does not exist/));
  assert.throws(() => session.visibleNoise(), says("UNAVAILABLE", /./));
  assert.throws(() => session.push(floats.fill(NaN), { spp: 10 }), says("FAULT", /not finite/));
  session.close();
});

test("memory is freed by closing and after forgetting", async () => {
  const grown = async (use) => {
    for (let i = 0; i < 30; i++) {
      use(new Session(512, 512, options));
      globalThis.gc?.();
      await new Promise((resolve) => setTimeout(resolve));
    }
    return process.memoryUsage().arrayBuffers + process.memoryUsage().external;
  };
  // 30 sessions take 280 MB if nothing is freed
  const close = (session) => session.close();
  await grown(close);
  const before = await grown(close);
  const dispose = Symbol.dispose ?? Symbol.for("Symbol.dispose");
  assert.ok((await grown((session) => session[dispose]())) < before + 40e6);
  const said = [];
  const { warn } = console;
  console.warn = (message) => said.push(message);
  const after = await grown(() => {});
  console.warn = warn;
  if (globalThis.gc) {
    assert.ok(
      said.length > 20 && /512x512 pixels was forgotten/.test(said[0]),
      `${said.length} were found`,
    );
    assert.ok(after < before + 100e6, `${(after - before) / 1e6} MB more`);
  }
});

test("pixels of a page have a size", () => {
  const ppd = (options) => Number(/ppd=([^,]+)/.exec(viewing(options))[1]);
  // CSS defines its pixel as 1/96 inch, which 28 inches away spans 0.0213 degrees
  assert.ok(Math.abs(1 / ppd({ distance: 28 * 0.0254 }) - 0.0213) < 1e-4);
  assert.ok(Math.abs(ppd({ pixelRatio: 2 }) / ppd({}) - 2) < 1e-4);
  const canvas = { width: 600, getBoundingClientRect: () => ({ width: 400 }) };
  assert.equal(ppd({ canvas }), ppd({ pixelRatio: 1.5 }));
  assert.match(viewing({ peak: 300, ambient: 50 }), /^ppd=[\d.]+,peak=300,ambient=50$/);
  new Session(32, 32, { viewing: viewing({ canvas, peak: 300 }) }).close();
});

test("structs and numbers are those of the header", () => {
  const header = readFileSync(new URL("../../include/noisefloor.h", import.meta.url), "utf8");
  for (const [name, { places }] of Object.entries(STRUCTS)) {
    const [, body] = new RegExp(`typedef struct \\{([^}]*)\\} ${name};`).exec(header);
    const fields = [...body.matchAll(/^ +(?:const )?(\w+) (\*?)(\w+);/gm)];
    assert.deepEqual(
      places.map(({ type, name }) => `${type} ${name}`),
      fields.map(([, type, star, name]) => `${type}${star} ${name}`),
    );
  }
  const constants = (pattern) =>
    [...header.matchAll(pattern)].map(([, name, value]) => [name, Number(value)]);
  const named = (names) => names.map((name, value) => [name.replace(/[A-Z]/, "_$&").toUpperCase(), value]);
  assert.deepEqual(
    constants(/ NF_STATUS_(\w+) = (\d+)/g),
    [...STATUS.entries()].map(([i, name]) => [name, i]),
  );
  assert.deepEqual(constants(/define NF_SCHEDULE_(\w+) (\d+)/g), named(SCHEDULES));
  assert.deepEqual(constants(/define NF_REASON_(\w+) (\d+)/g), named(REASONS));
});

test("only floats are radiance", () => {
  const session = new Session(64, 64, options);
  const half = (value) => {
    const exponent = Math.floor(Math.log2(value));
    return ((exponent + 15) << 10) | (Math.round(value * 2 ** (10 - exponent)) & 1023);
  };
  const refused = [
    [new Uint16Array(3 * 64 * 64).fill(half(0.5)), /halfFloats/],
    [new Uint8Array(3 * 64 * 64), /Uint8Array/],
    [new Uint8ClampedArray(3 * 64 * 64), /Uint8ClampedArray/],
    [new Int32Array(3 * 64 * 64), /Int32Array/],
    [new BigUint64Array(3 * 64 * 64), /BigUint64Array/],
    [new ArrayBuffer(12 * 64 * 64), /ArrayBuffer/],
    [new DataView(new ArrayBuffer(12 * 64 * 64)), /DataView/],
    [Array(3 * 64 * 64).fill("0.5"), /element 0 is a string/],
    [new Array(3 * 64 * 64), /element 0 is an undefined/],
    ["0".repeat(3 * 64 * 64), /String/],
  ];
  for (const [pixels, message] of refused) {
    assert.throws(() => session.push(pixels, { spp: 8 }), { code: "ARGUMENT", message });
    assert.throws(() => session.pushRunning(pixels, { spp: 8 }), { code: "ARGUMENT", message });
  }
  assert.ok(session.states().every(({ spp }) => spp === 0));
  const bits = Uint16Array.from({ length: 3 * 64 * 64 }, (_, i) => half(0.25 + (i % 50) / 64));
  session.push(bits, { spp: 8, halfFloats: true });
  session.image().forEach((value, i) => assert.equal(value, 0.25 + (i % 50) / 64));
  assert.throws(() => session.push(new Float32Array(3 * 64 * 64), { spp: 8, halfFloats: true }), {
    code: "ARGUMENT",
  });
  session.push(new Float64Array(3 * 64 * 64).fill(0.5), { spp: 8 });
  session.push(Array(3 * 64 * 64).fill(0.5), { spp: 8 });
  session.close();
});

test("half floats mean what they are", () => {
  const session = new Session(16, 16, { tile: 16 });
  const bits = new Uint16Array(3 * 16 * 16);
  bits.set([0x3c00, 0x0001, 0x7bff, 0x8000, 0x3555, 0x0400]);
  session.push(bits, { spp: 8, halfFloats: true });
  const [one, least, most, zero, third, normal] = session.image();
  assert.deepEqual([one, least, most, normal], [1, 2 ** -24, 65504, 2 ** -14]);
  assert.ok(zero === 0 && Math.abs(third - 1 / 3) < 1e-4);
  session.close();
});
