// The worker of background.js: a session that gets passes and questions, one after the other.

import { Session } from "./noisefloor.js";

const port = globalThis.process?.getBuiltinModule?.("node:worker_threads").parentPort ?? globalThis;
let session;
let fresh = [];

function stateOf() {
  const { nextSpp, maxSpp, isDone } = session;
  return { nextSpp, maxSpp, isDone, states: session.states(), warnings: session.warnings(), fresh: fresh.splice(0) };
}

async function answer({ open, pass, call, values = [] }) {
  if (open) {
    const [width, height, options] = open;
    session = await Session.open(width, height, { ...options, onWarning: (text) => fresh.push(text) });
    return { state: stateOf() };
  }
  if (call) {
    const answer = session[call](...values);
    return { answer, state: stateOf() };
  }
  const { pixels, running, ...batch } = pass;
  if (running) session.pushRunning(pixels, batch);
  else session.push(pixels, batch);
  session.judge();
  return { pixels, state: stateOf() };
}

let turn = Promise.resolve();
function receive(message) {
  const { number } = message;
  turn = turn
    .then(() => answer(message))
    .then((answered) => port.postMessage({ ...answered, number }, answered.pixels ? [answered.pixels.buffer] : []))
    .catch(({ code = "INTERNAL", message }) => port.postMessage({ error: { code, message }, number }));
}
if (port.on) port.on("message", receive);
else port.onmessage = ({ data }) => receive(data);
