// Calibrations in Chromium, at servers that the Rust test `browser` starts.

import { test } from "node:test";
import assert from "node:assert/strict";
import { LARGE, SMALL, accessible, heading, look, measure, open, press, shot, unscaled } from "./kit.mjs";

const { LOOKING, GUESSING } = process.env;
/** Root mean square of the differences in code values from which the observer of these tests sees noise. */
const SEES = 1.6;

/** For each picture, how much it differs from the one that most others equal: 0 but for the noisy one. */
const noise = (page) =>
  page.evaluate(() => {
    const all = [...document.querySelectorAll("#four canvas")].map(
      (canvas) => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data,
    );
    const apart = (a, b) => Math.sqrt(a.reduce((sum, v, i) => sum + (v - b[i]) ** 2, 0) / (0.75 * a.length));
    const clean = all.find((a) => all.filter((b) => apart(a, b) === 0).length === all.length - 1);
    return all.map((a) => apart(a, clean));
  });

/** Waits for the next trial, or the end; false at the end. */
async function next(page, last) {
  await page.waitForFunction((last) => {
    if (!document.querySelector("#four")) return Boolean(document.querySelector("section.sheet"));
    const number = document.getElementById("status").textContent.trim();
    return number !== last && document.querySelector(".stage").dataset.answers;
  }, last);
  if ((await page.locator("#four").count()) === 0) return null;
  await look(page);
  return (await page.locator("#status").textContent()).trim();
}

async function begin(page) {
  await heading(page, "Your eyes and your display");
  await press(page, "Begin");
  await measure(page);
  await heading(page, "Which one has noise?");
}

test("somebody who looks is measured, with keys alone, in a small window", async (t) => {
  const { page } = await open(t, LOOKING, SMALL);
  await heading(page, "Your eyes and your display");
  await accessible(page, "welcome");
  await shot(page, "calibrate-welcome");
  await begin(page);
  let [trial, seen] = [null, new Set()];
  let trials = 0;
  while ((trial = await next(page, trial)) !== null) {
    const found = await noise(page);
    const noisy = found.findIndex((rms) => rms > 0);
    assert.equal(found.filter((rms) => rms > 0).length, 1, `${found}`);
    seen.add(found[noisy]);
    if (trials === 0) {
      await accessible(page, "trial");
      await shot(page, "calibrate-trial");
    }
    trials += 1;
    await page.keyboard.press(String(found[noisy] > SEES ? noisy + 1 : 1 + (trials % 4)));
  }
  assert.equal(seen.size, trials, "the same noise twice");
  await page.getByText("a probability of 80 %").waitFor();
  await accessible(page, "result");
  await shot(page, "calibrate-result");
  assert.match(await page.locator("h1").textContent(), /^You need [0-9.]+ times the samples$/);
});

test("values on the screen are those sent, and who guesses is told so", async (t) => {
  for (const ratio of [1, 2]) {
    const { page } = await open(t, GUESSING, LARGE, { deviceScaleFactor: ratio });
    await begin(page);
    await next(page, null);
    await shot(page, `calibrate-ratio-${ratio}`);
    assert.equal(await unscaled(page, ratio), 0, "values on the screen that are not those of the picture");
    if (ratio === 2) {
      let trial = null;
      while ((trial = await next(page, trial)) !== null) await page.keyboard.press("2");
      await page.getByText("as by guessing").waitFor();
      await accessible(page, "refused");
      await press(page, "Try again");
    } else {
      // Another screen has to be measured, too
      const headers = { "content-type": "application/json" };
      await page.evaluate((headers) => fetch("/api/again", { method: "POST", headers, body: "{}" }), headers);
      await page.reload();
    }
    await heading(page, "Your eyes and your display");
  }
});
