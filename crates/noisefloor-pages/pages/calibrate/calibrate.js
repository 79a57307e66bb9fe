// A calibration: viewing conditions, then four pictures at a time, then the result.

import { ask, json } from "./ask.js";
import { Picture, unfit } from "./picture.js";
import { actions, element, fill, paragraphs, sheet } from "./sheet.js";
import * as viewing from "./viewing.js";

/** Between two trials nothing is shown for so long, so that one does not flicker into the next. */
const BLANK_MS = 250;
/** Answers that come sooner after the pictures cannot be about them. */
const SOONEST_MS = 200;
/** Room around the pictures, in CSS pixels. */
const AROUND = [120, 300];

const main = document.getElementById("main");
const bar = document.getElementById("status");
const cover = document.getElementById("cover");

let t;
let current = null;
/** The pictures and the keys of the trial that is shown. */
let shown = null;

const pause = (ms) => new Promise((go) => setTimeout(go, ms));
const frame = () => new Promise((go) => requestAnimationFrame(go));

function failed(error) {
  close();
  const said = error.body ? `${error.body.what}. ${error.body.what_to_do}` : String(error.message ?? error);
  sheet(t?.problem ?? "Problem", ...paragraphs(said), actions([t?.again ?? "Try again", () => location.reload(), true]));
}

function close() {
  if (!shown) return;
  document.removeEventListener("keydown", shown.listen);
  window.removeEventListener("resize", shown.refit);
  shown.pictures.forEach((picture) => picture.close());
  shown = null;
}

/** Covers everything while pictures would not be shown as they are, and says why. */
function watch() {
  const room = current?.stage === "trial" ? (2 * current.edge) / devicePixelRatio : 0;
  const small = room && (room + AROUND[0] > innerWidth || room + AROUND[1] > innerHeight);
  const problem = shown && (unfit() ?? (small ? "four_crowded" : null));
  cover.hidden = !problem;
  main.inert = Boolean(problem);
  if (problem) document.getElementById("cover-text").textContent = t[problem];
  if (shown && current.conditions && viewing.changed(current.conditions)) elsewhere().catch(failed);
}

async function elsewhere() {
  close();
  const view = await ask("api/again", json("POST", {}));
  sheet(t.conditions, ...paragraphs(t.elsewhere), actions([t.go_on, () => show(view).catch(failed), true]));
}

function progress(view) {
  if (view.stage !== "trial") {
    bar.replaceChildren();
    return;
  }
  const done = element("progress");
  done.className = "done-so-far";
  Object.assign(done, { max: view.expected, value: view.number });
  done.setAttribute("aria-label", t.progress);
  bar.replaceChildren(done, ` ${view.number + 1}`);
}

async function show(view) {
  current = view;
  close();
  progress(view);
  const pages = { conditions, trial, found, refused };
  await pages[view.stage](view);
  watch();
}

function conditions() {
  const begin = () => {
    const form = sheet(t.conditions, ...paragraphs(t.conditions_why));
    viewing.ask(form, t, ({ kind: _, ...seen }) => {
      ask("api/conditions", json("POST", seen)).then(show).catch(failed);
    });
  };
  sheet(t.calibration, ...paragraphs(t.about), actions([t.begin_calibration, begin, true]));
}

async function trial(view) {
  const { number, pictures: count, edge } = view;
  const shape = { width: edge, height: edge, tile: edge };
  const study = { stacks: Array(count).fill(shape) };
  const label = (i) => fill(t.picture_number, { number: i + 1 });
  const pictures = Array.from({ length: count }, (_, i) => new Picture(study, i, label(i), watch));
  const four = element("div");
  four.id = "four";
  let onset = Infinity;
  const answer = (choice) => {
    if (!(performance.now() - onset >= SOONEST_MS) || main.inert) return;
    onset = Infinity;
    pictures.forEach((picture) => picture.blank());
    ask("api/answer", json("POST", { trial: number, choice })).then(show).catch(failed);
  };
  pictures.forEach((picture, i) => {
    const room = element("div", "", picture.canvas);
    room.className = "frame";
    picture.canvas.addEventListener("click", () => answer(i));
    four.append(element("figure", "", room, element("figcaption", String(i + 1))));
  });
  const listen = (pressed) => {
    if (pressed.ctrlKey || pressed.metaKey || pressed.altKey || pressed.repeat) return;
    const choice = Number(pressed.key) - 1;
    if (choice >= 0 && choice < count) answer(choice);
  };
  const refit = () => {
    pictures.forEach((picture) => picture.fit());
    watch();
  };
  shown = { pictures, listen, refit };
  document.addEventListener("keydown", listen);
  window.addEventListener("resize", refit);

  const stage = element("div", "", four);
  stage.className = "stage";
  const foot = element("div", "", element("h1", t.which), element("p", t.which_how));
  foot.className = "foot";
  main.replaceChildren(stage, foot);
  main.focus({ preventScroll: true });
  refit();
  // All four at once, when all are there
  const ready = pictures.map((picture) => picture.load([number]));
  const [drawn] = await Promise.all([Promise.all(ready), pause(BLANK_MS)]);
  if (shown?.pictures !== pictures) return;
  drawn.forEach((draw) => draw());
  await frame();
  onset = await frame();
  // For whoever drives the page: when answers begin to count
  stage.dataset.answers = onset + SOONEST_MS;
}

function found(view) {
  const round = (value) => value.toLocaleString(document.documentElement.lang, { maximumSignificantDigits: 2 });
  const [low, high] = view.interval.map(round);
  const values = { factor: round(view.factor), low, high, kept: view.kept };
  const text = view.problem ? fill(t.not_kept, view) : fill(t.found_text, values);
  sheet(fill(t.found, values), ...paragraphs(text));
}

function refused(view) {
  const again = () => ask("api/again", json("POST", {})).then(show).catch(failed);
  sheet(t.refused, ...paragraphs(view.what), actions([t.again, again, true]));
}

async function begin() {
  const language = navigator.language.startsWith("fr") ? "fr" : "en";
  document.documentElement.lang = language;
  t = await ask(`api/texts/${language}`);
  document.title = t.calibration;
  await show(await ask("api/state"));
}

begin().catch(failed);
