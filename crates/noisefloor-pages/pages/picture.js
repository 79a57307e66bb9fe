// Pictures made of tiles, one image pixel on one device pixel.

/** Pictures of tiles that are kept: each has one a frame. */
const MOST_TILES = 4000;
const RETRY_MS = 1000;
/** A window narrower than this, without a precise pointer, is a telephone. */
const PHONE_WIDTH = 900;
const tiles = new Map();
/** Canvases whose pixels were found not to be those of the screen. */
const misfits = new Set();

/** Asks until the server is within reach: a click made without a connection shows once it is back. */
async function load(path) {
  for (;;) {
    const answer = await fetch(path).catch(() => null);
    if (answer?.ok) {
      // As the file has it: no profile of the screen may touch what observers are shown
      const as = { colorSpaceConversion: "none", premultiplyAlpha: "none" };
      return createImageBitmap(await answer.blob(), as);
    }
    if (answer && answer.status < 500) throw new Error(path);
    await new Promise((go) => setTimeout(go, RETRY_MS));
  }
}

/** The frames of a tile of a level, one of a still; kept, since observers go back and forth. */
export function tile(study, stack, level, index) {
  const { frames = 1 } = study.stacks[stack];
  const path = `api/tiles/${stack}/${level}/${index}`;
  let found = tiles.get(path);
  tiles.delete(path);
  const name = (frame) => (frame === 0 ? `${path}.png` : `${path}.${frame}.png`);
  found ??= Promise.all(Array.from({ length: frames }, (_, frame) => load(name(frame)))).catch((error) => {
    tiles.delete(path);
    throw error;
  });
  tiles.set(path, found);
  if (tiles.size * frames > MOST_TILES) tiles.delete(tiles.keys().next().value);
  return found;
}

/** What keeps pictures from being shown as they are, as the name of a message; null if nothing does. */
export function unfit() {
  if (matchMedia("(forced-colors: active)").matches) return "high_contrast";
  if (!matchMedia("(any-pointer: fine)").matches && innerWidth < PHONE_WIDTH) return "phone";
  if (window.visualViewport && visualViewport.scale !== 1) return "pinched";
  return misfits.size > 0 ? "scaled" : null;
}

/** Whether `count` pictures side by side have room, as the name of a message; null if they have. */
export function crowded(stack, count) {
  const wide = (stack.width * count) / devicePixelRatio + 16 * (count + 1);
  const high = stack.height / devicePixelRatio + 190;
  return wide > innerWidth || high > innerHeight ? "crowded" : null;
}

/** Moves an element by part of a pixel, onto whole CSS pixels, or, where these are no whole device pixels, onto
 * device pixels. By its place: a transform would be applied after the browser has rounded. */
export function snap(element) {
  element.style.left = element.style.top = "0";
  const { left, top } = element.getBoundingClientRect();
  const unit = Number.isInteger(devicePixelRatio) ? 1 : devicePixelRatio;
  const shift = (at) => `${Math.round(at * unit) / unit - at}px`;
  element.style.left = shift(left);
  element.style.top = shift(top);
}

export class Picture {
  /** `onMisfit` hears that the browser would scale the picture, or no longer does. */
  constructor(study, stack, label, onMisfit = () => {}) {
    this.study = study;
    this.stack = stack;
    this.shape = study.stacks[stack];
    /** Of a loop: what became of its frames. */
    this.frames = { shown: 0, dropped: 0 };
    // As the server cuts them: what is left of less than half a tile belongs to the last one
    const along = (length) => Math.max(1, Math.round(length / this.shape.tile));
    [this.columns, this.rows] = [along(this.shape.width), along(this.shape.height)];
    this.count = this.columns * this.rows;
    this.canvas = document.createElement("canvas");
    this.canvas.className = "picture";
    this.canvas.width = this.shape.width;
    this.canvas.height = this.shape.height;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", label);
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.context.imageSmoothingEnabled = false;
    this.observer = new ResizeObserver(([entry]) => {
      const box = entry.devicePixelContentBoxSize?.[0];
      // Emulated ratios, as those of developers' tools, are reported in CSS pixels
      const is = (size, pixels) => size === pixels || size === Math.round(pixels / devicePixelRatio);
      const fits = !box || (is(box.inlineSize, this.shape.width) && is(box.blockSize, this.shape.height));
      if (fits ? misfits.delete(this) : !misfits.has(this) && misfits.add(this)) onMisfit();
    });
    // Browsers without the device's pixels are believed
    try {
      this.observer.observe(this.canvas, { box: "device-pixel-content-box" });
    } catch {
      /* Safari */
    }
    this.fit();
    this.blank();
  }

  close() {
    cancelAnimationFrame(this.playing);
    this.observer.disconnect();
    misfits.delete(this);
  }

  /** CSS size and place, so that image pixels are device pixels. */
  fit() {
    const ratio = devicePixelRatio;
    this.canvas.style.width = `${this.shape.width / ratio}px`;
    this.canvas.style.height = `${this.shape.height / ratio}px`;
    snap(this.canvas);
  }

  blank() {
    cancelAnimationFrame(this.playing);
    this.bitmaps = null;
    this.context.fillStyle = "rgb(119 119 119)";
    this.context.fillRect(0, 0, this.shape.width, this.shape.height);
  }

  place(index) {
    const { tile: edge } = this.shape;
    return [(index % this.columns) * edge, Math.floor(index / this.columns) * edge];
  }

  /** The tile at a place in image pixels. */
  at(x, y) {
    const place = (at, count) => Math.min(Math.floor(at / this.shape.tile), count - 1);
    return place(y, this.rows) * this.columns + place(x, this.columns);
  }

  /** Loads all tiles, every frame decoded; resolves to what draws them at once. */
  async load(levels) {
    const all = await Promise.all(levels.map((level, i) => tile(this.study, this.stack, level, i)));
    return () => {
      this.bitmaps = all;
      this.frame = this.frameAt(performance.now());
      this.draw();
      cancelAnimationFrame(this.playing);
      if (this.shape.frames > 1) this.play();
    };
  }

  /** Shows all tiles at once, when all are there. */
  async show(levels) {
    (await this.load(levels))();
  }

  async showTile(level, index) {
    const bitmaps = await tile(this.study, this.stack, level, index);
    if (!this.bitmaps) return;
    this.bitmaps[index] = bitmaps;
    this.drawTile(index);
  }

  drawTile(index) {
    const bitmaps = this.bitmaps[index];
    this.context.drawImage(bitmaps[this.frame % bitmaps.length], ...this.place(index));
  }

  draw() {
    this.bitmaps.forEach((_, index) => this.drawTile(index));
  }

  /** By one clock for all pictures: those side by side show the same frame. */
  frameAt(ms) {
    return Math.floor((ms * (this.shape.fps ?? 0)) / 1000);
  }

  /** Draws the frame that is due whenever the browser is going to show one. */
  play() {
    this.playing = requestAnimationFrame((now) => {
      const due = this.frameAt(now);
      if (due > this.frame) {
        this.frames.dropped += due - this.frame - 1;
        this.frames.shown += 1;
        this.frame = due;
        this.draw();
      }
      this.play();
    });
  }

  /** Short marks at the corners of a tile, outside of it. */
  mark(index) {
    const [x, y] = this.place(index);
    const { width, height, tile: edge } = this.shape;
    const end = (at, count, length) => (at === (count - 1) * edge ? length : at + edge);
    const [right, bottom] = [end(x, this.columns, width), end(y, this.rows, height)];
    this.context.fillStyle = "rgb(20 20 20)";
    const reach = Math.round(edge / 8);
    const corners = [
      [x, y, 1, 1],
      [right - 1, y, -1, 1],
      [x, bottom - 1, 1, -1],
      [right - 1, bottom - 1, -1, -1],
    ];
    for (const [cx, cy, sx, sy] of corners) {
      this.context.fillRect(Math.min(cx, cx + sx * reach), cy, reach, 1);
      this.context.fillRect(cx, Math.min(cy, cy + sy * reach), 1, reach);
    }
  }
}
