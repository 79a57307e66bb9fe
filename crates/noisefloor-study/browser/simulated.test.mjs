// Simulated observers at the real acquisition page: what each of them does at each showing was decided in Rust (src/simulated); here it is clicked.

import { test } from "node:test";
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { LARGE, arrive, heading, open, test_picture } from "./kit.mjs";

const { SIMULATED, DECISIONS } = process.env;
/** By observer, stack and showing: the tiles that are clicked, in order. */
const observers = JSON.parse(readFileSync(DECISIONS, "utf8"));

/** The session as the server has it, once nothing is under way. */
const settled = (page) => page.evaluate(async () => {
  const code = localStorage.getItem("noisefloor.code");
  for (let i = 0; i < 500; i += 1) {
    if (JSON.parse(localStorage.getItem(`noisefloor.outbox.${code}`)).length === 0) break;
    await new Promise((go) => setTimeout(go, 10));
  }
  return (await fetch(`/api/sessions/${code}`)).json();
});

observers.forEach((showings, number) => {
  test(`simulated observer ${number + 1}`, async (t) => {
    const { page } = await open(t, SIMULATED, LARGE);
    const study = await (await fetch(`${SIMULATED}/api/study`)).json();
    const shown = showings.map(() => 0);
    await arrive(page);
    await heading(page, "Practice");
    await page.getByText("This one does not count").waitFor();
    await page.getByRole("button", { name: "I see no difference" }).click();
    const trials = showings.flat().length;
    for (let i = 0; i < trials; i += 1) {
      await heading(page, `Trial ${i + 2}`);
      await page.getByText("Click where you see").waitFor();
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
        await page.mouse.click(box.x + ((at % columns) + dx) * tile, box.y + (Math.floor(at / columns) + dy) * tile);
      }
      assert.deepEqual((await settled(page)).trial.levels, levels);
      await page.getByRole("button", { name: "I see no difference" }).click();
    }
    await heading(page, "Thank you");
  });
});
