// The three protocols. The server says what to show; what the observer does becomes events.

import { Picture, tile } from "./picture.js";

/** Steps of the cross by arrow keys, in image pixels: no multiple of any tile, so that the grid does not show. */
const CROSS_STEP = 22;
/** Between two pictures, and before the first of a forced choice, in milliseconds. */
const GAP_MS = 500;
const CUE_MS = 700;

const wait = (ms) => new Promise((go) => setTimeout(go, ms));
const painted = () => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)));

function button(text, key, action, main = false) {
  const element = document.createElement("button");
  element.type = "button";
  element.textContent = text;
  if (main) element.className = "main";
  if (key) {
    const cap = document.createElement("kbd");
    cap.textContent = key;
    element.append(cap);
    element.setAttribute("aria-keyshortcuts", key);
  }
  element.addEventListener("click", action);
  return element;
}

function figure(picture, caption) {
  const frame = document.createElement("div");
  const element = document.createElement("figure");
  const text = document.createElement("figcaption");
  frame.className = "frame";
  element.className = "view";
  text.textContent = caption;
  frame.append(picture.canvas);
  element.append(text, frame);
  return element;
}

/** The room of a trial: pictures above, what to do below. Keys are bound until the next trial. */
class Room {
  constructor(main, trial, t, leave) {
    this.stage = document.createElement("div");
    this.stage.className = "stage";
    this.foot = document.createElement("div");
    this.foot.className = "foot";
    this.say = document.createElement("p");
    this.actions = document.createElement("div");
    this.actions.className = "actions";
    const heading = document.createElement("h1");
    heading.textContent = trial.practice ? t.practice : `${t.trial} ${trial.number + 1}`;
    this.foot.append(heading, this.say, this.actions);
    main.replaceChildren(this.stage, this.foot);
    this.keys = new Map();
    this.listen = (pressed) => {
      if (pressed.ctrlKey || pressed.metaKey || pressed.altKey || pressed.repeat) return;
      const action = this.keys.get(pressed.key.toLowerCase());
      if (action && !document.getElementById("cover").checkVisibility?.()) { pressed.preventDefault(); action(); }
    };
    document.addEventListener("keydown", this.listen);
    this.leave = leave;
    this.pictures = [];
    this.refit = () => this.pictures.forEach((picture) => picture.fit());
    window.addEventListener("resize", this.refit);
    // Longer words below move the pictures, by parts of a pixel too
    this.moved = new ResizeObserver(this.refit);
    this.moved.observe(this.stage);
  }

  show(...figures) {
    this.stage.replaceChildren(...figures);
    this.refit();
  }

  bind(key, text, action, main = false) {
    const element = button(text, key, action, main);
    if (key) this.keys.set(key.toLowerCase(), () => element.isConnected && !element.disabled && element.click());
    this.actions.append(element);
    return element;
  }

  close() {
    document.removeEventListener("keydown", this.listen);
    window.removeEventListener("resize", this.refit);
    this.moved.disconnect();
  }
}

/** Runs the trial in `main`; `send` takes events; resolves when it is answered or left by pausing ("pause"). */
export function run(main, study, trial, t, send) {
  const kinds = { acquisition, validation, "forced-choice": forcedChoice };
  return new Promise((answered) => {
    const room = new Room(main, trial, t);
    const finish = (how) => { room.close(); answered(how); };
    kinds[trial.kind](room, study, trial, t, send, finish);
  });
}

async function acquisition(room, study, trial, t, send, finish) {
  const reference = new Picture(study, trial.stack, t.reference);
  const test = new Picture(study, trial.stack, t.test_keys);
  const shape = study.stacks[trial.stack];
  const last = shape.levels.length - 1;
  const levels = [...trial.levels];
  const history = [];
  room.pictures = [reference, test];
  room.show(figure(reference, t.reference), figure(test, t.test));
  room.say.textContent = t.loading;
  await Promise.all([reference.show(levels.map(() => last)), test.show(levels)]);
  room.say.textContent = trial.practice ? t.acquisition_practice : t.acquisition_how;

  const step = (index, by) => {
    const level = levels[index] + by;
    if (level < 0 || level > last) return;
    levels[index] = level;
    send({ kind: "step", trial: trial.number, tile: index, level });
    // A tile that came late must not cover a later one
    tile(trial.stack, level, index).then(() => levels[index] === level && test.showTile(level, index));
    if (level < last) tile(trial.stack, level + 1, index);
    undo.disabled = history.length === 0;
  };
  const point = (x, y, by) => {
    const index = test.at(Math.min(Math.max(x, 0), shape.width - 1), Math.min(Math.max(y, 0), shape.height - 1));
    if (by > 0 && levels[index] < last) history.push(index);
    step(index, by);
  };

  // Mouse: anywhere in the picture; the right button, or Shift, goes back
  const canvas = test.canvas;
  const place = (pressed) => {
    const box = canvas.getBoundingClientRect();
    return [Math.floor((pressed.clientX - box.left) * devicePixelRatio), Math.floor((pressed.clientY - box.top) * devicePixelRatio)];
  };
  canvas.addEventListener("click", (pressed) => point(...place(pressed), pressed.shiftKey ? -1 : 1));
  canvas.addEventListener("contextmenu", (pressed) => { pressed.preventDefault(); point(...place(pressed), -1); });

  // Keyboard: a cross that arrow keys move
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  const cross = document.createElement("div");
  cross.className = "cross";
  cross.hidden = true;
  canvas.parentElement.append(cross);
  let at = [Math.floor(shape.width / 2), Math.floor(shape.height / 2)];
  const move = (dx, dy) => {
    at = [Math.min(Math.max(at[0] + dx, 0), shape.width - 1), Math.min(Math.max(at[1] + dy, 0), shape.height - 1)];
    cross.hidden = false;
    cross.style.left = `${at[0] / devicePixelRatio}px`;
    cross.style.top = `${at[1] / devicePixelRatio}px`;
  };
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  canvas.addEventListener("keydown", (pressed) => {
    if (pressed.key in arrows) {
      const [dx, dy] = arrows[pressed.key];
      move(dx * CROSS_STEP, dy * CROSS_STEP);
    } else if (pressed.key === "Enter" || pressed.key === " ") {
      move(0, 0);
      point(...at, 1);
    } else if (pressed.key === "Backspace" || pressed.key === "-") {
      move(0, 0);
      point(...at, -1);
    } else return;
    pressed.preventDefault();
    pressed.stopPropagation();
  });
  canvas.addEventListener("pointermove", () => { cross.hidden = true; });

  const undo = room.bind("U", t.undo, () => {
    const index = history.pop();
    if (index !== undefined) step(index, -1);
    undo.disabled = history.length === 0;
  });
  undo.disabled = true;
  room.bind("D", t.no_difference, () => { send({ kind: "done", trial: trial.number }); finish("answered"); }, true);
  room.bind("P", t.pause, () => finish("pause"));
  canvas.focus({ preventScroll: true });
}

async function validation(room, study, trial, t, send, finish) {
  const left = new Picture(study, trial.stack, t.left);
  const right = new Picture(study, trial.stack, t.right);
  room.pictures = [left, right];
  room.show(figure(left, ""), figure(right, ""));
  room.say.textContent = t.loading;
  // Both appear at once: what comes first would tell them apart
  await Promise.all([...trial.left, ...trial.right].map((level, i) => tile(trial.stack, level, i % trial.left.length)));
  await Promise.all([left.show(trial.left), right.show(trial.right)]);
  room.say.textContent = t.validation_how;
  const answer = (choice) => () => { send({ kind: "answer", trial: trial.number, choice }); finish("answered"); };
  const first = room.bind("1", t.identical, answer("identical"), true);
  room.bind("2", t.different, answer("different"), true);
  room.bind("P", t.pause, () => finish("pause"));
  first.focus({ preventScroll: true });
}

async function forcedChoice(room, study, trial, t, send, finish) {
  const picture = new Picture(study, trial.stack, t.interval_picture);
  const shape = study.stacks[trial.stack];
  const last = shape.levels.length - 1;
  room.pictures = [picture];
  room.show(figure(picture, ""));
  room.say.textContent = t.loading;
  const levels = (level) => Array.from({ length: picture.count }, (_, i) => (i === trial.tile ? level : last));
  await Promise.all([...levels(last), trial.first, trial.second].map((level, i) => tile(trial.stack, level, i < picture.count ? i : trial.tile)));
  let left = false;
  const pause = room.bind("P", t.pause, () => { left = true; finish("pause"); });

  const blank = async (ms, cue) => {
    picture.blank();
    if (cue) picture.mark(trial.tile);
    await wait(ms);
  };
  room.say.textContent = t.look_here;
  await blank(CUE_MS, true);
  for (const [level, name] of [[trial.first, t.first], [trial.second, t.second]]) {
    room.say.textContent = name;
    await picture.show(levels(level));
    await painted();
    await wait(study.interval_ms);
    await blank(GAP_MS, false);
  }
  if (left) return;
  room.say.textContent = trial.practice ? t.forced_practice : t.forced_how;
  const answer = (choice) => () => { send({ kind: "answer", trial: trial.number, choice }); finish("answered"); };
  room.actions.replaceChildren();
  const first = room.bind("1", t.first, answer("first"), true);
  room.bind("2", t.second, answer("second"), true);
  room.actions.append(pause);
  first.focus({ preventScroll: true });
}
