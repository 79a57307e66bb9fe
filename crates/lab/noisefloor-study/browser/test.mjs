// The pages in Chromium, against real servers that the Rust test `browser` starts and names in the environment.

import { describe, test } from "node:test";
import assert from "node:assert/strict";
import {
  FIREFOX,
  LARGE,
  SIDE_BY_SIDE,
  SMALL,
  accessible,
  arrive,
  code,
  heading,
  look,
  measure,
  noted,
  open,
  openScaled,
  reach,
  saved,
  settled,
  shot,
  test_picture,
  unscaled,
  watch,
} from "./kit.mjs";

const { ACQUISITION, VALIDATION, FORCED } = process.env;

/** An acquisition of this study: two trials of practice, then the data with no catch trials. */
const ready = async (
  page,
  name,
  words = name.startsWith("Practice") ? "This one does not count" : "Click where you see",
) => {
  await heading(page, name);
  await page.getByText(words).waitFor();
  await look(page);
};

/** Middle of a tile of the 3×2 grid of 128 pixels. */
const middle = (tile, ratio = 1) => ({
  x: ((tile % 3) * 128 + 64) / ratio,
  y: (Math.floor(tile / 3) * 128 + 64) / ratio,
});

/** Levels that the server has for the session under way. */
const levels = async (page) => (await settled(page)).trial.levels;

const none = (page) => page.getByRole("button", { name: "I see no difference" });

/** Passes the practice: noise is clicked, identical pictures are left alone. */
async function practise(page) {
  await ready(page, "Practice 1 of 2");
  for (let tile = 0; tile < 6; tile += 1) await test_picture(page).click({ position: middle(tile) });
  await none(page).click();
  await ready(page, "Practice 2 of 2");
  await none(page).click();
}

describe("the pages of a study", SIDE_BY_SIDE, () => {
  // First, since it takes longest: intervals and the pauses between them cannot be hurried
  test("forced choice, and erasure", async (t) => {
    const { page } = await open(t, FORCED, SMALL, { frames: true });
    await arrive(page);
    const right = (shown) => (shown.first < shown.second ? "1" : "2");
    await keys(page, 6, right, /(Which one was noisy)/, async (trial) => {
      if (trial === 4) {
        await accessible(page, "forced choice");
        await shot(page, "small-forced-choice");
      }
    });
    const text = await page.evaluate(async () => {
      const of = localStorage.getItem(`noisefloor.code.${location.pathname}`);
      return (await fetch(`api/sessions/${of}/export`)).text();
    });
    const shown = JSON.parse(text)
      .events.filter((e) => e.event.kind === "answer")
      .flatMap((e) => e.event.timing.intervals);
    console.log(`intervals of 60 ms were shown for ${shown.map((ms) => ms.toFixed(0)).join(", ")} ms`);
    assert.equal(shown.length, 12);
    // From one frame to the first that is 60 ms later, to half a frame: however long the machine takes for each
    const frames = (await noted(page)).map(([time]) => time);
    const ends = (from, to) => to - from > 1 && frames[to] - frames[from] >= 60 - (frames[to] - frames[to - 1]) / 2;
    const possible = frames.map((at, i) => frames.find((_, j) => ends(i, j)) - at);
    const unlike = shown.filter((ms) => !possible.some((other) => Math.abs(other - ms) < 1e-3));
    assert.deepEqual(unlike, [], "intervals that are no frames of the page");
    await heading(page, "Thank you");
    await page.getByRole("button", { name: "Erase my answers" }).click();
    await page.getByRole("button", { name: "Erase them for good?" }).click();
    await heading(page, "Erased");
    assert.equal(await page.evaluate(() => localStorage.length), 0);
  });

  test("a session by mouse, in a small window", async (t) => {
    const { page } = await open(t, ACQUISITION, SMALL);
    await arrive(page, async (at, name) => {
      await accessible(at, name);
      await shot(at, `small-${name}`);
    });
    await ready(page, "Practice 1 of 2");
    await accessible(page, "practice");
    await shot(page, "small-acquisition");
    await practise(page);
    await ready(page, "Trial 1 of 1");
    for (let tile = 0; tile < 6; tile += 1) {
      for (let level = 0; level <= tile; level += 1)
        await test_picture(page).click({ position: middle(tile) });
    }
    // Two too far, and back: by the right button, and by undoing
    await test_picture(page).click({ position: middle(2) });
    await test_picture(page).click({ position: middle(2), button: "right" });
    await test_picture(page).click({ position: middle(5) });
    await page.getByRole("button", { name: "Undo" }).click();
    assert.deepEqual(await levels(page), [1, 2, 3, 4, 5, 6]);
    await none(page).click();
    await heading(page, "Thank you");
    await accessible(page, "farewell");
    await shot(page, "small-farewell");
    const of = await code(page);
    const save = () => page.getByRole("button", { name: "Save my answers" }).click();
    const asked = () => page.evaluate(async (of) => (await fetch(`api/sessions/${of}/export`)).text(), of);
    const text = String(await saved(page, save, asked));
    const answers = JSON.parse(text);
    assert.match(text, /"seed": ?"\d+"/, "the seed is exact, as text");
    const steps = answers.events.map((e) => e.event).filter((e) => e.kind === "step");
    assert.equal(steps.length, 6 + 21 + 4);
    assert.ok(
      steps.every((s) => s.ms >= 300) &&
        steps.slice(0, 6).every((s, tile) => Math.abs(s.at[0] - middle(tile).x) <= 1),
    );
  });

  test("the practice is asked for again, and a double click answers nothing", async (t) => {
    const { page } = await open(t, ACQUISITION, SMALL);
    await arrive(page);
    await heading(page, "Practice 1 of 2");
    await page.getByText("This one does not count").waitFor();
    await look(page);
    await none(page).dblclick();
    await ready(page, "Practice 2 of 2");
    await none(page).click();
    await heading(page, "Once more for practice");
    await accessible(page, "practice again");
    await shot(page, "small-practice-again");
    await page.getByRole("button", { name: "Go on" }).click();
    await practise(page);
    await ready(page, "Trial 1 of 1");
  });

  test("a session by keyboard alone, in a large window, in French", async (t) => {
    const { page } = await open(t, ACQUISITION, LARGE, { locale: "fr-FR" });
    const focus = (name) => reach(page, name);
    await page.getByRole("button", { name: "Commencer" }).waitFor();
    assert.equal(await page.evaluate(() => document.documentElement.lang), "fr");
    await accessible(page, "bienvenue");
    await shot(page, "large-welcome-fr");
    await focus("group");
    await page.keyboard.press("ArrowDown");
    await focus("Commencer");
    await page.keyboard.press("Enter");
    await heading(page, "Avant de commencer");
    await focus("agree");
    await page.keyboard.press("Space");
    await focus("Continuer");
    await page.keyboard.press("Enter");
    await heading(page, "Comment vous voyez les images");
    await focus("card-width");
    for (let i = 0; i < 20; i += 1) await page.keyboard.press("PageUp");
    await page.keyboard.press("Home");
    await page.locator("#card-width").press("End");
    await page.locator("#card-width").fill("324");
    await focus("distance");
    await page.keyboard.type("60");
    await focus("gamma");
    await page.keyboard.press("PageDown");
    await page.locator("#gamma").fill("186");
    await page.keyboard.press("Tab");
    await page.keyboard.press("ArrowDown");
    await shot(page, "large-conditions-fr");
    await focus("Continuer");
    await page.keyboard.press("Enter");
    // The cross begins in the middle of 384×256 and moves by 22 pixels: to each tile in turn
    const walk = async (key, times) => {
      for (let i = 0; i < times; i += 1) await page.keyboard.press(key);
    };
    const tour = async (mark) => {
      await walk("ArrowLeft", 6);
      await walk("ArrowUp", 3);
      await mark();
      for (let i = 0; i < 2; i += 1) {
        await walk("ArrowRight", 6);
        await mark();
      }
      await walk("ArrowDown", 6);
      await mark();
      for (let i = 0; i < 2; i += 1) {
        await walk("ArrowLeft", 6);
        await mark();
      }
    };
    await ready(page, "Entraînement 1 sur 2", "Celui-ci ne compte pas");
    const canvas = test_picture(page);
    assert.ok(await canvas.evaluate((c) => c === document.activeElement), "the picture has the focus");
    await page.keyboard.press("Enter");
    assert.deepEqual(
      await levels(page),
      [0, 0, 0, 0, 0, 0],
      "the first key shows the cross, and answers nothing",
    );
    await tour(() => page.keyboard.press("Enter"));
    await page.keyboard.press("d");
    await ready(page, "Entraînement 2 sur 2", "Celui-ci ne compte pas");
    await page.keyboard.press("d");
    await ready(page, "Essai 1 sur 1", "Cliquez où vous voyez");
    await tour(async () => {
      await walk("Enter", 3);
      await page.keyboard.press("Backspace");
    });
    await shot(page, "large-acquisition-fr");
    await accessible(page, "essai");
    assert.deepEqual(await levels(page), [2, 2, 2, 2, 2, 2]);
    await page.keyboard.press("d");
    await heading(page, "Merci");
    await shot(page, "large-farewell-fr");
  });

  test("a session goes on after the browser was closed, and elsewhere by its code", async (t) => {
    const { context, page, problems } = await open(t, ACQUISITION, SMALL);
    await arrive(page);
    await ready(page, "Practice 1 of 2");
    for (let i = 0; i < 3; i += 1) await test_picture(page).click({ position: middle(4) });
    assert.deepEqual(await levels(page), [0, 0, 0, 0, 3, 0]);
    await page.close();
    const again = await context.newPage();
    watch(again, problems);
    await again.goto(ACQUISITION);
    await ready(again, "Practice 1 of 2");
    assert.deepEqual(await levels(again), [0, 0, 0, 0, 3, 0]);
    await again.getByRole("button", { name: "Pause" }).click();
    await heading(again, "Paused");
    await accessible(again, "paused");
    const code = (await again.locator("#code").textContent()).toLowerCase();

    // Elsewhere the screen is another one: it is measured again
    const other = await open(t, ACQUISITION, LARGE, { screen: { width: 2560, height: 1440 } });
    await other.page.getByLabel("Your return code").fill("0000-0000-0000");
    await other.page.getByRole("button", { name: "Go on where you stopped" }).click();
    await other.page.getByText("No session has this code").waitFor();
    await other.page.getByLabel("Your return code").fill(code);
    await other.page.getByRole("button", { name: "Go on where you stopped" }).click();
    await heading(other.page, "Paused");
    await other.page.getByRole("button", { name: "Go on where you stopped" }).click();
    await other.page.getByText("The screen or the zoom of the page has changed").waitFor();
    await measure(other.page);
    await ready(other.page, "Practice 1 of 2");
    assert.deepEqual(await levels(other.page), [0, 0, 0, 0, 3, 0]);
  });

  test("clicks made without a connection arrive later, in order", async (t) => {
    const { context, page } = await open(t, ACQUISITION, SMALL);
    await arrive(page);
    await ready(page, "Practice 1 of 2");
    await context.setOffline(true);
    for (let i = 0; i < 4; i += 1) await test_picture(page).click({ position: middle(i % 2) });
    await page.getByText("The server cannot be reached").waitFor();
    await shot(page, "small-offline");
    await context.setOffline(false);
    assert.deepEqual(await levels(page), [2, 2, 0, 0, 0, 0]);
  });

  for (const ratio of [1, 2]) {
    test(`one image pixel is one device pixel at ratio ${ratio}`, async (t) => {
      const { page } = await open(t, VALIDATION, LARGE, { deviceScaleFactor: ratio });
      await arrive(page);
      await page.getByText("Are these two pictures identical?").waitFor();
      await look(page);
      assert.ok(await page.locator("#cover").isHidden());
      assert.equal(await unscaled(page, ratio), 0, "values on the screen that are not those of the picture");
    });
  }

  // Emulated ratios are scaled after layout; those of the system, which people have, are not
  for (const ratio of [1.25, 1.5]) {
    test(`one image pixel is one device pixel at a system scaling of ${100 * ratio} %`, async (t) => {
      const { page } = await openScaled(t, VALIDATION, ratio);
      await arrive(page);
      await page.getByText("Are these two pictures identical?").waitFor();
      assert.equal(await page.evaluate(() => devicePixelRatio), ratio);
      await shot(page, `scaled-${ratio}`);
      assert.equal(await unscaled(page, ratio), 0, "values on the screen that are not those of the picture");
    });
  }

  test("pictures that would be cut off or recoloured are not shown", async (t) => {
    const { page } = await open(t, VALIDATION, { width: 700, height: 500 });
    await page.getByRole("button", { name: "Begin" }).click();
    await page.getByText("The window is too small").waitFor();
    await page.setViewportSize(LARGE);
    await heading(page, "Before you begin");
    // Firefox takes no colours from its driver
    if (!FIREFOX) {
      await page.emulateMedia({ forcedColors: "active" });
      await page.getByText("high contrast").waitFor();
      await accessible(page, "covered");
      await shot(page, "large-high-contrast");
      await page.emulateMedia({ forcedColors: "none" });
    }
    await page.getByLabel("I have read this").check();
    // Nor does it do without the mouse in one window
    if (FIREFOX) return;
    const phone = await open(
      t,
      VALIDATION,
      { width: 390, height: 844 },
      { hasTouch: true, isMobile: true, deviceScaleFactor: 3 },
    );
    await phone.page.getByRole("button", { name: "Begin" }).click();
    await phone.page.locator("#cover").waitFor();
    await shot(phone.page, "phone");
  });

  /** Answers the trials with keys, the practice rightly; `each(trial)` looks at them. */
  async function keys(page, trials, right, words, each = async () => {}) {
    for (let trial = 0; trial < trials; trial += 1) {
      await page.getByText(words).waitFor();
      await look(page);
      await each(trial);
      const { trial: shown } = await settled(page);
      await page.keyboard.press(shown.practice ? right(shown) : trial % 2 ? "1" : "2");
      await page.waitForFunction((n) => (document.querySelector("progress")?.value ?? 99) > n, trial);
    }
  }

  test("validation, by keys", async (t) => {
    const { page } = await open(t, VALIDATION, SMALL);
    await arrive(page);
    const right = (shown) => (JSON.stringify(shown.left) === JSON.stringify(shown.right) ? "1" : "2");
    await keys(page, 5, right, "Are these two pictures identical?", async (trial) => {
      if (trial === 0) await accessible(page, "validation");
      if (trial === 2) {
        await heading(page, "Trial 1 of 3");
        await shot(page, "small-validation");
      }
    });
    await heading(page, "Thank you");
  });
});
