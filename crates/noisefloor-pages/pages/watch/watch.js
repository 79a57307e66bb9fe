// Asks for the state every second, and draws it.

const byId = (id) => document.getElementById(id);
const context = byId("map").getContext("2d");
const PAUSE_MS = 1000;
let state = null;
let shown = 0;

async function ask() {
  let wait = PAUSE_MS;
  try {
    const reply = await fetch("api/state");
    if (reply.ok) {
      show(await reply.json());
      tell("");
    }
    if (state?.over && state.picture === shown) wait = 5 * PAUSE_MS;
  } catch {
    tell(state?.over ? "The render is finished, and the command has ended." : "The command has ended, or cannot be reached.");
    wait = 5 * PAUSE_MS;
  }
  setTimeout(ask, wait);
}

function tell(problem) {
  byId("problem").hidden = problem === "";
  byId("problem").textContent = problem;
}

function show(next) {
  state = next;
  const done = state.tiles.filter((tile) => !tile.open).length;
  const pixels = state.tiles.reduce((sum, tile) => sum + tile.width * tile.height, 0);
  const samples = state.tiles.reduce((sum, tile) => sum + tile.spp * tile.width * tile.height, 0);
  const left = state.over ? "finished" : state.eta_seconds === null ? "no estimate yet" : `about ${time(state.eta_seconds)} to go`;
  const words = [`${done} of ${state.tiles.length} tiles done`, `${(samples / pixels).toPrecision(3)} samples per pixel`, time(state.seconds), left];
  byId("scene").textContent = `${state.scene}, ${state.width}×${state.height}, ${state.source}`;
  byId("progress").textContent = words.join(" · ");
  byId("done").value = done / state.tiles.length;
  document.title = `${Math.round((100 * done) / state.tiles.length)} % ${state.scene}`;
  const waiting = Object.entries(WAITS_FOR).map(([why, colour]) => {
    const key = document.createElement("span");
    key.style.borderBottom = `3px solid ${colour}`;
    const count = state.tiles.filter((tile) => tile.open && tile.open_for === why).length;
    key.textContent = count === 0 ? "" : `${count} open for ${why}`;
    return key;
  });
  byId("waiting").replaceChildren(...waiting.filter((key) => key.textContent !== ""));
  if (state.picture !== shown) {
    shown = state.picture;
    byId("picture").src = `api/picture.png?${shown}`;
    byId("picture").hidden = false;
  }
  draw();
}

function time(seconds) {
  const whole = Math.round(seconds);
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  if (hours > 0) return `${hours} h ${minutes} min`;
  return minutes > 0 ? `${minutes} min ${whole % 60} s` : `${whole} s`;
}

// Colours of tiles that are open for something else than their noise, which is white.
const WAITS_FOR = {
  exposure: "rgb(90 170 255 / 0.9)",
  "unmet-light": "rgb(255 210 40 / 0.9)",
  "few-samples": "rgb(120 230 120 / 0.9)",
  doubt: "rgb(255 90 90 / 0.9)",
};

// The map has the shape of the picture, at most as many pixels as the screen has.
function draw() {
  if (state === null || state.width === 0) return;
  const scale = Math.min(1, 2048 / Math.max(state.width, state.height));
  const canvas = byId("map");
  [canvas.width, canvas.height] = [Math.round(state.width * scale), Math.round(state.height * scale)];
  const over = document.querySelector("input[name=over]:checked").value;
  if (over === "nothing") return;
  const most = Math.max(1, ...state.tiles.map((tile) => tile.spp));
  for (const tile of state.tiles) {
    const [x, y, width, height] = [tile.x, tile.y, tile.width, tile.height].map((edge) => edge * scale);
    if (over === "open") {
      if (!tile.open) continue;
      context.lineWidth = 2;
      context.strokeStyle = "rgb(0 0 0 / 0.7)";
      context.strokeRect(x + 2, y + 2, width - 4, height - 4);
      context.strokeStyle = WAITS_FOR[tile.open_for] ?? "rgb(255 255 255 / 0.9)";
      context.strokeRect(x + 1, y + 1, width - 2, height - 2);
      continue;
    }
    const share = over === "samples" ? Math.log1p(tile.spp) / Math.log1p(most) : tile.probability;
    if (share === null) continue;
    // From blue to yellow: told apart by everybody, and by lightness, too
    context.fillStyle = `color-mix(in oklab, rgb(255 225 60 / 0.6) ${Math.round(100 * share)}%, rgb(20 40 160 / 0.6))`;
    context.fillRect(x, y, width, height);
  }
}

// Which tile is pointed at; the picture is centred in its box.
function point(event) {
  if (state === null) return;
  const box = byId("stage").getBoundingClientRect();
  const scale = Math.min(box.width / state.width, box.height / state.height);
  const x = (event.clientX - box.left - (box.width - state.width * scale) / 2) / scale;
  const y = (event.clientY - box.top - (box.height - state.height * scale) / 2) / scale;
  const tile = state.tiles.find((t) => x >= t.x && y >= t.y && x < t.x + t.width && y < t.y + t.height);
  if (tile === undefined) return;
  const p = tile.probability === null ? "not judged yet" : `P(no noise is seen) = ${tile.probability.toFixed(2)}`;
  byId("tile").textContent = `Tile at ${tile.x}, ${tile.y}: ${tile.spp} samples per pixel, ${p}, ${tile.open ? `open for ${tile.open_for}` : "done"}`;
}

byId("stage").addEventListener("pointermove", point);
document.querySelectorAll("input[name=over]").forEach((input) => input.addEventListener("change", draw));
ask();
