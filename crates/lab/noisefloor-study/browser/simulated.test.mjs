// Simulated observers at the real acquisition page, side by side: what each of them does at each showing was decided in
// Rust (src/simulated); here it is clicked.

import { describe, test } from "node:test";
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { SIDE_BY_SIDE, SMALL, arrive, heading, look, open, settled, test_picture } from "./kit.mjs";

const { SIMULATED, DECISIONS } = process.env;
/** By observer, stack and showing: the tiles that are clicked, in order. */
const observers = JSON.parse(readFileSync(DECISIONS, "utf8"));

const observe = (showings, number) =>
  test(`simulated observer ${number + 1}`, async (t) => {
    const { page } = await open(t, SIMULATED, SMALL);
    const study = await (await fetch(`${SIMULATED}/api/study`)).json();
    const shown = showings.map(() => 0);
    await arrive(page);
    for (const n of [1, 2]) {
      await heading(page, `Practice ${n} of 2`);
      await page.getByText("This one does not count").waitFor();
      await look(page);
      const { trial } = await settled(page);
      const box = await test_picture(page).boundingBox();
      const { width, tile } = study.stacks[trial.stack];
      for (let at = 0; !trial.identical && at < trial.levels.length; at += 1) {
        const columns = Math.ceil(width / tile);
        await page.mouse.click(
          box.x + ((at % columns) + 0.5) * tile,
          box.y + (Math.floor(at / columns) + 0.5) * tile,
        );
      }
      await page.getByRole("button", { name: "I see no difference" }).click();
    }
    const trials = showings.flat().length;
    for (let i = 0; i < trials; i += 1) {
      await heading(page, `Trial ${i + 1} of ${trials}`);
      await page.getByText("Click where you see").waitFor();
      await look(page);
      const { trial } = await settled(page);
      const { width, tile } = study.stacks[trial.stack];
      const clicks = showings[trial.stack][shown[trial.stack]];
      shown[trial.stack] += 1;
      const box = await test_picture(page).boundingBox();
      const columns = Math.ceil(width / tile);
      const levels = trial.levels.map(() => 0);
      for (const at of clicks) {
        levels[at] += 1;
        // Somewhere in the tile, not always in its middle
        const [dx, dy] = [0.2 + 0.06 * (levels[at] % 10), 0.8 - 0.06 * (levels[at] % 10)];
        await page.mouse.click(
          box.x + ((at % columns) + dx) * tile,
          box.y + (Math.floor(at / columns) + dy) * tile,
        );
      }
      assert.deepEqual((await settled(page)).trial.levels, levels);
      await page.getByRole("button", { name: "I see no difference" }).click();
    }
    await heading(page, "Thank you");
  });

describe("simulated observers", SIDE_BY_SIDE, () => observers.forEach(observe));
