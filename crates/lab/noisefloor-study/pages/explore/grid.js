// The tiles over the picture: a button each, told apart by sign, line and words, not by colour alone.

const fill = (text, values) => text.replace(/\{(\w+)\}/g, (_, key) => values[key] ?? "");
const short = (n) => (n >= 100000 ? `${Math.round(n / 1000)}k` : String(n));

export class Grid {
  /** `onAnswer(tile)` is told which tile was clicked, `onUndo()` that Backspace was pressed. */
  constructor(element, t, onAnswer, onUndo) {
    Object.assign(this, { element, t, onAnswer, onUndo, buttons: [], columns: 1, at: 0 });
    element.addEventListener("keydown", (pressed) => this.key(pressed));
  }

  /** `zoom` says how many pixels of the screen one of the picture has on each side. */
  show(view, zoom) {
    this.zoom = zoom;
    if (this.buttons.length !== view.tiles.length) {
      this.buttons = view.tiles.map((_, i) => {
        const button = document.createElement("button");
        button.type = "button";
        button.addEventListener("click", () => {
          this.go(i, false);
          this.onAnswer(this.view.tiles[i]);
        });
        return button;
      });
      this.element.replaceChildren(...this.buttons);
      this.at = 0;
    }
    this.columns = view.columns;
    this.view = view;
    view.tiles.forEach((tile, i) => this.draw(this.buttons[i], tile));
    this.go(this.at, false);
  }

  draw(button, tile) {
    const { t } = this;
    const ratio = devicePixelRatio / this.zoom;
    for (const [name, value] of [
      ["left", tile.x],
      ["top", tile.y],
      ["width", tile.width],
      ["height", tile.height],
    ])
      button.style[name] = `${value / ratio}px`;
    const said = tile.said?.sees_noise;
    const small = Math.min(tile.width, tile.height) / ratio < 88;
    button.className = [
      tile.converged ? "converged" : "noisy",
      small ? "small" : "",
      tile.said ? "answered" : "",
    ].join(" ");
    // On a scale of doublings, around the samples that the picture has
    const need = tile.converged ? this.view.spp : (tile.expected_spp ?? Infinity);
    const doublings = Math.min(Math.max(Math.log2(need / this.view.spp), 0), 6);
    button.style.setProperty("--need", `hsl(${220 - 33 * doublings} 90% 50% / 0.45)`);
    const p = tile.probability.toFixed(2);
    const words_of_need = tile.converged
      ? ""
      : tile.expected_spp === null
        ? t.need_beyond
        : fill(t.need, { n: tile.expected_spp });
    const opposite = tile.said ? t.take_back : tile.converged ? t.i_see_noise : t.i_see_none;
    const label = fill(t.tile_label, {
      n: tile.tile + 1,
      row: Math.floor(tile.tile / this.columns) + 1,
      column: (tile.tile % this.columns) + 1,
      verdict: tile.converged ? t.converged : t.noisy,
      p,
      need: words_of_need,
      unfamiliar: tile.unfamiliar ? t.label_unfamiliar : "",
      said: tile.said ? (said ? t.said_noise : t.said_none) : "",
      opposite,
    });
    if (button.getAttribute("aria-label") !== label) button.setAttribute("aria-label", label);
    button.title = tile.said ? `${said ? t.you_noise : t.you_none} · ${t.take_back}` : opposite;

    const chip = (kind, text) => {
      const element = document.createElement("span");
      element.className = `chip ${kind}`;
      element.textContent = text;
      return element;
    };
    const words = [`${tile.converged ? "✓" : "✗"}${tile.unfamiliar ? " ?" : ""}`];
    if (!small) words.push(`P ${p}`);
    const chips = [chip("top", words.join("  "))];
    if (tile.converged) chips.push(chip("enough", `${short(this.view.spp)} spp`));
    else chips.push(chip("need", tile.expected_spp === null ? "→ ∞" : `→ ${short(tile.expected_spp)} spp`));
    // Drawn by the style: the label says it in its own words
    if (tile.said) button.dataset.said = small ? (said ? "✗!" : "✓!") : said ? t.you_noise : t.you_none;
    else delete button.dataset.said;
    button.replaceChildren(...chips);
  }

  /** Moves the one tile that Tab reaches. */
  go(index, focus) {
    this.at = Math.min(Math.max(index, 0), this.buttons.length - 1);
    this.buttons.forEach((button, i) => {
      button.tabIndex = i === this.at ? 0 : -1;
    });
    if (focus) this.buttons[this.at]?.focus();
  }

  key(pressed) {
    const column = this.at % this.columns;
    const last = this.buttons.length - 1;
    const moves = {
      ArrowLeft: column > 0 ? -1 : 0,
      ArrowRight: column < this.columns - 1 && this.at < last ? 1 : 0,
      ArrowUp: this.at >= this.columns ? -this.columns : 0,
      ArrowDown: this.at + this.columns <= last ? this.columns : 0,
      Home: -column,
      End: Math.min(this.columns - 1 - column, last - this.at),
    };
    if (pressed.key in moves && !pressed.ctrlKey && !pressed.altKey && !pressed.metaKey) {
      pressed.preventDefault();
      this.go(this.at + moves[pressed.key], true);
    } else if (pressed.key === "Backspace") {
      pressed.preventDefault();
      this.onUndo();
    }
  }
}

export { fill };
