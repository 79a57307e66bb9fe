// How the picture is looked at: enlarged, brighter, one channel of it, or beside another one.

import { fill } from "./grid.js";
import * as server from "./server.js";

const get = (id) => document.getElementById(id);
const LARGEST = 8;
const DARKEST = -8;
const BRIGHTEST = 8;

export class Viewer {
  /** `changed()` is called when sizes have changed; `failed(error)` when a picture cannot be had. */
  constructor(t, changed, failed) {
    Object.assign(this, { t, changed, failed, zoom: 1, stops: 0, split: null, flipped: false, turn: 0 });
    this.bitmaps = new Map();
    const line = document.createElement("div");
    Object.assign(line, { id: "split", hidden: true });
    const name = document.createElement("div");
    Object.assign(name, { id: "name", hidden: true });
    get("frame").append(line, name);
    get("zoom").addEventListener("input", () => this.enlarge(Math.max(1, Number(get("zoom").value))));
    get("exposure").addEventListener("input", () => this.expose(Number(get("exposure").value)));
    get("channel").addEventListener("change", () => this.draw());
    get("other").addEventListener("change", () => this.choose());
    get("stage").addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    get("frame").addEventListener("pointermove", (event) => this.point(event));
  }

  /** Shows a picture; `others` can be set beside it. */
  async show(picture, others, revision) {
    const first = !this.picture;
    if (this.revision !== revision) this.bitmaps.clear();
    Object.assign(this, { picture, revision });
    const kept = get("other").value;
    const choices = others.filter(({ id }) => id !== picture.id);
    get("other").replaceChildren(
      new Option(this.t.nothing, ""),
      ...choices.map(({ id, name }) => new Option(name, id)),
    );
    get("other").value = choices.some(({ id }) => id === kept) ? kept : "";
    this.others = choices;
    await this.draw();
    if (first) this.enlarge(this.fitting());
  }

  /** A picture of the server's, drawn once for each exposure. */
  async bitmap(id) {
    const key = `${id} ${this.stops}`;
    if (!this.bitmaps.has(key)) {
      // Only what is shown now is kept
      for (const old of this.bitmaps.keys()) if (!old.endsWith(` ${this.stops}`)) this.bitmaps.delete(old);
      this.bitmaps.set(key, server.image(id, "shown", this.revision, this.stops));
    }
    return this.bitmaps.get(key);
  }

  async draw() {
    const order = ++this.turn;
    const other = get("other").value;
    try {
      const wanted = [["picture", this.picture.id], ...(other ? [["beside", other]] : [])];
      const bitmaps = await Promise.all(wanted.map(([, id]) => this.bitmap(id)));
      if (order !== this.turn) return;
      wanted.forEach(([canvas], i) => this.paint(get(canvas), bitmaps[i]));
      this.place();
    } catch (error) {
      this.bitmaps.clear();
      this.failed(error);
    }
  }

  paint(canvas, bitmap) {
    [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
    const context = canvas.getContext("2d", { alpha: false });
    context.drawImage(bitmap, 0, 0);
    const channel = get("channel").value;
    if (channel === "") return;
    const pixels = context.getImageData(0, 0, bitmap.width, bitmap.height);
    for (let at = 0; at < pixels.data.length; at += 4) {
      pixels.data.fill(pixels.data[at + Number(channel)], at, at + 3);
    }
    context.putImageData(pixels, 0, 0);
  }

  /** Says which of two pictures is where. */
  place() {
    const other = this.others.find(({ id }) => id === get("other").value);
    const beside = get("beside");
    if (!other) [this.flipped, this.split] = [false, null];
    const splits = this.split !== null;
    beside.hidden = !other || !(this.flipped || splits);
    beside.style.clipPath = splits ? `inset(0 0 0 ${100 * this.split}%)` : "";
    beside.setAttribute("aria-label", other?.name ?? "");
    get("split").hidden = !splits;
    get("split").style.left = `${100 * (this.split ?? 0)}%`;
    get("name").hidden = !other;
    get("name").textContent = splits
      ? `${this.picture.name} | ${other.name}`
      : this.flipped
        ? other.name
        : this.picture.name;
    get("beside-keys").hidden = this.others.length === 0;
    get("exposure-now").textContent = fill(this.t.stops, { n: `${this.stops > 0 ? "+" : ""}${this.stops}` });
    get("exposure").value = this.stops;
    get("zoom-now").textContent = `×${this.zoom}`;
    get("zoom").value = this.zoom;
  }

  choose() {
    this.flipped = get("other").value !== "";
    this.split = null;
    return this.draw();
  }

  /** Shows the other of two pictures; the first other one unless one is chosen. */
  flip() {
    if (this.others.length === 0) return;
    if (!get("other").value) {
      get("other").value = this.others[0].id;
      this.choose();
      return;
    }
    [this.flipped, this.split] = [!this.flipped, null];
    this.place();
  }

  divide() {
    if (this.others.length === 0) return;
    const had = get("other").value;
    if (!had) get("other").value = this.others[0].id;
    this.split = this.split === null ? 0.5 : null;
    this.flipped = false;
    if (had) this.place();
    else this.draw();
  }

  point(event) {
    if (this.split === null) return;
    const { left, width } = get("frame").getBoundingClientRect();
    this.split = Math.min(Math.max((event.clientX - left) / width, 0), 1);
    this.place();
  }

  /** The largest whole factor at which the picture fits; small pictures are hard to see otherwise. */
  fitting() {
    const { width, height } = get("picture");
    const stage = get("stage");
    const room = [
      ((stage.clientWidth - 32) * devicePixelRatio) / width,
      ((stage.clientHeight - 32) * devicePixelRatio) / height,
    ];
    return Math.min(Math.max(Math.floor(Math.min(...room)), 1), LARGEST);
  }

  /** `at` is the point of the stage that stays where it is: its middle unless given. */
  enlarge(zoom, at) {
    const stage = get("stage");
    const [x, y] = at ?? [stage.clientWidth / 2, stage.clientHeight / 2];
    const factor = Math.min(Math.max(zoom, 1), LARGEST) / this.zoom;
    this.zoom *= factor;
    this.changed();
    this.place();
    stage.scrollTo((stage.scrollLeft + x) * factor - x, (stage.scrollTop + y) * factor - y);
  }

  wheel(event) {
    if (!event.ctrlKey || !this.picture) return;
    event.preventDefault();
    const { left, top } = get("stage").getBoundingClientRect();
    this.enlarge(this.zoom + (event.deltaY < 0 ? 1 : -1), [event.clientX - left, event.clientY - top]);
  }

  expose(stops) {
    this.stops = Math.min(Math.max(stops, DARKEST), BRIGHTEST);
    return this.draw();
  }

  /** Whether a key was one of the viewer's. */
  key(pressed) {
    const channel = { r: "0", g: "1", b: "2", c: "" }[pressed];
    if (channel !== undefined) {
      get("channel").value = get("channel").value === channel ? "" : channel;
      this.draw();
      return true;
    }
    const does = {
      "+": () => this.enlarge(this.zoom + 1),
      "=": () => this.enlarge(this.zoom + 1),
      "-": () => this.enlarge(this.zoom - 1),
      1: () => this.enlarge(1),
      0: () => this.enlarge(this.fitting()),
      e: () => this.expose(this.stops + 0.5),
      E: () => this.expose(this.stops - 0.5),
      o: () => this.expose(0),
      x: () => this.flip(),
      s: () => this.divide(),
    }[pressed];
    does?.();
    return does !== undefined;
  }
}
