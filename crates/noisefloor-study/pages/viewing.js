// How the pictures are seen: size of the screen, distance, gamma, light.

import { snap } from "./picture.js";

/** Width of a bank card in millimetres (ISO/IEC 7810, ID-1); its height is 53.98. */
const CARD_MM = 85.6;
const CARD_SHAPE = 53.98 / 85.6;
/** CSS pixels: what the slider reaches, from a projector to a telephone. */
const CARD_RANGE = [120, 900];

function field(form, legend, ...inside) {
  const set = document.createElement("fieldset");
  const title = document.createElement("legend");
  title.textContent = legend;
  set.append(title, ...inside);
  form.append(set);
}

function note(text) {
  const p = document.createElement("p");
  p.className = "note";
  p.textContent = text;
  return p;
}

function slider(id, text, [min, max], value, onInput) {
  const label = document.createElement("label");
  const input = document.createElement("input");
  label.textContent = text;
  Object.assign(input, { type: "range", id, min, max, step: 1, value });
  input.addEventListener("input", () => onInput(Number(input.value)));
  label.append(input);
  return [label, input];
}

/** Lines one device pixel high, black and white in turn: half of white's light. A uniform patch in their middle is to look the same. */
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

/** Asks for the conditions in `sheet`; calls `done` with them. */
export function ask(sheet, t, done) {
  const form = document.createElement("form");
  form.noValidate = false;

  const card = document.createElement("div");
  card.id = "card";
  card.setAttribute("aria-hidden", "true");
  const size = (width) => { card.style.width = `${width}px`; card.style.height = `${width * CARD_SHAPE}px`; };
  const [cardLabel, cardInput] = slider("card-width", t.card_slider, CARD_RANGE, 324, size);
  size(324);
  field(form, t.card, note(t.card_how), cardLabel, card);

  const distanceLabel = document.createElement("label");
  const distance = document.createElement("input");
  distanceLabel.textContent = `${t.distance_how} `;
  Object.assign(distance, { type: "number", id: "distance", min: 20, max: 500, step: 1, value: 60, required: true });
  distanceLabel.append(distance);
  field(form, t.distance, distanceLabel);

  const chart = document.createElement("canvas");
  chart.id = "chart";
  chart.setAttribute("role", "img");
  chart.setAttribute("aria-label", t.gamma_chart);
  [chart.width, chart.height] = [360, 120];
  chart.style.width = `${chart.width / devicePixelRatio}px`;
  chart.style.height = `${chart.height / devicePixelRatio}px`;
  const [gammaLabel, gammaInput] = slider("gamma", t.gamma_slider, [130, 235], 160, (grey) => drawChart(chart, grey));
  drawChart(chart, 160);
  field(form, t.gamma, note(t.gamma_how), chart, gammaLabel);

  const lights = ["dark", "dim", "bright", "glare"].map((light) => {
    const label = document.createElement("label");
    const input = document.createElement("input");
    label.className = "line";
    Object.assign(input, { type: "radio", name: "ambient", value: light, required: true });
    label.append(input, t[`ambient_${light}`]);
    return label;
  });
  field(form, t.ambient, ...lights);

  const actions = document.createElement("div");
  const go = document.createElement("button");
  actions.className = "actions";
  Object.assign(go, { type: "submit", className: "main", textContent: t.go_on });
  actions.append(go);
  form.append(actions);
  form.addEventListener("submit", (submitted) => {
    submitted.preventDefault();
    done({
      kind: "conditions",
      "pixels-per-mm": (Number(cardInput.value) * devicePixelRatio) / CARD_MM,
      "distance-mm": Number(distance.value) * 10,
      "pixel-ratio": devicePixelRatio,
      zoom: window.visualViewport?.scale ?? 1,
      "colour-depth": screen.colorDepth,
      "screen-width": screen.width,
      "screen-height": screen.height,
      // Half of the light at this code: (code/255)^gamma = 1/2
      gamma: Math.min(4, Math.max(1, Math.log(0.5) / Math.log(Number(gammaInput.value) / 255))),
      ambient: form.elements.ambient.value,
    });
  });
  sheet.append(form);
  snap(chart);
}
