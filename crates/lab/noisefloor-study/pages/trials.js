// The three protocols. The server says what to show; what the observer does becomes events.

import { Picture, tile } from "./picture.js";
import { element } from "./sheet.js";

/** Steps of the cross by arrow keys, in image pixels: no multiple of any tile, so that the grid does not show. */
const CROSS_STEP = 22;
/** Between two pictures, and before the first of a forced choice, in milliseconds. */
const GAP_MS = 500;
const CUE_MS = 700;

const frame = () => new Promise((go) => requestAnimationFrame(go));
/** The time when what was drawn is on screen: the frame after next begins. */
const painted = async () => {
  await frame();
  return frame();
};

/** Waits for the frame, at least one on, at which `ms` have passed since the frame `since`, to half a frame. What is
 * drawn before anything else is awaited is on screen with that frame. */
async function until(since, ms) {
  let last = await frame();
  for (;;) {
    const now = await frame();
    if (now - since >= ms - (now - last) / 2) return now;
    last = now;
  }
}

function button(text, key, action, main = false) {
  const made = element("button", text);
  made.type = "button";
  if (main) made.className = "main";
  if (key) {
    made.append(element("kbd", key));
    made.setAttribute("aria-keyshortcuts", key);
  }
  made.addEventListener("click", action);
  return made;
}

function figure(picture, caption) {
  const room = element("div", "", picture.canvas);
  room.className = "frame";
  const made = element("figure", "", element("figcaption", caption), room);
  made.className = "view";
  return made;
}

/** The room of a trial: pictures above, what to do below. Keys are bound until the next trial. */
class Room {
  constructor({ main, study, trial, heading, t, send, finish }) {
    Object.assign(this, { study, trial, t, send });
    this.stage = element("div");
    this.stage.className = "stage";
    this.say = element("p");
    this.actions = element("div");
    this.actions.className = "actions";
    this.foot = element("div", "", element("h1", heading), this.say, this.actions);
    this.foot.className = "foot";
    main.replaceChildren(this.stage, this.foot);
    // To the page, not to an answer: a key held down over the end of a trial must not answer the next one
    main.focus({ preventScroll: true });
    this.keys = new Map();
    this.listen = (pressed) => {
      if (pressed.ctrlKey || pressed.metaKey || pressed.altKey || pressed.repeat) return;
      const action = this.keys.get(pressed.key.toLowerCase());
      if (action && !main.inert) {
        pressed.preventDefault();
        action();
      }
    };
    document.addEventListener("keydown", this.listen);
    this.pictures = [];
    this.refit = () => this.pictures.forEach((picture) => picture.fit());
    window.addEventListener("resize", this.refit);
    // Longer words below move the pictures, by parts of a pixel too
    this.moved = new ResizeObserver(this.refit);
    this.moved.observe(this.stage);
    this.onset = Infinity;
    this.intervals = [];
    this.finish = (how) => {
      if (!this.closed) {
        this.close();
        finish(how);
      }
    };
  }

  picture(label) {
    const misfit = () => window.dispatchEvent(new Event("resize"));
    const made = new Picture(this.study, this.trial.stack, label, misfit);
    this.pictures.push(made);
    return made;
  }

  show(...figures) {
    this.stage.replaceChildren(...figures);
    this.refit();
  }

  /** From now on answers are possible. */
  async open() {
    this.onset = await painted();
    this.shown = Date.now();
    // For whoever drives the page: when answers begin to count
    this.stage.dataset.answers = this.onset + this.study.minimum_ms;
  }

  /** Time since answers are possible; a negative one, while they are not. */
  elapsed() {
    return performance.now() - this.onset;
  }

  /** Whether something comes too soon to be meant for this trial. */
  early() {
    return !(this.elapsed() >= this.study.minimum_ms);
  }

  answer(event) {
    if (this.early() || this.closed) return;
    const timing = { onset: this.shown, ms: this.elapsed(), intervals: this.intervals };
    // Pictures side by side are drawn together
    const [{ shape, frames }] = this.pictures;
    if (shape.frames > 1) timing.frames = frames;
    this.send({ ...event, trial: this.trial.number, timing });
    this.finish("answered");
  }

  bind(key, text, action, main = false) {
    const made = button(text, key, action, main);
    if (key) this.keys.set(key.toLowerCase(), () => made.isConnected && !made.disabled && made.click());
    this.actions.append(made);
    return made;
  }

  close() {
    this.closed = true;
    document.removeEventListener("keydown", this.listen);
    window.removeEventListener("resize", this.refit);
    this.moved.disconnect();
    this.pictures.forEach((picture) => picture.close());
  }
}

let open = null;

/** Runs a trial; `send` takes events; resolves when it is answered or left by pausing ("pause"). A trial that was
 * replaced by another page never resolves. */
export function run(given) {
  const kinds = { acquisition, validation, "forced-choice": forcedChoice };
  open?.close();
  return new Promise((finish) => {
    open = new Room({ ...given, finish });
    kinds[given.trial.kind](open);
  });
}

async function acquisition(room) {
  const { study, trial, t } = room;
  const reference = room.picture(t.reference);
  const test = room.picture(t.test_keys);
  const last = study.stacks[trial.stack].levels.length - 1;
  const levels = [...trial.levels];
  const shown = (level) => (trial.identical ? last : level);
  const history = [];
  room.show(figure(reference, t.reference), figure(test, t.test));
  room.say.textContent = t.loading;
  await Promise.all([reference.show(levels.map(() => last)), test.show(levels.map(shown))]);
  room.say.textContent = trial.practice ? t.acquisition_practice : t.acquisition_how;

  let undo = null;
  const step = (index, by, at) => {
    const level = levels[index] + by;
    if (level < 0 || level > last || room.early() || room.closed) return;
    levels[index] = level;
    room.send({ kind: "step", trial: trial.number, tile: index, level, at, ms: room.elapsed() });
    // A tile that came late must not cover a later one
    tile(study, trial.stack, shown(level), index).then(
      () => levels[index] === level && test.showTile(shown(level), index),
    );
    if (level < last) tile(study, trial.stack, shown(level + 1), index);
    undo.disabled = history.length === 0;
  };
  const point = (x, y, by) => {
    const { width, height } = test.shape;
    const at = [Math.min(Math.max(x, 0), width - 1), Math.min(Math.max(y, 0), height - 1)];
    const index = test.at(...at);
    if (by > 0 && levels[index] < last && !room.early()) history.push(index);
    step(index, by, at);
  };
  pointing(test, point);
  undo = room.bind("U", t.undo, () => {
    const index = history.pop();
    if (index !== undefined) step(index, -1, null);
    undo.disabled = history.length === 0;
  });
  undo.disabled = true;
  room.bind("D", t.no_difference, () => room.answer({ kind: "done" }), true);
  room.bind("P", t.pause, () => room.finish("pause"));
  test.canvas.focus({ preventScroll: true });
  await room.open();
}

/** Mouse and keyboard on the picture to compare: `point(x, y, by)` in image pixels. */
function pointing(test, point) {
  const { canvas, shape } = test;
  // Mouse: anywhere in the picture; the right button, or Shift, goes back
  const place = (pressed) => {
    const box = canvas.getBoundingClientRect();
    return [pressed.clientX - box.left, pressed.clientY - box.top].map((at) =>
      Math.floor(at * devicePixelRatio),
    );
  };
  canvas.addEventListener("click", (pressed) => point(...place(pressed), pressed.shiftKey ? -1 : 1));
  canvas.addEventListener("contextmenu", (pressed) => {
    pressed.preventDefault();
    point(...place(pressed), -1);
  });

  // Keyboard: a cross that arrow keys move. The first key only shows it
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  const cross = element("div");
  cross.className = "cross";
  cross.hidden = true;
  canvas.parentElement.append(cross);
  let at = [Math.floor(shape.width / 2), Math.floor(shape.height / 2)];
  const move = (dx, dy) => {
    const within = (value, most) => Math.min(Math.max(value, 0), most - 1);
    at = [within(at[0] + dx, shape.width), within(at[1] + dy, shape.height)];
    cross.hidden = false;
    cross.style.left = `${at[0] / devicePixelRatio}px`;
    cross.style.top = `${at[1] / devicePixelRatio}px`;
  };
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const marks = { Enter: 1, " ": 1, Backspace: -1, "-": -1 };
  canvas.addEventListener("keydown", (pressed) => {
    const { key } = pressed;
    if (!(key in arrows) && !(key in marks)) return;
    pressed.preventDefault();
    pressed.stopPropagation();
    const [dx, dy] = arrows[key] ?? [0, 0];
    const hidden = cross.hidden;
    move(dx * CROSS_STEP, dy * CROSS_STEP);
    if (key in marks && !hidden && !pressed.repeat) point(...at, marks[key]);
  });
  canvas.addEventListener("pointermove", () => {
    cross.hidden = true;
  });
}

async function validation(room) {
  const { study, trial, t } = room;
  const left = room.picture(t.left);
  const right = room.picture(t.right);
  room.show(figure(left, ""), figure(right, ""));
  room.say.textContent = t.loading;
  // Both appear at once: what comes first would tell them apart
  const all = [...trial.left, ...trial.right];
  await Promise.all(all.map((level, i) => tile(study, trial.stack, level, i % trial.left.length)));
  await Promise.all([left.show(trial.left), right.show(trial.right)]);
  room.say.textContent = t.validation_how;
  const answer = (choice) => () => room.answer({ kind: "answer", choice });
  room.bind("1", t.identical, answer("identical"), true);
  room.bind("2", t.different, answer("different"), true);
  room.bind("P", t.pause, () => room.finish("pause"));
  await room.open();
}

async function forcedChoice(room) {
  const { study, trial, t } = room;
  const picture = room.picture(t.interval_picture);
  const last = study.stacks[trial.stack].levels.length - 1;
  room.show(figure(picture, ""));
  room.say.textContent = t.loading;
  const levels = (level) =>
    Array.from({ length: picture.count }, (_, i) => (i === trial.tile ? level : last));
  const all = levels(last).map((level, i) => tile(study, trial.stack, level, i));
  const both = [trial.first, trial.second].map((level) => tile(study, trial.stack, level, trial.tile));
  await Promise.all([...all, ...both]);
  const pause = room.bind("P", t.pause, () => room.finish("pause"));

  room.say.textContent = t.look_here;
  let at = await frame();
  picture.blank();
  picture.mark(trial.tile);
  at = await until(at, CUE_MS);
  for (const [level, name] of [
    [trial.first, t.first],
    [trial.second, t.second],
  ]) {
    // All tiles are there: they are drawn within this frame
    room.say.textContent = name;
    await picture.show(levels(level));
    const to = await until(at, study.interval_ms);
    picture.blank();
    room.intervals.push(to - at);
    at = await until(to, GAP_MS);
    if (room.closed) return;
  }
  room.say.textContent = trial.practice ? t.forced_practice : t.forced_how;
  const answer = (choice) => () => room.answer({ kind: "answer", choice });
  room.actions.replaceChildren();
  room.bind("1", t.first, answer("first"), true);
  room.bind("2", t.second, answer("second"), true);
  room.actions.append(pause);
  await room.open();
}
