/// <reference lib="esnext.disposable" />
/** noisefloor tells a progressive renderer, tile by tile, when people stop seeing noise. */

/**
 * Loads the module, once, however often it is called; `Session.open` does so, too. `source` is where
 * `noisefloor.wasm` lies, if not beside this file, or its bytes, or the compiled module.
 */
export function load(source?: string | URL | ArrayBuffer | Uint8Array | WebAssembly.Module): Promise<void>;

/** The version of the library, such as "0.1.0". */
export function version(): string;

/** What Rust says went wrong. */
export class NoisefloorError extends Error {
  /**
   * Without the prefix, an NfStatus of noisefloor.h, such as "FAULT" if samples cannot be what they should
   * be.
   */
  readonly code:
    | "NULL_POINTER"
    | "ARGUMENT"
    | "SIZE"
    | "BATCH"
    | "MODEL"
    | "CRITERION"
    | "CHECKPOINT"
    | "IO"
    | "UNAVAILABLE"
    | "INTERNAL"
    | "MEMORY"
    | "FAULT"
    | "HANDLE";
  constructor(code: string, message: string, options?: ErrorOptions);
}

/** Linear red, green and blue with the primaries of Rec. 709. */
export type Colour = [number, number, number];

/** From exposed radiance, at least 0, to linear light of an sRGB screen, which is clamped to 0..1. */
export type Curve = (colour: Colour) => Colour;

/** The tone mappings of three.js, but for linear, which needs no curve. Exposure comes before. */
export const curves: Readonly<Record<"reinhard" | "cineon" | "aces" | "agx" | "neutral", Curve>>;

/** How the page shows radiance. What people see depends on it. */
export type ToneMapping =
  /** A curve of three.js, or one of your own, and its exposure (1 unless given). */
  | { curve: "linear" | keyof typeof curves | Curve; exposure?: number }
  /**
   * The photographic operator, with an exposure by the log-average of the picture (key 0.18 unless given).
   */
  | { curve?: undefined; key?: number; white?: number };

/** The tone mapping of a renderer of three.js. */
export function toneMappingOf(renderer: { toneMapping: number; toneMappingExposure: number }): ToneMapping;

/** What a session asks for: 49^3 display values of a curve, red fastest. Computed once for each curve. */
export function toneTable(curve: Curve): Float32Array;

export interface Viewing {
  /** The canvas that shows the picture: its width says how many pixels of the picture one of CSS has. */
  canvas?: HTMLCanvasElement;
  /** The same without a canvas: devicePixelRatio unless given. */
  pixelRatio?: number;
  /** From the eye to the screen, in metres: 0.6 unless given. */
  distance?: number;
  /** CSS pixels in an inch held to the screen: 96 unless given. A page cannot know; it can ask its user. */
  cssInch?: number;
  /** White, in cd/m². */
  peak?: number;
  /** Black, in cd/m². */
  black?: number;
  /** Light around, in lux. */
  ambient?: number;
}

/** How large pixels of the page look, for `SessionOptions.viewing`. */
export function viewing(viewing?: Viewing): string;

/** What is not given has the default of Rust. */
export interface SessionOptions {
  /** Share of people who see no noise in a tile that is done: 0.95 unless given. */
  people?: number;
  /** Edge of a tile in pixels, 16 to 512: 128 unless given. */
  tile?: number;
  /** When tiles are judged: "spaced" unless given. */
  schedule?: "every" | "spaced" | "growing";
  /** The step of the schedule in samples per pixel: 8 unless given. */
  step?: number;
  /** Fewest samples per pixel at which a tile may stop: 16 unless given. */
  minSpp?: number;
  /** Samples per pixel at which every tile stops: 10000 unless given. */
  maxSpp?: number;
  /** Verdicts in a row that must say "converged": 1 unless given. */
  consecutive?: number;
  /** Whose thresholds, as a line from those of the observers in the training data. */
  audience?: { slope: number; offset: number };
  /**
   * On which screen the picture is seen, and from how far: "desk" (unless given), `viewing()`, or any text.
   */
  viewing?: string;
  toneMapping?: ToneMapping;
  /** Whether neighbouring pixels have noise in common, as with a pixel filter: no warning says so then. */
  sharedPixels?: boolean;
  /**
   * Says that what is pushed is linear radiance, so that no warning asks: where all batches have
   * one size, nothing tells that from values that were encoded for a screen.
   */
  linear?: boolean;
  /** Gets each warning once, in `judge`: what is likely wrong with the samples. Unless given, the console does. */
  onWarning?: (text: string) => void;
}

/** A rectangle of pixels that stops as a whole. Tiles lie in rows from the top left. */
export interface Tile {
  readonly index: number;
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** What an open tile needs next. */
export interface Request {
  tile: Tile;
  /** Number of the first new sample. */
  first: number;
  /** New samples per pixel. Fewer or more are fine. */
  spp: number;
  /** For quasi-random points: which sequence of the pixel the samples belong to, 0 or 1. */
  sequence: number;
  /** Index of the first new point in that sequence. */
  point: number;
}

/** Where a tile stands. */
export interface TileState {
  tile: Tile;
  /** Samples per pixel; if the tile is done, when it stopped. */
  spp: number;
  /** Samples per pixel at which the tile is expected to be done. */
  expectedSpp: number | null;
  /** Probability that an observer sees no noise, by the last verdict. */
  probability: number | null;
  /** "open", or why the tile is done. */
  reason: "open" | "converged" | "maxSpp" | "timeLimit" | "cancelled" | "failed";
  /** What keeps the tile from being done, or has kept it until a limit. */
  openFor: null | "noise" | "exposure" | "unmetLight" | "fewSamples" | "doubt";
  /** Whether the texture is unlike all that the model was trained on: treat the verdict with care. */
  unfamiliar: boolean;
}

/** How pixels lie in an array. */
export interface Layout {
  /**
   * The tile that the pixels are of, or its number. Without: the whole picture, and every tile takes its
   * part.
   */
  tile?: Tile | number;
  /** Floats of a pixel, of which the first three are red, green and blue: by the length unless given. */
  channels?: 3 | 4;
  /** Floats from one row to the next: channels times width unless given. */
  stride?: number;
  /** Whether the first row is the bottom one, as WebGL reads pixels. */
  fromBottom?: boolean;
  /** Whether the pixels are the bits of half floats, as three.js reads a target of HalfFloatType. */
  halfFloats?: boolean;
}

/** Radiance. Integers are none: an `ARGUMENT` error, but for the bits of half floats (`halfFloats`). */
export type Pixels = Float32Array | Float64Array | readonly number[] | Uint16Array;

/**
 * Film, oracle and limits of one picture. It belongs to the thread that made it; a worker may have one of
 * its own. Memory is freed by `close()`, by `using`, or, with a warning on the console, some time after it
 * was forgotten.
 */
export class Session {
  /** Loads the module if need be. */
  static open(width: number, height: number, options?: SessionOptions): Promise<Session>;
  /** After `await load()`. */
  constructor(width: number, height: number, options?: SessionOptions);
  readonly width: number;
  readonly height: number;
  readonly tiles: readonly Tile[];
  /** Samples per pixel at which every tile stops. */
  readonly maxSpp: number;
  /** What the open tiles need next. */
  requests(): Request[];
  /**
   * For renderers of whole frames: samples per pixel at which a tile wants the next push; Infinity when all
   * are done.
   */
  readonly nextSpp: number;
  /** Adds the mean of `spp` new samples per pixel. */
  push(pixels: Pixels, batch: Layout & { spp: number }): void;
  /** Adds what is new in the mean of all `spp` samples per pixel so far. */
  pushRunning(pixels: Pixels, batch: Layout & { spp: number }): void;
  /** Judges the tiles that are due, and returns those that are now done; hands over new warnings. */
  judge(): TileState[];
  /** Where all tiles stand. */
  states(): TileState[];
  /** The tiles that are done. */
  stops(): TileState[];
  readonly openTiles: number;
  readonly isDone: boolean;
  /** Ends every open tile. */
  closeAll(reason?: "timeLimit" | "cancelled" | "failed"): void;
  /** What is likely to be wrong with the samples, as of the last `judge`. */
  warnings(): string[];
  /** Samples, over all pixels, that were left out as not finite, or were negative. */
  sampleCounts(): { rejected: number; negative: number; warnings: number };
  /** The mean of all samples: rows from the top, three floats a pixel. */
  image(): Float32Array;
  /** How visible the noise is at each pixel, 1 where it is just seen; NaN where there is no evidence. */
  visibleNoise(): Float32Array;
  /** A snapshot for `resume`. `job` names all that the samples depend on: scene, seed, options. */
  checkpoint(job: string): Uint8Array;
  /** Puts a session of the same size and options back. On failure it is as it was. */
  resume(job: string, checkpoint: Uint8Array): void;
  /** Frees its memory; a second time is nothing. */
  close(): void;
  [Symbol.dispose](): void;
}
