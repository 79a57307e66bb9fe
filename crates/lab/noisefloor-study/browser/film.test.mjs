// Loops of frames in Chromium: the stack's frames, the reference's as well, are grey by their numbers in a corner.

import { describe, test } from "node:test";
import assert from "node:assert/strict";
import { SIDE_BY_SIDE, SMALL, arrive, code, heading, look, open, test_picture } from "./kit.mjs";

const { FILM, FILM_FORCED } = process.env;
const FRAMES = 6;
const FPS = 24;

/** What the corners of all pictures say whenever the browser draws, for so many milliseconds: [time, frames]. */
const watched = (page, ms) =>
  page.evaluate(
    async ([ms, count]) => {
      const seen = [];
      const begun = performance.now();
      while (performance.now() - begun < ms) {
        const now = await new Promise((go) => requestAnimationFrame(go));
        const corner = (canvas) => canvas.getContext("2d").getImageData(1, 1, 1, 1).data[0];
        const frames = [...document.querySelectorAll("canvas.picture")].map(corner);
        seen.push([now, frames.map((grey) => grey / (240 / count))]);
      }
      return seen;
    },
    [ms, FRAMES],
  );

const answers = async (page) => {
  const of = await code(page);
  const text = await page.evaluate(async (of) => (await fetch(`api/sessions/${of}/export`)).text(), of);
  return JSON.parse(text)
    .events.map((e) => e.event)
    .filter((e) => e.kind === "done" || e.kind === "answer");
};

const none = (page) => page.getByRole("button", { name: "I see no difference" });

describe("loops of frames", SIDE_BY_SIDE, () => {
  test("play at their rate, together, and say how many frames were dropped", async (t) => {
    const { page } = await open(t, FILM, SMALL);
    await arrive(page);
    await heading(page, "Practice 1 of 2");
    await look(page);
    const seen = await watched(page, 2000);
    const alike = ([, [one, other]]) => one === other && Number.isInteger(one);
    assert.ok(seen.every(alike), JSON.stringify(seen.slice(0, 5)));
    // Each frame comes after the one before, unless some were dropped, and by the clock
    assert.equal(new Set(seen.map(([, frames]) => frames[0])).size, FRAMES);
    for (const [now, [frame]] of seen) {
      const due = Math.floor((now * FPS) / 1000) % FRAMES;
      assert.ok(frame === due || (frame + 1) % FRAMES === due, `${frame} at ${now}, not ${due}`);
    }

    // A tile that is moved on plays, too
    const size = await test_picture(page).evaluate((canvas) => [canvas.width, canvas.height]);
    assert.deepEqual(size, [128, 64]);
    for (const x of [32, 96]) await test_picture(page).click({ position: { x, y: 32 } });
    const after = await watched(page, 500);
    assert.ok(new Set(after.map(([, frames]) => frames[1])).size > 1);
    assert.ok(after.every(([, frames]) => frames[0] === frames[1]));
    await none(page).click();

    // A page that is held up drops frames, which the answer says
    await heading(page, "Practice 2 of 2");
    await look(page);
    await page.evaluate(() => {
      const until = performance.now() + 600;
      while (performance.now() < until);
    });
    await watched(page, 100);
    await none(page).click();
    await heading(page, "Trial 1 of 1");
    const [first, second] = await answers(page);
    console.log("frames:", JSON.stringify([first, second].map(({ timing }) => timing.frames)));
    // 600 ms are 14 frames
    assert.ok(second.timing.frames.dropped >= 12, JSON.stringify(second));
    assert.ok(first.timing.frames.shown > FPS && first.timing.frames.dropped < first.timing.frames.shown);
  });

  test("intervals of a forced choice are loops, too", async (t) => {
    const { page } = await open(t, FILM_FORCED, SMALL);
    await arrive(page);
    await page.getByText("Which one was noisy").waitFor();
    await look(page);
    await page.keyboard.press("1");
    await page.waitForFunction(() => document.querySelector("progress")?.value >= 1);
    const [{ timing }] = await answers(page);
    console.log("intervals:", JSON.stringify(timing));
    const frames = timing.frames.shown + timing.frames.dropped;
    const expected = (timing.intervals.reduce((sum, ms) => sum + ms) * FPS) / 1000;
    assert.ok(Math.abs(frames - expected) <= 3, `${frames}, not ${expected}`);
  });
});
