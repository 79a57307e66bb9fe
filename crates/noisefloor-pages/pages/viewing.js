// Viewing conditions: size of the screen, distance, gamma, light. Nothing is filled in beforehand.

import { snap } from "./picture.js";
import { element, fill } from "./sheet.js";

/** Width of a bank card in millimetres (ISO/IEC 7810, ID-1); its height is 53.98. */
const CARD_MM = 85.6;
const CARD_SHAPE = 53.98 / 85.6;
/** What the card slider reaches, in CSS pixels: from a projector to a dense small screen. */
const CARD_RANGE = [120, 900];
/** What the patch of the chart reaches; it begins at either end, where it clearly differs from the lines. */
const GREYS = [130, 235];

/** What tells one screen from another, and one zoom from another. */
const screenNow = () => ({
  "pixel-ratio": devicePixelRatio,
  "screen-width": screen.width,
  "screen-height": screen.height,
  "colour-depth": screen.colorDepth,
});

/** Whether the window has moved to another screen, or was zoomed, since the conditions were reported. */
export function changed(conditions) {
  return Object.entries(screenNow()).some(([name, value]) => conditions?.[name] !== value);
}

function field(form, legend, ...inside) {
  form.append(element("fieldset", "", element("legend", legend), ...inside));
}

function note(text) {
  const p = element("p", text);
  p.className = "note";
  return p;
}

function slider(id, text, [min, max], value, onInput) {
  const input = element("input");
  Object.assign(input, { type: "range", id, min, max, step: 1, value });
  input.addEventListener("input", () => onInput(Number(input.value)));
  return [element("label", text, input), input];
}

/** Lines one device pixel high, alternately black and white: half of the light of white. The patch is to match. */
function drawChart(canvas, grey) {
  const context = canvas.getContext("2d", { alpha: false });
  const { width, height } = canvas;
  for (let y = 0; y < height; y += 1) {
    context.fillStyle = y % 2 === 0 ? "rgb(0 0 0)" : "rgb(255 255 255)";
    context.fillRect(0, y, width, 1);
  }
  context.fillStyle = `rgb(${grey} ${grey} ${grey})`;
  context.fillRect(Math.round(width / 3), 0, Math.round(width / 3), height);
}

function chart(t, onChange) {
  const canvas = element("canvas");
  canvas.id = "chart";
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", t.gamma_chart);
  [canvas.width, canvas.height] = [360, 120];
  canvas.style.width = `${canvas.width / devicePixelRatio}px`;
  canvas.style.height = `${canvas.height / devicePixelRatio}px`;
  const begin = GREYS[Math.random() < 0.5 ? 0 : 1];
  drawChart(canvas, begin);
  const moved = (grey) => {
    drawChart(canvas, grey);
    onChange();
  };
  return [canvas, ...slider("gamma", t.gamma_slider, GREYS, begin, moved)];
}

function lights(t, onChange) {
  return ["dark", "dim", "bright", "glare"].map((light) => {
    const input = element("input");
    Object.assign(input, { type: "radio", name: "ambient", value: light });
    input.addEventListener("change", onChange);
    const label = element("label", "", input, t[`ambient_${light}`]);
    label.className = "line";
    return label;
  });
}

/** Asks for the conditions in `sheet`; calls `done` with the event. */
export function ask(sheet, t, done) {
  const form = element("form");
  const set = new Set();
  const missing = element("p");
  missing.className = "note";
  missing.setAttribute("role", "status");
  const go = element("button", t.go_on);
  go.className = "main";
  const check = (name) => {
    if (name) set.add(name);
    const left = ["card", "distance", "gamma", "ambient"].filter((part) => !set.has(part));
    missing.textContent = left.length
      ? fill(t.missing, { what: left.map((p) => t[`${p}_missing`]).join(", ") })
      : "";
    go.disabled = left.length > 0;
  };

  const card = element("div");
  card.id = "card";
  card.hidden = true;
  card.setAttribute("aria-hidden", "true");
  const size = (width) => {
    card.hidden = false;
    card.style.width = `${width}px`;
    card.style.height = `${width * CARD_SHAPE}px`;
    check("card");
  };
  const [cardLabel, cardInput] = slider("card-width", t.card_slider, CARD_RANGE, CARD_RANGE[0], size);
  field(form, t.card, note(t.card_how), cardLabel, card);

  const distance = element("input");
  Object.assign(distance, { type: "number", id: "distance", min: 10, max: 1000, step: 1, required: true });
  distance.addEventListener("input", () => {
    if (distance.value && distance.checkValidity()) check("distance");
    else {
      set.delete("distance");
      check();
    }
  });
  field(form, t.distance, element("label", "", `${t.distance_how} `, distance));

  const [canvas, gammaLabel, gamma] = chart(t, () => check("gamma"));
  field(form, t.gamma, note(t.gamma_how), canvas, gammaLabel);
  field(form, t.ambient, ...lights(t, () => check("ambient")));

  const row = element("div", "", go);
  row.className = "actions";
  form.append(missing, row);
  form.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    done({
      kind: "conditions",
      "pixels-per-mm": (Number(cardInput.value) * devicePixelRatio) / CARD_MM,
      "distance-mm": Number(distance.value) * 10,
      zoom: window.visualViewport?.scale ?? 1,
      // Half of the light at this code: (code/255)^gamma = 1/2
      gamma: Math.min(4, Math.max(1, Math.log(0.5) / Math.log(Number(gamma.value) / 255))),
      ambient: form.elements.ambient.value,
      ...screenNow(),
    });
  });
  check();
  sheet.append(form);
  snap(canvas);
}
