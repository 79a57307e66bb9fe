// What is asked of the server and told to it.

import { ask, json, Refused } from "./ask.js";

export const strings = (language) => ask(`api/texts/${language}`);
export const state = () => ask("api/state");
export const add = (file) =>
  ask(`api/pictures/${encodeURIComponent(file.name)}`, {
    method: "POST",
    headers: { "content-type": "application/octet-stream" },
    body: file,
  });
export const setSamples = (id, spp) => ask(`api/pictures/${id}`, json("PUT", { spp }));
export const remove = (id) => ask(`api/pictures/${id}`, { method: "DELETE" });
export const clear = () => ask("api/pictures", { method: "DELETE" });
export const arrange = (arrangement) => ask("api/arrangement", json("PUT", arrangement));
export const verdicts = (question) => ask("api/verdicts", json("POST", question));
export const disagree = (question, tile, seesNoise) =>
  ask("api/disagreements", json("POST", { question, tile, sees_noise: seesNoise }));
export const takeBack = (id) => ask(`api/disagreements/${id}`, { method: "DELETE" });
export const line = (people) => ask("api/line", json("POST", { people }));
export const retrain = (people) => ask("api/retrain", json("POST", { people }));
export const progress = () => ask("api/retrain");

/** A picture's PNG, its values as they are: no profile of the screen may touch them. */
export async function image(id, which, revision, stops = 0) {
  const query = `revision=${revision}&stops=${stops}`;
  const answer = await fetch(`api/pictures/${id}/${which}.png?${query}`, { cache: "no-store" });
  if (!answer.ok) throw new Refused(answer.status, await answer.json());
  return createImageBitmap(await answer.blob(), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
}
