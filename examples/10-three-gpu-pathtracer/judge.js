// The worker: a session that gets running means of the whole picture, as WebGL reads them.

import { Session } from "noisefloor";

let session;
onmessage = async ({ data }) => {
  try {
    if (data.options) session = await Session.open(data.width, data.height, data.options);
    else session.pushRunning(data.pixels, { spp: data.spp, fromBottom: true });
    session.judge();
    const next = Math.min(...session.requests().map(({ first, spp }) => first + spp));
    postMessage({ next, states: session.states(), warnings: session.warnings(), isDone: session.isDone });
  } catch (error) {
    postMessage({ next: Infinity, states: [], warnings: [], error: error.message });
  }
};
