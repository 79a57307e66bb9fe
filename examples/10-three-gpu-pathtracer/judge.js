// The worker: a session that gets running means of the whole picture, as WebGL reads them.

import { Session } from "noisefloor";

let session;
onmessage = async ({ data: { open, pixels, spp } }) => {
  session ??= await Session.open(...open);
  if (pixels) session.pushRunning(pixels, { spp, fromBottom: true });
  session.judge();
  const { nextSpp: next, isDone } = session;
  postMessage({ next, isDone, states: session.states(), warnings: session.warnings() });
};
addEventListener("unhandledrejection", ({ reason }) => postMessage({ error: reason.message }));
