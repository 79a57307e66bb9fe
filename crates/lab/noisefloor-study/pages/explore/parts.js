// Parts of the panel that keep no state.

import { fill } from "./grid.js";
import * as server from "./server.js";

const get = (id) => document.getElementById(id);

/** The line of a picture in the list; `does` runs what a control asks for, `arrange` shows a new state. */
export function row(picture, t, does, arrange) {
  const item = document.createElement("li");
  const name = document.createElement("span");
  name.className = "name";
  name.title = name.textContent = picture.name;
  const input = document.createElement("input");
  Object.assign(input, {
    type: "number",
    min: 1,
    step: "any",
    value: picture.spp ?? "",
    placeholder: t.no_spp,
    required: true,
  });
  input.setAttribute("aria-label", fill(t.spp_of, { name: picture.name }));
  input.addEventListener(
    "change",
    does(async () => {
      if (input.value) await arrange(await server.setSamples(picture.id, Number(input.value)));
    }),
  );
  const away = document.createElement("button");
  away.type = "button";
  away.textContent = "×";
  away.setAttribute("aria-label", fill(t.remove, { name: picture.name }));
  away.addEventListener(
    "click",
    does(async () => arrange(await server.remove(picture.id))),
  );
  item.append(name, input, "spp", away);
  return item;
}

/** The colours of the map, as the server has them: inferno, sampled. */
export function legend() {
  const stops = [
    "#000004",
    "#1b0c41",
    "#4a0c6b",
    "#781c6d",
    "#a52c60",
    "#cf4446",
    "#ed6925",
    "#fb9b06",
    "#f7d13d",
    "#fcffa4",
  ];
  const context = get("scale").getContext("2d");
  const gradient = context.createLinearGradient(0, 0, get("scale").width, 0);
  stops.forEach((colour, i) => gradient.addColorStop(i / (stops.length - 1), colour));
  context.fillStyle = gradient;
  context.fillRect(0, 0, get("scale").width, get("scale").height);
}
