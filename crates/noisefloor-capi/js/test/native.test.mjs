// Sessions that ran in native code run here with the same samples: ../../src/tests/wasm.rs writes the
// transcript.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Session, load } from "../noisefloor.js";

const LARGEST = 1e-5;
const REASONS = ["open", "converged", "maxSpp"];

class Reader {
  at = 0;
  constructor(bytes) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }
  get isAtEnd() {
    return this.at === this.view.byteLength;
  }
  word() {
    return this.view.getUint32((this.at += 4) - 4, true);
  }
  float() {
    return this.view.getFloat32((this.at += 4) - 4, true);
  }
  floats() {
    return Float32Array.from({ length: this.word() }, () => this.float());
  }
  json() {
    const bytes = new Uint8Array(this.view.buffer, this.view.byteOffset + this.at + 4, this.word());
    this.at += bytes.length;
    return JSON.parse(new TextDecoder().decode(bytes));
  }
}

test("stops are equal, and P almost", async () => {
  await load();
  const from = new Reader(readFileSync(process.env.TRANSCRIPT));
  let [sessions, verdicts, stops, largest] = [0, 0, 0, 0];
  while (!from.isAtEnd) {
    const session = new Session(from.word(), from.word(), from.json());
    for (let what = from.word(); what; what = from.word()) {
      if (what < 3) {
        const [tile, spp, mean] = [from.word(), from.word(), from.floats()];
        session[what === 1 ? "push" : "pushRunning"](mean, { tile, spp });
        continue;
      }
      session.judge();
      for (const state of session.states()) {
        const [spp, reason, probability] = [from.word(), REASONS[from.word()], from.float()];
        const where = `session ${sessions}, tile ${state.tile.index}`;
        assert.deepEqual([state.spp, state.reason], [spp, reason], where);
        assert.equal(state.probability === null, Number.isNaN(probability), where);
        if (state.probability === null) continue;
        verdicts++;
        largest = Math.max(largest, Math.abs(state.probability - probability));
        assert.ok(largest <= LARGEST, `${where}: P is ${state.probability} instead of ${probability}`);
      }
    }
    assert.ok(session.isDone);
    stops += session.stops().filter(({ reason }) => reason === "converged").length;
    session.close();
    sessions++;
  }
  assert.ok(stops > sessions && verdicts > 4 * stops, `${stops} stops, ${verdicts} verdicts`);
  console.log(`${sessions} sessions, ${verdicts} verdicts, ${stops} stops; P differs by ${largest}`);
});
