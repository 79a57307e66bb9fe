// Loops of frames in Chromium: the stack's frames, the reference's as well, are grey by their numbers in a corner.

import { describe, test } from "node:test";
import assert from "node:assert/strict";
import {
  PATIENCE,
  SIDE_BY_SIDE,
  SMALL,
  arrive,
  code,
  heading,
  look,
  noted,
  open,
  test_picture,
} from "./kit.mjs";

const { FILM, FILM_FORCED } = process.env;
const FRAMES = 6;
const FPS = 24;

/** What the corners of all pictures say at each frame of the browser, until they have said `enough` different things,
 * and `past` is over by the clock of the page: [time, frames]. */
const watched = (page, enough, past = 0) =>
  page.evaluate(
    async ([enough, past, count, patience]) => {
      const [seen, values, end] = [[], new Set(), performance.now() + patience];
      for (let now = 0; (values.size < enough || now <= past) && performance.now() < end; ) {
        now = await new Promise((go) => requestAnimationFrame(go));
        const corner = (canvas) => canvas.getContext("2d").getImageData(1, 1, 1, 1).data[0];
        const frames = [...document.querySelectorAll("canvas.picture")].map(corner);
        seen.push([now, frames.map((grey) => grey / (240 / count))]);
        values.add(frames.at(-1));
      }
      return seen;
    },
    [enough, past, FRAMES, PATIENCE],
  );

/** The frame of an endless film that is due at a time of the page. */
const due = (ms) => Math.floor((ms * FPS) / 1000);
/** What becomes of its frames while the browser draws these. */
const becomes = (drawn) => {
  const steps = drawn.slice(1).map(([time], i) => due(time) - due(drawn[i][0]));
  const shown = steps.filter((step) => step > 0).length;
  return { shown, dropped: steps.reduce((sum, step) => sum + step, 0) - shown };
};

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
    const { page } = await open(t, FILM, SMALL, { frames: true });
    let begun;
    await arrive(page, async () => {
      begun = (await noted(page)).length;
    });
    await heading(page, "Practice 1 of 2");
    await look(page);
    const playing = (await noted(page)).length;
    const seen = await watched(page, FRAMES, (await noted(page)).at(-1)[0] + 2000);
    const alike = ([, [one, other]]) => one === other && Number.isInteger(one);
    assert.ok(seen.every(alike), JSON.stringify(seen.slice(0, 5)));
    // By the clock of the page: what is due, or what was when the browser drew last
    assert.equal(new Set(seen.map(([, frames]) => frames[0])).size, FRAMES);
    for (const [i, [now, [frame]]] of seen.entries()) {
      const right = [now, seen[i - 1]?.[0] ?? now - 1000 / FPS].map((ms) => due(ms) % FRAMES);
      assert.ok(right.includes(frame), `${frame} at ${now}, not ${right}`);
    }

    // A tile that is moved on plays, too
    const size = await test_picture(page).evaluate((canvas) => [canvas.width, canvas.height]);
    assert.deepEqual(size, [128, 64]);
    for (const x of [32, 96]) await test_picture(page).click({ position: { x, y: 32 } });
    const after = await watched(page, 2);
    assert.ok(new Set(after.map(([, frames]) => frames[1])).size > 1);
    assert.ok(after.every(([, frames]) => frames[0] === frames[1]));
    const before = (await noted(page)).length;
    await none(page).click();

    // A page that is held up drops frames, which the answer says
    await heading(page, "Practice 2 of 2");
    const ended = (await noted(page)).length;
    await look(page);
    const held = await page.evaluate(() => {
      const until = performance.now() + 600;
      while (performance.now() < until);
      return until;
    });
    await watched(page, 1, held);
    await none(page).click();
    await heading(page, "Trial 1 of 1");
    const [first, second] = (await answers(page)).map(({ timing }) => timing.frames);
    console.log("frames:", JSON.stringify([first, second]));
    // 600 ms are 14 frames
    assert.ok(second.dropped >= 12, JSON.stringify(second));
    // While the test looked, and at most from before the film began until after its end
    const drawn = await noted(page);
    const [least, most] = [drawn.slice(playing, before), drawn.slice(begun, ended)].map(becomes);
    for (const what of ["shown", "dropped"])
      assert.ok(least[what] <= first[what] && first[what] <= most[what], JSON.stringify({ least, first, most }));
    assert.ok(least.shown >= FRAMES);
  });

  test("intervals of a forced choice are loops, too", async (t) => {
    const { page } = await open(t, FILM_FORCED, SMALL, { frames: true });
    await arrive(page);
    await page.getByText("Which one was noisy").waitFor();
    await look(page);
    const onset = await page.evaluate(() => Number(document.querySelector(".stage").dataset.answers));
    await page.keyboard.press("1");
    await page.waitForFunction(() => document.querySelector("progress")?.value >= 1);
    const [{ timing }] = await answers(page);
    console.log("intervals:", JSON.stringify(timing));
    const frames = timing.frames.shown + timing.frames.dropped;
    const length = timing.intervals.reduce((sum, ms) => sum + ms);
    const expected = (length * FPS) / 1000;
    // An interval begins and ends within a frame of the film, and as much later and sooner as the browser draws. Beside
    // both, there are two pauses of half a second
    const drawn = (await noted(page)).filter(([time]) => time > onset - length - 1500 && time < onset);
    const late = Math.max(...drawn.slice(1).map(([, when], i) => when - drawn[i][0]));
    const most = 2 * (1 + (2 * late * FPS) / 1000);
    console.log(`frames of the browser come within ${late.toFixed(1)} ms`);
    assert.ok(Math.abs(frames - expected) <= most, `${frames}, not ${expected} ± ${most}`);
  });
});
