// noisefloor for JavaScript: sessions, over the WebAssembly of noisefloor-capi. noisefloor.d.ts documents
// what is exported. In this order: the module and its memory, errors, viewing, tone mappings, sessions.

import { decoded, whyNoRadiance } from "./pixels.js";

/** The module: what noisefloor.h declares, and `nf_alloc` and `nf_dealloc`. */
let wasm = null;
let loading = null;

export function load(source = new URL("./noisefloor.wasm", import.meta.url)) {
  loading ??= read(source)
    .then((code) => WebAssembly.instantiate(code))
    .then((loaded) => {
      wasm = (loaded.instance ?? loaded).exports; // a compiled module gives the instance itself
    })
    .catch((error) => {
      loading = null;
      throw error;
    });
  return loading;
}

async function read(source) {
  if (source instanceof WebAssembly.Module || source instanceof ArrayBuffer || ArrayBuffer.isView(source)) {
    return source;
  }
  // Node fetches no files. This is no import, so bundlers for pages do not look for one.
  const url = new URL(source, globalThis.location?.href ?? import.meta.url);
  const files = url.protocol === "file:" && globalThis.process?.getBuiltinModule?.("node:fs/promises");
  if (files) return files.readFile(url);
  const missing = (why) => new NoisefloorError("UNAVAILABLE", `${url} is not the module of noisefloor: ${why}`);
  const response = await fetch(url).catch(({ message }) => {
    throw missing(message);
  });
  if (!response.ok) throw missing(`${response.status} ${response.statusText}`);
  const code = await response.arrayBuffer();
  // Servers for development answer with a page for what they lack
  if (!WebAssembly.validate(code)) throw missing(response.headers.get("content-type"));
  return code;
}

export function version() {
  return text(loaded().nf_version());
}

function loaded() {
  if (!wasm) throw new NoisefloorError("UNAVAILABLE", "noisefloor is not loaded: await load() first");
  return wasm;
}

// Memory. Views end when the memory grows, so none outlives a call.

const view = () => new DataView(wasm.memory.buffer);

function text(at) {
  const bytes = new Uint8Array(wasm.memory.buffer, at);
  return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
}

/** Memory for the length of a call: `use(pointer)`. */
function withMemory(bytes, use) {
  const at = loaded().nf_alloc(bytes);
  if (!at) throw new NoisefloorError("MEMORY", `there is no memory for ${bytes} bytes`);
  try {
    return use(at);
  } finally {
    wasm.nf_dealloc(at, bytes);
  }
}

function withBytes(bytes, use) {
  return withMemory(bytes.length, (at) => {
    new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
    return use(at);
  });
}

const withText = (words, use) => withBytes(new TextEncoder().encode(`${words}\0`), use);

/** How C lays out a struct on wasm32, from its fields as the header has them: `type name; type name; …`. */
function struct(fields) {
  const sizes = { uint64_t: 8, double: 8, bool: 1 };
  const ends = (end, align) => Math.ceil(end / align) * align;
  const layout = { places: [], size: 0, align: 1 };
  for (const [type, name] of fields.split("; ").map((field) => field.split(" "))) {
    const nested = STRUCTS[type];
    const [size, align] = nested ? [nested.size, nested.align] : Array(2).fill(sizes[type] ?? 4);
    const at = ends(layout.size, align);
    layout.places.push({ type, name, at });
    layout.size = at + size;
    layout.align = Math.max(layout.align, align);
  }
  layout.size = ends(layout.size, layout.align);
  return layout;
}

/** Field by field as in noisefloor.h; a test holds them against it. */
export const STRUCTS = {};
STRUCTS.NfParams = struct(
  "uint32_t tile; uint32_t schedule; uint64_t step; uint64_t min_spp; uint64_t max_spp; " +
    "uint32_t consecutive; uint32_t tone_mapping; float key; float white; float exposure; " +
    "double audience_slope; double audience_offset; char* viewing; NfTone* tone",
);
STRUCTS.NfTile = struct("size_t index; size_t x; size_t y; size_t width; size_t height");
STRUCTS.NfRequest = struct("NfTile tile; uint64_t first; uint64_t spp; uint32_t sequence; uint64_t point");
STRUCTS.NfTileState = struct(
  "uint64_t spp; uint64_t expected_spp; float probability; uint32_t reason; uint32_t open_for; bool unfamiliar",
);
STRUCTS.NfSampleCounts = struct("uint64_t rejected; uint64_t negative; size_t warnings");

function readStruct(name, at, memory = view()) {
  const value = (type, place) => {
    if (STRUCTS[type]) return readStruct(type, place, memory);
    if (type === "uint64_t") return Number(memory.getBigUint64(place, true));
    if (type === "double") return memory.getFloat64(place, true);
    if (type === "float") return memory.getFloat32(place, true);
    return type === "bool" ? memory.getUint8(place) !== 0 : memory.getUint32(place, true);
  };
  return Object.fromEntries(
    STRUCTS[name].places.map((field) => [field.name, value(field.type, at + field.at)]),
  );
}

function writeStruct(name, at, values) {
  const memory = view();
  for (const field of STRUCTS[name].places) {
    const [value, place] = [values[field.name], at + field.at];
    if (value === undefined) continue;
    if (field.type === "uint64_t") memory.setBigUint64(place, whole(value, field.name), true);
    else if (field.type === "double") memory.setFloat64(place, value, true);
    else if (field.type === "float") memory.setFloat32(place, value, true);
    else memory.setUint32(place, Number(whole(value, field.name, 2 ** 32)), true);
  }
}

/** A number of the caller's that C takes as an integer, which would silently become another one. */
function whole(value, name, end = 2 ** 53) {
  if (Number.isInteger(value) && value >= 0 && value < end) return BigInt(value);
  throw new NoisefloorError("ARGUMENT", `${name} must be a whole number from 0 on, not ${value}`);
}

/** Reads what a call writes through its last pointer. */
function out(type, call) {
  return withMemory(8, (at) => {
    call(at);
    return type === "size_t" ? view().getUint32(at, true) : Number(view().getBigUint64(at, true));
  });
}

// Errors

/** By number, as NfStatus has them. */
export const STATUS = [
  ..."OK NULL_POINTER ARGUMENT SIZE BATCH MODEL CRITERION CHECKPOINT".split(" "),
  ..."IO UNAVAILABLE INTERNAL MEMORY FAULT HANDLE".split(" "),
];

export class NoisefloorError extends Error {
  constructor(code, message, options) {
    super(message, options);
    this.name = "NoisefloorError";
    this.code = code;
  }
}

/** Calls a function of the header, whose errors become exceptions. */
function call(name, ...values) {
  let status;
  try {
    status = loaded()[name](...values);
  } catch (cause) {
    if (!(cause instanceof WebAssembly.RuntimeError)) throw cause;
    // A panic, which cannot unwind here
    throw new NoisefloorError("INTERNAL", text(wasm.nf_last_error()) || cause.message, { cause });
  }
  if (status) throw new NoisefloorError(STATUS[status] ?? "INTERNAL", text(wasm.nf_last_error()));
}

// Viewing

const INCH = 0.0254;

export function viewing({ canvas, pixelRatio, distance = 0.6, cssInch = 96, ...screen } = {}) {
  // Pixels of the picture in one of CSS
  const shown = canvas?.getBoundingClientRect?.().width;
  const ratio = pixelRatio ?? (shown ? canvas.width / shown : (globalThis.devicePixelRatio ?? 1));
  const pixel = INCH / cssInch / ratio;
  const degrees = (2 * Math.atan(pixel / 2 / distance) * 180) / Math.PI;
  const keys = { ppd: Number((1 / degrees).toPrecision(6)), ...screen };
  return Object.entries(keys)
    .map(([key, value]) => `${key}=${value}`)
    .join(",");
}

// Tone mappings, from linear radiance to linear light of the screen; each has a source.

const each = (colour, change) => colour.map(change);
const clamp = (x) => Math.min(Math.max(x, 0), 1);
const times = (rows, [r, g, b]) => rows.map(([x, y, z]) => x * r + y * g + z * b);

/** Reinhard et al. 2002, eq. 3, on each channel. */
const reinhard = (colour) => each(colour, (x) => x / (1 + x));

/** Hejl and Burgess-Dawson's fit of a film, whose sRGB is undone by a power of 2.2 (Hable 2010). */
function cineon(colour) {
  return each(colour, (radiance) => {
    const x = Math.max(0, radiance - 0.004);
    return ((x * (6.2 * x + 0.5)) / (x * (6.2 * x + 1.7) + 0.06)) ** 2.2;
  });
}

/** Hill's fit of ACES' reference rendering and output transforms (2015), brighter by 1/0.6 as in three.js. */
function aces(colour) {
  const input = [
    [0.59719, 0.35458, 0.04823],
    [0.076, 0.90834, 0.01566],
    [0.0284, 0.13383, 0.83777],
  ];
  const output = [
    [1.60475, -0.53108, -0.07367],
    [-0.10208, 1.10813, -0.00605],
    [-0.00327, -0.07276, 1.07602],
  ];
  const fit = (v) => (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081);
  const bright = each(colour, (x) => x / 0.6);
  return times(output, each(times(input, bright), fit));
}

/** Sobotka's AgX with Rec. 2020 primaries, as Filament and three.js have it; Wrensch's polynomial (2023). */
function agx(colour) {
  const toRec2020 = [
    [0.6274, 0.3293, 0.0433],
    [0.0691, 0.9195, 0.0113],
    [0.0164, 0.088, 0.8956],
  ];
  const fromRec2020 = [
    [1.6605, -0.5876, -0.0728],
    [-0.1246, 1.1329, -0.0083],
    [-0.0182, -0.1006, 1.1187],
  ];
  const inset = [
    [0.856627153315983, 0.0951212405381588, 0.0482516061458583],
    [0.137318972929847, 0.761241990602591, 0.101439036467562],
    [0.11189821299995, 0.0767994186031903, 0.811302368396859],
  ];
  const outset = [
    [1.1271005818144368, -0.11060664309660323, -0.016493938717834573],
    [-0.1413297634984383, 1.157823702216272, -0.016493938717834257],
    [-0.14132976349843826, -0.11060664309660294, 1.2519364065950405],
  ];
  // Stops around middle grey: 0.18 * 2^-10 to 0.18 * 2^6.5
  const [low, high] = [-12.47393, 4.026069];
  const sigmoid = (x) =>
    (((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x - 0.00232;
  const logarithm = (x) => clamp((Math.log2(Math.max(x, 1e-10)) - low) / (high - low));
  const looked = each(times(inset, times(toRec2020, colour)), (x) => sigmoid(logarithm(x)));
  return times(
    fromRec2020,
    each(times(outset, looked), (x) => Math.max(0, x) ** 2.2),
  );
}

/** Khronos PBR Neutral (2024). */
function neutral(colour) {
  const [start, desaturation] = [0.8 - 0.04, 0.15];
  const least = Math.min(...colour);
  const offset = least < 0.08 ? least - 6.25 * least * least : 0.04;
  const lowered = each(colour, (x) => x - offset);
  const peak = Math.max(...lowered);
  if (peak < start) return lowered;
  const d = 1 - start;
  const newPeak = 1 - (d * d) / (peak + d - start);
  const share = 1 - 1 / (desaturation * (peak - newPeak) + 1);
  return each(lowered, (x) => ((x * newPeak) / peak) * (1 - share) + newPeak * share);
}

export const curves = { reinhard, cineon, aces, agx, neutral };

/** Names by the constants of three.js. */
const OF_THREE = ["linear", "linear", "reinhard", "cineon", "aces", undefined, "agx", "neutral"];

export function toneMappingOf({ toneMapping, toneMappingExposure }) {
  const curve = OF_THREE[toneMapping];
  if (!curve) {
    throw new NoisefloorError(
      "ARGUMENT",
      `tone mapping ${toneMapping} of three.js has no curve: give your own`,
    );
  }
  return { curve, exposure: toneMapping === 0 ? 1 : toneMappingExposure };
}

const encode = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);

// Shape of a tone table: a third of a stop between entries, finer towards black; curves are flat from 256 on.
const EDGE = 49;
const TOE = 2 ** -8;
const STOPS = 16;
const TOP = TOE * (2 ** STOPS - 1);
const tables = new Map();

export function toneTable(curve) {
  if (!tables.has(curve)) {
    // nf_tone_of_table: log2 made linear between powers of two
    const axis = Array.from({ length: EDGE }, (_, i) => {
      const stops = (STOPS * i) / (EDGE - 1);
      return TOE * (2 ** Math.floor(stops) * (1 + (stops % 1)) - 1);
    });
    const table = new Float32Array(3 * EDGE ** 3);
    let place = 0;
    for (const b of axis) {
      for (const g of axis) {
        for (const r of axis) {
          table.set(
            each(curve([r, g, b]), (x) => encode(clamp(x))),
            place,
          );
          place += 3;
        }
      }
    }
    tables.set(curve, table);
  }
  return tables.get(curve);
}

// Sessions

/**
 * Share of people who see no noise in a tile that is done. What the header calls it today stands here alone.
 */
const PEOPLE = 0.95;
const withOracle = (people, use) => {
  const oracle = out("size_t", (at) => call("nf_oracle_bundled", people, at));
  try {
    return use(oracle);
  } finally {
    call("nf_oracle_free", oracle);
  }
};

/** By number, as the header has them; so are reasons. */
export const SCHEDULES = ["every", "spaced", "growing"];
export const REASONS = ["open", "converged", "maxSpp", "timeLimit", "cancelled", "failed"];
export const OPEN_FOR = [null, "noise", "exposure", "unmetLight", "fewSamples", "doubt"];
const SRGB = 1;

const position = (names, name, what) => {
  const place = names.indexOf(name);
  if (place < 0) {
    throw new NoisefloorError("ARGUMENT", `${name} is no ${what}; there are ${names.join(", ")}`);
  }
  return place;
};

/** What a session can be told; a slip of the pen would leave the default in place. */
const OPTIONS = {
  "": [
    ...["people", "tile", "schedule", "step", "minSpp", "maxSpp", "consecutive", "audience", "viewing"],
    ...["toneMapping", "sharedPixels", "linear", "onWarning"],
  ],
  audience: ["slope", "offset"],
  toneMapping: ["curve", "exposure", "key", "white"],
};

/** Refuses what is not among `OPTIONS`. */
function known(options) {
  for (const [group, names] of Object.entries(OPTIONS)) {
    const given = group ? options[group] : options;
    const wrong = Object.keys(given ?? {}).find((name) => !names.includes(name));
    if (wrong === undefined) continue;
    const path = group ? `${group}.${wrong}` : wrong;
    throw new NoisefloorError("ARGUMENT", `there is no option ${path}; there are ${names.join(", ")}`);
  }
}

/** Options by the names of the header. Those not given keep the defaults of Rust. */
function fields({ tile, schedule, step, minSpp, maxSpp, consecutive, audience, toneMapping }, tone) {
  return {
    tile,
    schedule: schedule === undefined ? undefined : position(SCHEDULES, schedule, "schedule"),
    step,
    min_spp: minSpp,
    max_spp: maxSpp,
    consecutive,
    audience_slope: audience?.slope,
    audience_offset: audience?.offset,
    key: toneMapping?.key,
    white: toneMapping?.white,
    tone_mapping: toneMapping?.curve === "linear" ? SRGB : undefined,
    exposure: toneMapping?.curve ? toneMapping.exposure : undefined,
    tone,
  };
}

/** Makes what `use` needs of a curve, and frees it then: sessions keep what they need. */
function withTone({ curve = "linear" } = {}, use) {
  if (curve === "linear") return use(undefined);
  const known = typeof curve === "string" ? curves[curve] : curve;
  const made = known instanceof Float32Array; // a table of toneTable(), from background.js
  if (!made && typeof known !== "function") {
    position(["linear", ...Object.keys(curves)], curve, "tone curve");
  }
  const table = made ? known : toneTable(known);
  const tone = withBytes(new Uint8Array(table.buffer), (at) =>
    out("size_t", (place) => call("nf_tone_of_table", TOE, TOP, at, table.length, EDGE, place)),
  );
  try {
    return use(tone);
  } finally {
    wasm.nf_tone_free(tone);
  }
}

const forgotten = new FinalizationRegistry(({ handle, name }) => {
  console.warn(`noisefloor: ${name} was forgotten; close() frees its memory sooner`);
  wasm.nf_session_free(handle);
});

export class Session {
  #handle = 0;
  #broken = null;
  #tiles;
  #told = 0;
  #onWarning;
  #done = new Map();

  static async open(width, height, options) {
    await load();
    return new Session(width, height, options);
  }

  constructor(width, height, options = {}) {
    known(options);
    this.width = width;
    this.height = height;
    this.#onWarning = options.onWarning ?? ((text) => console.warn(`noisefloor: ${text}`));
    const size = [Number(whole(width, "width", 2 ** 32)), Number(whole(height, "height", 2 ** 32))];
    const shape = STRUCTS.NfParams;
    const make = (oracle, tone) =>
      withMemory(shape.size, (params) => {
        call("nf_params_default", params);
        writeStruct("NfParams", params, fields(options, tone));
        this.maxSpp = readStruct("NfParams", params).max_spp;
        const make = (place) => call("nf_session_new", ...size, oracle, params, place);
        if (options.viewing === undefined) return out("size_t", make);
        return withText(options.viewing, (viewing) => {
          const { at } = shape.places.find((field) => field.name === "viewing");
          view().setUint32(params + at, viewing, true);
          return out("size_t", make);
        });
      });
    this.#handle = withTone(options.toneMapping, (tone) =>
      withOracle(options.people ?? PEOPLE, (oracle) => make(oracle, tone)),
    );
    forgotten.register(
      this,
      { handle: this.#handle, name: `a session of ${width}x${height} pixels` },
      this,
    );
    try {
      if (options.sharedPixels) this.#call("nf_session_share_pixels", 1);
      if (options.linear) this.#call("nf_session_set_linear");
    } catch (error) {
      this.close();
      throw error;
    }
  }

  close() {
    if (!this.#handle) return;
    forgotten.unregister(this);
    wasm.nf_session_free(this.#handle);
    this.#handle = 0;
  }

  [Symbol.dispose ?? Symbol.for("Symbol.dispose")]() {
    this.close();
  }

  #call(name, ...values) {
    if (this.#broken) throw this.#broken;
    try {
      if (!this.#handle) throw new NoisefloorError("HANDLE", "the session is closed");
      call(name, this.#handle, ...values);
    } catch (error) {
      if (error.code === "INTERNAL") this.#broken = error;
      throw error;
    }
  }

  get tiles() {
    this.#tiles ??= Array.from({ length: wasm.nf_session_tile_count(this.#handle) }, (_, index) =>
      withMemory(STRUCTS.NfTile.size, (at) => {
        this.#call("nf_session_tile", index, at);
        return Object.freeze(readStruct("NfTile", at));
      }),
    );
    return this.#tiles;
  }

  #many(type, name, all = true) {
    const [count, { size }] = [this.tiles.length, STRUCTS[type]];
    return withMemory(count * size, (at) => {
      let found = count;
      if (all) this.#call(name, at, count);
      else found = out("size_t", (place) => this.#call(name, at, count, place));
      return Array.from({ length: found }, (_, i) => readStruct(type, at + i * size));
    });
  }

  requests() {
    return this.#many("NfRequest", "nf_session_requests", false);
  }

  get nextSpp() {
    return Math.min(...this.requests().map(({ first, spp }) => first + spp));
  }

  push(pixels, { spp, ...place }) {
    this.#push("nf_session_push", pixels, whole(spp, "spp"), place);
  }

  pushRunning(pixels, { spp, ...place }) {
    this.#push("nf_session_push_running", pixels, whole(spp, "spp"), place);
  }

  /**
   * Takes tiles out of the caller's pixels, the way C reads them: rows from the top, three floats a pixel.
   */
  #push(name, given, spp, { tile, channels, stride, fromBottom = false, halfFloats = false }) {
    const wrong = whyNoRadiance(given, halfFloats);
    if (wrong) throw new NoisefloorError("ARGUMENT", wrong);
    const pixels = halfFloats ? decoded(given) : given;
    const source =
      tile === undefined ? { x: 0, y: 0, width: this.width, height: this.height } : this.#tile(tile);
    const [got, needed] = [pixels.length, source.width * source.height];
    if (channels === undefined && stride === undefined) channels = got / needed;
    channels ??= 3;
    stride ??= channels * source.width;
    const wanted = stride * (source.height - 1) + channels * source.width;
    if ((channels !== 3 && channels !== 4) || stride < channels * source.width || got < wanted) {
      const shape = `${source.width}x${source.height} pixels of 3 or 4 channels`;
      throw new NoisefloorError("SIZE", `${got} floats with a stride of ${stride} do not hold ${shape}`);
    }
    for (const part of tile === undefined ? this.tiles : [source]) {
      const floats = 3 * part.width * part.height;
      withMemory(4 * floats, (at) => {
        const mean = new Float32Array(wasm.memory.buffer, at, floats);
        let to = 0;
        for (let y = part.y - source.y; y < part.y - source.y + part.height; y++) {
          const row = (fromBottom ? source.height - 1 - y : y) * stride;
          let from = row + (part.x - source.x) * channels;
          for (const end = to + 3 * part.width; to < end; from += channels) {
            mean[to++] = pixels[from];
            mean[to++] = pixels[from + 1];
            mean[to++] = pixels[from + 2];
          }
        }
        this.#call(name, part.index, spp, at, floats);
      });
    }
  }

  #tile(tile) {
    const index = typeof tile === "object" ? tile.index : tile;
    const found = this.tiles[index];
    if (!found) {
      throw new NoisefloorError("BATCH", `tile ${index} does not exist: there are ${this.tiles.length}`);
    }
    return found;
  }

  judge() {
    this.#call("nf_session_judge", 0);
    // A tile can be open again, when the exposure moves, and be done a second time
    const stops = this.stops();
    const fresh = stops.filter(({ tile, spp }) => this.#done.get(tile.index) !== spp);
    this.#remember(stops);
    const warnings = this.warnings();
    for (; this.#told < warnings.length; this.#told++) this.#onWarning(warnings[this.#told]);
    return fresh;
  }

  #remember(stops) {
    this.#done = new Map(stops.map(({ tile, spp }) => [tile.index, spp]));
  }

  states() {
    return this.#many("NfTileState", "nf_session_states").map((state, index) => ({
      tile: this.tiles[index],
      spp: state.spp,
      expectedSpp: state.expected_spp || null,
      probability: Number.isNaN(state.probability) ? null : state.probability,
      reason: REASONS[state.reason],
      openFor: OPEN_FOR[state.open_for],
      unfamiliar: state.unfamiliar,
    }));
  }

  stops() {
    return this.states().filter((state) => state.reason !== "open");
  }

  get openTiles() {
    return out("size_t", (at) => this.#call("nf_session_open_tiles", at));
  }

  get isDone() {
    return this.openTiles === 0;
  }

  closeAll(reason = "cancelled") {
    this.#call("nf_session_close_all", position(REASONS, reason, "reason"));
  }

  warnings() {
    const { warnings } = this.sampleCounts();
    const bytes = 1000;
    return Array.from({ length: warnings }, (_, index) =>
      withMemory(bytes, (at) => {
        this.#call("nf_session_warning", index, at, bytes);
        return text(at);
      }),
    );
  }

  sampleCounts() {
    return withMemory(STRUCTS.NfSampleCounts.size, (at) => {
      this.#call("nf_session_sample_counts", at);
      return readStruct("NfSampleCounts", at);
    });
  }

  image() {
    return this.#picture("nf_session_image", 3);
  }

  visibleNoise() {
    return this.#picture("nf_session_visible_noise", 1);
  }

  #picture(name, channels) {
    const floats = channels * this.width * this.height;
    return withMemory(4 * floats, (at) => {
      this.#call(name, at, floats);
      return new Float32Array(wasm.memory.buffer, at, floats).slice();
    });
  }

  checkpoint(job) {
    return withText(job, (job) => {
      const size = out("size_t", (place) => this.#call("nf_session_checkpoint", job, 0, 0, place));
      return withMemory(size, (at) => {
        out("size_t", (place) => this.#call("nf_session_checkpoint", job, at, size, place));
        return new Uint8Array(wasm.memory.buffer, at, size).slice();
      });
    });
  }

  resume(job, checkpoint) {
    withText(job, (job) =>
      withBytes(checkpoint, (at) => this.#call("nf_session_restore", job, at, checkpoint.length)),
    );
    this.#remember(this.stops());
    this.#told = 0;
  }
}
