/** A session in a worker, so that the page never waits for a verdict. */

import type { Layout, Pixels, SessionOptions, TileState } from "./noisefloor.js";

export interface BackgroundOptions extends SessionOptions {
  /** Passes that may wait behind the one that is being judged: 1 unless given, and at least 1. */
  waiting?: number;
  /**
   * With "wait" (unless given), the promise of a push is kept when there is room for another pass. With "merge" it
   * always is: the pass is added to one that waits. Which passes become one depends on time then.
   */
  whenFull?: "wait" | "merge";
  /** A worker that runs `worker.js` of this package, where a bundler does not find it. */
  worker?: Worker;
}

/**
 * A session on a thread of its own. Stops are those of the same session on the page, and come later. Errors of a push
 * or of a verdict, such as "FAULT", come as the error of the next call.
 */
export class BackgroundSession {
  static open(width: number, height: number, options?: BackgroundOptions): Promise<BackgroundSession>;
  readonly width: number;
  readonly height: number;
  /** Passes that were handed over and are not judged yet. */
  readonly pending: number;
  /** As of the last pass that was judged: samples per pixel at which a tile wants the next push. */
  readonly nextSpp: number;
  /**
   * Samples per pixel that open tiles can still get before they stop at `maxSpp`, beside all that was handed over. A page
   * that has rendered as many waits for the verdict, by `finish()`: what it would render meanwhile is beyond the stop. 0
   * when all tiles are done, or will be with the passes that are pending, as far as is known.
   */
  readonly sppLeft: number;
  /** As of the last pass that was judged. */
  readonly isDone: boolean;
  /** Where all tiles stand, as of the last pass that was judged. */
  readonly states: readonly TileState[];
  /** What is likely to be wrong with the samples, as of the last pass that was judged. */
  readonly warnings: readonly string[];
  /**
   * An array for the next pass: one that the worker has read, if there is one. What is in it is of no use. A Uint16Array
   * holds the bits of half floats.
   */
  buffer(values: number): Float32Array;
  buffer(values: number, kind: typeof Uint16Array): Uint16Array;
  /**
   * Hands over the mean of `spp` new samples per pixel, to be judged. A Float32Array, or a Uint16Array of half floats, goes
   * to the worker without a copy, and cannot be used here any more: take the next one from `buffer`. What is no radiance is
   * an error "ARGUMENT", as of `Session`.
   */
  push(pixels: Pixels, batch: Layout & { spp: number }): Promise<void>;
  /** The same with the mean of all `spp` samples per pixel so far. */
  pushRunning(pixels: Pixels, batch: Layout & { spp: number }): Promise<void>;
  /** When no pass waits: where all tiles stand. */
  finish(): Promise<readonly TileState[]>;
  /** As those of `Session`, behind the passes that were handed over. */
  image(): Promise<Float32Array>;
  visibleNoise(): Promise<Float32Array>;
  sampleCounts(): Promise<{ rejected: number; negative: number; warnings: number }>;
  checkpoint(job: string): Promise<Uint8Array>;
  resume(job: string, checkpoint: Uint8Array): Promise<void>;
  closeAll(reason?: "timeLimit" | "cancelled" | "failed"): Promise<void>;
  /** Ends the worker; what was not judged is lost. */
  close(): void;
  [Symbol.dispose](): void;
}
