// noisefloor for JavaScript: a session in a worker, so that the page never waits for a verdict. background.d.ts
// documents what is exported; worker.js is the other end.

import { NoisefloorError, toneTable } from "./noisefloor.js";
import { decoded, whyNoRadiance } from "./pixels.js";

const node = globalThis.process?.getBuiltinModule?.("node:worker_threads");

/** Bundlers look for this expression. */
function workerOfPackage() {
  if (node) return new node.Worker(new URL("./worker.js", import.meta.url));
  return new Worker(new URL("./worker.js", import.meta.url), { type: "module", name: "noisefloor" });
}

/** Functions cannot go to a worker; what a session makes of a curve can. */
function clonable({ toneMapping, onWarning, ...options }) {
  if (typeof toneMapping?.curve !== "function") return { ...options, toneMapping };
  return { ...options, toneMapping: { ...toneMapping, curve: toneTable(toneMapping.curve) } };
}

/** Values of their own, which can be handed over without a copy. */
function owned(pixels, Kind) {
  const whole = pixels instanceof Kind && pixels.byteLength === pixels.buffer.byteLength;
  return whole ? pixels : Kind.from(pixels);
}

const sameLayout = (a, b) =>
  ["running", "tile", "channels", "stride", "fromBottom", "halfFloats"].every((key) => a[key] === b[key]) &&
  a.pixels.length === b.pixels.length;

/** One pass of all samples of two; a running mean has those before in it. */
function merged(before, pass) {
  if (pass.running) return pass;
  const spp = before.spp + pass.spp;
  const [old, share] = [before.pixels, pass.spp / spp];
  for (let i = 0; i < old.length; i++) old[i] += (pass.pixels[i] - old[i]) * share;
  return { ...before, spp };
}

export class BackgroundSession {
  #worker;
  #waiting;
  #merges;
  #onWarning;
  #state = { nextSpp: Infinity, isDone: false, states: [], warnings: [] };
  /** Passes in the worker, the first first, without their pixels, and the one that waits for room in it. */
  #sent = [];
  #held = null;
  #failed = null;
  /** Whoever waits: for room, or for answers by their number. */
  #turns = [];
  #answers = new Map();
  #asked = 0;
  #spent = [];

  static async open(width, height, { waiting = 1, whenFull = "wait", worker, ...options } = {}) {
    if (!["wait", "merge"].includes(whenFull)) {
      throw new NoisefloorError("ARGUMENT", `${whenFull} is no whenFull; there are wait, merge`);
    }
    const session = new BackgroundSession(worker ?? workerOfPackage(), options.onWarning);
    session.#waiting = Math.max(1, waiting);
    session.#merges = whenFull === "merge";
    [session.width, session.height] = [width, height];
    try {
      await session.#ask({ open: [width, height, clonable(options)] });
    } catch (error) {
      session.close();
      throw error;
    }
    return session;
  }

  constructor(worker, onWarning = (text) => console.warn(`noisefloor: ${text}`)) {
    this.#worker = worker;
    this.#onWarning = onWarning;
    const receive = (message) => this.#receive(message);
    // A browser does not say what it could not load
    const unsaid = `worker.js of noisefloor, or a module that it imports, cannot be loaded; this one is ${import.meta.url}`;
    const broken = ({ message }) =>
      this.#fail(new NoisefloorError(message ? "INTERNAL" : "UNAVAILABLE", message ? `the worker ended: ${message}` : unsaid));
    if (worker.on) worker.on("message", receive).on("error", broken);
    else [worker.onmessage, worker.onerror] = [({ data }) => receive(data), broken];
  }

  get pending() {
    return this.#sent.length + (this.#held ? 1 : 0);
  }

  get sppLeft() {
    const passes = this.#held ? [...this.#sent, this.#held] : this.#sent;
    const after = (had, { running, spp }) => (running ? Math.max(had, spp) : had + spp);
    const lefts = this.states
      .filter(({ reason }) => reason === "open")
      .map(({ tile, spp }) => {
        const ofTile = passes.filter((pass) => pass.tile === undefined || pass.tile === tile.index);
        return this.#state.maxSpp - ofTile.reduce(after, spp);
      });
    // A tile that has as many and is open is so for a reason: one of its halves may be empty
    return Math.max(passes.length || this.isDone ? 0 : 1, ...lefts);
  }

  get nextSpp() {
    return this.#state.nextSpp;
  }

  get isDone() {
    return this.#state.isDone;
  }

  get states() {
    return this.#state.states;
  }

  get warnings() {
    return this.#state.warnings;
  }

  buffer(values, Kind = Float32Array) {
    const place = this.#spent.findIndex((pixels) => pixels.length === values && pixels instanceof Kind);
    return place < 0 ? new Kind(values) : this.#spent.splice(place, 1)[0];
  }

  push(pixels, batch) {
    return this.#push({ ...batch, pixels, running: false });
  }

  pushRunning(pixels, batch) {
    return this.#push({ ...batch, pixels, running: true });
  }

  async #push(pass) {
    if (this.#failed) throw this.#failed;
    if (typeof pass.tile === "object") pass.tile = pass.tile.index;
    const wrong = whyNoRadiance(pass.pixels, pass.halfFloats);
    if (wrong) throw new NoisefloorError("ARGUMENT", wrong);
    if (pass.halfFloats && this.#merges && !pass.running) {
      // Bits cannot be added up
      [pass.pixels, pass.halfFloats] = [decoded(pass.pixels), false];
    }
    pass.pixels = owned(pass.pixels, pass.halfFloats ? Uint16Array : Float32Array);
    if (this.#merges && this.#held && sameLayout(this.#held, pass)) {
      const before = this.#held;
      this.#held = merged(before, pass);
      this.#keep((this.#held.pixels === before.pixels ? pass : before).pixels);
      return;
    }
    if (this.#merges && !this.#held && this.#sent.length > this.#waiting) {
      this.#held = pass;
      return;
    }
    this.#send(pass);
    await this.#until(() => this.#sent.length <= this.#waiting);
  }

  #send(pass) {
    const { tile, running, spp } = pass;
    this.#sent.push({ tile, running, spp });
    this.#worker.postMessage({ pass }, [pass.pixels.buffer]);
  }

  async finish() {
    await this.#until(() => this.pending === 0);
    return this.states;
  }

  image = () => this.#ask({ call: "image" });
  visibleNoise = () => this.#ask({ call: "visibleNoise" });
  sampleCounts = () => this.#ask({ call: "sampleCounts" });
  checkpoint = (job) => this.#ask({ call: "checkpoint", values: [job] });
  resume = (job, checkpoint) => this.#ask({ call: "resume", values: [job, checkpoint] });
  closeAll = (reason = "cancelled") => this.#ask({ call: "closeAll", values: [reason] });

  close() {
    this.#failed ??= new NoisefloorError("HANDLE", "the session is closed");
    this.#worker.terminate();
    this.#fail(this.#failed);
  }

  [Symbol.dispose ?? Symbol.for("Symbol.dispose")]() {
    this.close();
  }

  async #until(condition) {
    while (!this.#failed && !condition()) await new Promise((resolve) => this.#turns.push(resolve));
    if (this.#failed) throw this.#failed;
  }

  /** Something for the session behind the passes that it has; a pass that waits for room goes before. */
  #ask(message) {
    if (this.#failed) return Promise.reject(this.#failed);
    if (this.#held) this.#send(this.#held);
    this.#held = null;
    const number = ++this.#asked;
    return new Promise((resolve, reject) => {
      this.#answers.set(number, { resolve, reject });
      this.#worker.postMessage({ ...message, number });
    });
  }

  #receive({ state, pixels, number, answer, error }) {
    const failure = error && new NoisefloorError(error.code, error.message);
    if (state) this.#state = state;
    if (state) state.fresh.forEach((text) => this.#onWarning(text));
    if (number !== undefined) {
      const { resolve, reject } = this.#answers.get(number);
      this.#answers.delete(number);
      if (failure) reject(failure);
      else resolve(answer);
    } else if (failure) {
      this.#fail(failure);
    } else {
      this.#sent.shift();
      this.#keep(pixels);
      if (this.#held && this.#sent.length <= this.#waiting) {
        this.#send(this.#held);
        this.#held = null;
      }
    }
    this.#turns.splice(0).forEach((resolve) => resolve());
  }

  /** Two are in use while a page fills one and the worker reads another. */
  #keep(pixels) {
    this.#spent = [pixels, ...this.#spent].slice(0, 2);
  }

  #fail(error) {
    this.#failed = error;
    this.#answers.forEach(({ reject }) => reject(error));
    this.#answers.clear();
    this.#turns.splice(0).forEach((resolve) => resolve());
  }
}
