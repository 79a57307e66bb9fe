// The page: pictures come in, verdicts are shown, answers go out.

import { Grid, fill } from "./grid.js";
import { Learning } from "./learn.js";
import { PersonalLine } from "./line.js";
import { legend, row } from "./parts.js";
import * as server from "./server.js";
import { Viewer } from "./viewer.js";

const get = (id) => document.getElementById(id);
const TILES = [32, 64, 128, 200, 256, 512];
/** Smallest tile that people were asked about, roughly. */
const ASKED = 64;

let t;
let state;
let grid;
let viewer;
let learning;
let line;
/** Judged pictures by increasing samples, and which of them is shown. */
let levels = [];
let level = 0;
let view = null;
let retrained = false;
let shown = "";
/** The picture whose map of JODs is drawn, if it is. */
let lost = null;
let turn = 0;
/** What Undo takes back, the last answer last; and the number that each answer has by now, by picture and tile. */
const undoable = [];
const ids = new Map();

function problem(error) {
  const sentence = (part) => `${part[0].toUpperCase()}${part.slice(1)}.`;
  const text = error?.body
    ? `${sentence(error.body.what)} ${sentence(error.body.what_to_do)}`
    : error instanceof TypeError
      ? t.unreachable
      : error
        ? String(error.message ?? error)
        : "";
  get("problem").textContent = text;
  get("problem").hidden = !text;
  // Where it is to be said
  if (error?.body?.where === "relation") get("arrangement").open = true;
}

const say = (text) => {
  get("status").textContent = text;
};

/** Runs what a control asks for, and shows errors. */
const does =
  (action) =>
  async (...given) => {
    try {
      problem(null);
      await action(...given);
    } catch (error) {
      problem(error);
    }
  };

async function take(files) {
  const all = [...files];
  let wrong = null;
  for (const [i, file] of all.entries()) {
    say(fill(t.loading, { name: file.name, n: i + 1, of: all.length }));
    try {
      await server.add(file);
    } catch (error) {
      wrong ??= error;
    }
  }
  say("");
  await arrange(await server.state());
  if (wrong) throw wrong;
}

/** Shows the pictures there are, and judges the one that is looked at. */
async function arrange(next) {
  const looked = levels[level]?.id;
  // Other tiles have other numbers
  if (next.tile !== state?.tile) undoable.length = 0;
  state = next;
  shown = "";
  const focused = document.activeElement?.getAttribute("aria-label");
  get("list").replaceChildren(...state.pictures.map((picture) => row(picture, t, does, arrange)));
  if (focused)
    [...get("list").querySelectorAll("[aria-label]")]
      .find((e) => e.getAttribute("aria-label") === focused)
      ?.focus();
  levels = state.pictures.filter((p) => p.spp !== null);
  const again = levels.findIndex((p) => p.id === looked);
  level = again < 0 ? 0 : again;
  const some = state.pictures.length > 0;
  get("arrangement").hidden = !some;
  get("scene").value = state.scene;
  get("samples").value = state.samples ?? "";
  get("tile").value = state.tile;
  Object.assign(get("level"), { max: Math.max(levels.length - 1, 0), value: level });
  get("level-row").hidden = levels.length < 2;
  counted(state.disagreements);
  await look();
}

function counted(n) {
  state.disagreements = n;
  get("count").textContent = fill(t.count, { n, database: state.database });
  get("learn-how").textContent = state.table ? t.learn_how : t.learn_table;
  get("retrain").hidden = !state.table;
  if (get("working").hidden) get("retrain").disabled = n === 0;
}

function audience() {
  const chosen = get("audience").value;
  if (chosen === "students") return state.art_students;
  if (chosen === "you") return line.audience();
  return chosen === "line" ? [get("slope").valueAsNumber, get("offset").valueAsNumber] : [1, 0];
}

const question = () => ({
  picture: levels[level].id,
  people: Number(get("people").value),
  audience: audience(),
  retrained,
});

/** Asks for the verdicts on the picture that is looked at; of answers that overtake one another, the last question's counts. */
async function look() {
  get("people-now").textContent = `${Math.round(100 * Number(get("people").value))} %`;
  get("line").hidden = get("audience").value !== "line";
  const picture = levels[level];
  const order = ++turn;
  if (!picture || audience().some(Number.isNaN)) return blank(picture);
  const spoken = fill(t.spp, { n: picture.spp });
  get("level-now").textContent = spoken;
  get("level").setAttribute("aria-valuetext", spoken);
  try {
    if (!view) say(t.judging);
    const next = await server.verdicts(question());
    if (order !== turn) return;
    view = next;
    if (get("status").textContent === t.judging) say("");
    await draw(picture, order);
  } catch (error) {
    if (order !== turn) return;
    blank();
    problem(error);
  }
}

function blank() {
  view = null;
  say("");
  for (const id of ["verdict", "view", "answers", "yours", "learn", "frame"]) get(id).hidden = true;
  get("welcome").hidden = false;
  // With pictures and nothing judged, the share of people and the level would have nothing to act on
  if (levels.length > 1) get("verdict").hidden = false;
}

async function draw(picture, order) {
  const which = `${picture.id} ${turn}`;
  if (!shown.startsWith(picture.id)) {
    const noise = view.has_noise_map ? await server.image(picture.id, "noise", turn) : null;
    if (order !== turn) return;
    if (noise) overlay("noise", noise);
    lost = null;
    get("frame").hidden = false;
    await viewer.show(picture, levels, turn);
    if (order !== turn) return;
    shown = which;
  }
  get("picture").setAttribute(
    "aria-label",
    fill(t.picture_label, { name: picture.name, spp: picture.spp }),
  );
  get("welcome").hidden = true;
  for (const id of ["verdict", "view", "answers", "yours", "learn", "frame"]) get(id).hidden = false;
  fit();
  grid.show(view, viewer.zoom);
  summarise();
  await layers();
  await line.show(question());
}

function overlay(id, bitmap) {
  [get(id).width, get(id).height] = [bitmap.width, bitmap.height];
  get(id).getContext("2d", { alpha: false }).drawImage(bitmap, 0, 0);
}

function fit() {
  const { width, height } = get("picture");
  for (const id of ["picture", "beside", "noise", "lost", "frame"]) {
    get(id).style.width = `${(width * viewer.zoom) / devicePixelRatio}px`;
    get(id).style.height = `${(height * viewer.zoom) / devicePixelRatio}px`;
  }
}

function resized() {
  fit();
  grid.show(view, viewer.zoom);
  summarise();
}

/** What each map is drawn from, to, and what lies in the middle. */
const MAPS = {
  noise: () => ["¼", t.seen, "4", t.legend],
  lost: () => ["0.01", t.lost_middle, "1", t.legend_lost],
};

/** Shows what is ticked. The map of JODs takes a moment, and is asked for when it is wanted. */
async function layers() {
  get("show-noise").disabled = !view.has_noise_map;
  const map = ["noise", "lost"].find((id) => !get(`show-${id}`).disabled && get(`show-${id}`).checked);
  get("tiles").classList.toggle("bare", !get("show-verdicts").checked);
  get("tiles").classList.toggle("needs", get("show-need").checked);
  if (map === "lost" && lost === null) {
    const { id } = levels[level];
    const order = turn;
    get("lost").hidden = true;
    say(t.comparing);
    try {
      const bitmap = await server.image(id, "lost", turn);
      if (order !== turn) return;
      overlay("lost", bitmap);
      lost = id;
    } finally {
      if (get("status").textContent === t.comparing) say("");
    }
  }
  for (const id of Object.keys(MAPS)) get(id).hidden = id !== map;
  get("legend").hidden = !map;
  if (!map) return;
  const [low, middle, high, label] = MAPS[map]();
  get("legend-low").textContent = low;
  get("legend-middle").textContent = middle;
  get("legend-high").textContent = high;
  get("scale").setAttribute("aria-label", label);
}

/** Ticks a layer or not; of the two maps, one is seen at a time. */
const tick = does(async (id) => {
  const other = { "show-noise": "show-lost", "show-lost": "show-noise" }[id];
  if (other && get(id).checked) get(other).checked = false;
  await layers();
});

function summarise() {
  const { tiles } = view;
  const converged = tiles.filter((tile) => tile.converged).length;
  const bits = [fill(t.summary, { converged, of: tiles.length, spp: view.spp })];
  const needs = tiles.map((tile) => tile.expected_spp ?? Infinity).sort((a, b) => a - b);
  const [need, median] = [needs.at(-1), needs[Math.floor((needs.length - 1) / 2)]];
  if (converged < tiles.length)
    bits.push(Number.isFinite(need) ? fill(t.summary_need, { need, median }) : t.summary_beyond);
  get("summary").textContent = bits.join(" ");
  const notes = [view.nested ? t.is_nested : t.is_independent];
  const unfamiliar = tiles.filter((tile) => tile.unfamiliar).length;
  if (unfamiliar > 0) notes.push(fill(t.unfamiliar, { n: unfamiliar }));
  if (!Number.isInteger(devicePixelRatio)) notes.unshift(t.scaled);
  if (viewer.zoom > 1) notes.unshift(fill(t.enlarged, { n: viewer.zoom }));
  get("note").textContent =
    state.model.evidence === "halves" ? notes.join(" ") : notes.slice(0, -1).join(" ");
  get("model").textContent = fill(retrained ? t.model_retrained : t.model, {
    digest: view.model.slice(0, 8),
  });
  get("undo").disabled = undoable.length === 0;
}

const answer = does(async (tile) => {
  const asked = question();
  if (tile.said) {
    await server.takeBack(tile.said.id);
    undoable.push({ asked, tile: tile.tile, back: tile.said.sees_noise });
    say(t.taken_back);
    counted(state.disagreements - 1);
  } else {
    const kept = await server.disagree(asked, tile.tile, tile.converged);
    undoable.push({ asked, tile: tile.tile, back: kept.before });
    ids.set(`${asked.picture} ${tile.tile}`, kept.id);
    say(fill(tile.converged ? t.kept_noise : t.kept_none, { n: tile.tile + 1 }));
    counted(kept.disagreements);
  }
  await line.learn(true);
  await look();
});

const undo = does(async () => {
  const last = undoable.pop();
  if (!last) return;
  const key = `${last.asked.picture} ${last.tile}`;
  if (last.back === null) {
    await server.takeBack(ids.get(key));
    counted(state.disagreements - 1);
  } else {
    const kept = await server.disagree(last.asked, last.tile, last.back);
    ids.set(key, kept.id);
    counted(kept.disagreements);
  }
  say(t.taken_back);
  await line.learn(false);
  await look();
});

function speak() {
  for (const element of document.querySelectorAll("[data-t]")) element.textContent = t[element.dataset.t];
  for (const element of document.querySelectorAll("[data-t-label]"))
    element.setAttribute("aria-label", t[element.dataset.tLabel]);
  get("undo").textContent = t.undo;
  get("progress").setAttribute("aria-label", t.progress);
  for (const n of TILES)
    get("tile").add(new Option(fill(n < ASKED ? t.tile_small : t.tile_option, { n }), n));
}

function listen() {
  const rearrange = does(async () =>
    arrange(
      await server.arrange({
        tile: Number(get("tile").value),
        samples: get("samples").value || null,
        scene: get("scene").value === state.scene ? state.named : get("scene").value,
      }),
    ),
  );
  for (const id of ["tile", "samples", "scene"]) get(id).addEventListener("change", rearrange);
  get("files").addEventListener(
    "change",
    does(async (event) => {
      await take(event.target.files);
      event.target.value = "";
    }),
  );
  get("clear").addEventListener(
    "click",
    does(async () => {
      undoable.length = 0;
      await arrange(await server.clear());
      get("files").focus();
    }),
  );
  get("level").addEventListener(
    "input",
    does(async () => {
      level = Number(get("level").value);
      await look();
    }),
  );
  for (const id of ["audience", "slope", "offset"]) get(id).addEventListener("input", does(look));
  get("people").addEventListener(
    "input",
    does(async () => {
      await line.learn(false);
      await look();
    }),
  );
  for (const id of ["show-verdicts", "show-noise", "show-lost", "show-need"])
    get(id).addEventListener("change", () => tick(id));
  get("undo").addEventListener("click", undo);
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("over");
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) document.body.classList.remove("over");
  });
  document.addEventListener(
    "drop",
    does(async (event) => {
      event.preventDefault();
      document.body.classList.remove("over");
      await take(event.dataTransfer.files);
    }),
  );
  document.addEventListener("keydown", (event) => {
    if (
      event.target.matches("input:not([type=range]):not([type=checkbox]), select") ||
      event.ctrlKey ||
      event.altKey ||
      event.metaKey ||
      !view
    )
      return;
    const box = { v: "show-verdicts", n: "show-noise", j: "show-lost", m: "show-need" }[event.key.toLowerCase()];
    if (box && !get(box).disabled) {
      get(box).checked = !get(box).checked;
      tick(box);
    } else if (viewer.key(event.key)) {
      event.preventDefault();
    }
  });
  window.addEventListener("resize", () => {
    if (view) resized();
  });
}

async function start() {
  const language = navigator.language.startsWith("fr") ? "fr" : "en";
  t = await server.strings(language);
  document.documentElement.lang = language;
  speak();
  legend();
  grid = new Grid(get("tiles"), t, answer, undo);
  viewer = new Viewer(t, () => view && resized(), problem);
  learning = new Learning(
    t,
    does(async (use) => {
      retrained = use;
      if (levels.length) await look();
    }),
    problem,
  );
  line = new PersonalLine(t, () => Number(get("people").value));
  learning.people = () => Number(get("people").value);
  listen();
  const first = await server.state();
  get("people").value = first.people;
  const [slope, offset] = first.audience;
  if (slope !== 1 || offset !== 0) {
    get("audience").value =
      slope === first.art_students[0] && offset === first.art_students[1] ? "students" : "line";
    [get("slope").value, get("offset").value] = [slope, offset];
  }
  get("model").textContent = fill(t.model, { digest: first.model.digest.slice(0, 8) });
  if (!TILES.includes(first.tile))
    get("tile").add(new Option(fill(t.tile_option, { n: first.tile }), first.tile));
  await line.learn(false);
  await arrange(first);
  await learning.follow();
  counted(state.disagreements);
}

start().catch(problem);
