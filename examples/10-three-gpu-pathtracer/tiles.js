// The map of tiles over the picture: a frame for each, and how far it is.

const OPEN = "#ffb454";
const DONE = "#5fd38d";

export function drawTiles(canvas, width, height, states) {
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  const line = Math.max(1, Math.round(devicePixelRatio));
  context.lineWidth = line;
  context.textBaseline = "bottom";
  context.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  for (const { tile, spp, expectedSpp, reason } of states) {
    const isOpen = reason === "open";
    const { x, y, width: w, height: h } = tile;
    context.strokeStyle = isOpen ? OPEN : DONE;
    context.globalAlpha = 0.6;
    context.strokeRect(x + line / 2, y + line / 2, w - line, h - line);
    context.globalAlpha = 1;
    // What share of the samples it is expected to need it has
    context.fillStyle = context.strokeStyle;
    const share = isOpen ? Math.min(1, spp / (expectedSpp ?? Infinity)) : 1;
    context.fillRect(x, y + h - 2 * line, w * share, 2 * line);
    if (tile.width < 48 * devicePixelRatio) continue;
    const text = String(spp);
    context.fillStyle = "#000a";
    const measured = context.measureText(text).width;
    context.fillRect(x + line, y + h - 18 * line, measured + 6 * line, 14 * line);
    context.fillStyle = context.strokeStyle;
    context.fillText(text, x + 4 * line, y + h - 4 * line);
  }
}
