// The pages in Chromium, against real servers that the Rust test `browser` starts and names in the environment.

import { test } from "node:test";
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { LARGE, SMALL, accessible, arrive, heading, open, shot, test_picture, watch } from "./kit.mjs";

const { ACQUISITION, VALIDATION, FORCED } = process.env;

const ready = async (page, number) => {
  await heading(page, number === 0 ? "Practice" : `Trial ${number + 1}`);
  await page.getByText(number === 0 ? "This one does not count" : "Click where you see").waitFor();
};

/** Middle of a tile of the 3×2 grid of 128 pixels. */
const middle = (tile, ratio = 1) => ({ x: ((tile % 3) * 128 + 64) / ratio, y: (Math.floor(tile / 3) * 128 + 64) / ratio });

/** Levels that the server has for the session under way. */
const levels = (page) => page.evaluate(async () => {
  const code = localStorage.getItem("noisefloor.code");
  for (let i = 0; i < 100; i += 1) {
    if (JSON.parse(localStorage.getItem(`noisefloor.outbox.${code}`)).length === 0) break;
    await new Promise((go) => setTimeout(go, 20));
  }
  return (await (await fetch(`/api/sessions/${code}`)).json()).trial.levels;
});

test("a session by mouse, in a small window", async (t) => {
  const { page } = await open(t, ACQUISITION, SMALL);
  await arrive(page, async (at, name) => { await accessible(at, name); await shot(at, `small-${name}`); });
  await ready(page, 0);
  await accessible(page, "practice");
  await shot(page, "small-acquisition");
  await test_picture(page).click({ position: middle(0) });
  await page.getByRole("button", { name: "I see no difference" }).click();
  await ready(page, 1);
  for (let tile = 0; tile < 6; tile += 1) {
    for (let level = 0; level <= tile; level += 1) await test_picture(page).click({ position: middle(tile) });
  }
  // Two too far, and back: by the right button, and by undoing
  await test_picture(page).click({ position: middle(2) });
  await test_picture(page).click({ position: middle(2), button: "right" });
  await test_picture(page).click({ position: middle(5) });
  await page.getByRole("button", { name: "Undo" }).click();
  assert.deepEqual(await levels(page), [1, 2, 3, 4, 5, 6]);
  await page.getByRole("button", { name: "I see no difference" }).click();
  await heading(page, "Thank you");
  await accessible(page, "farewell");
  await shot(page, "small-farewell");
  const download = page.waitForEvent("download");
  await page.getByRole("button", { name: "Save my answers" }).click();
  const saved = JSON.parse(readFileSync(await (await download).path(), "utf8"));
  assert.equal(saved.events.filter((e) => e.event.kind === "step").length, 1 + 21 + 4);
});

test("a session by keyboard alone, in a large window, in French", async (t) => {
  const { page } = await open(t, ACQUISITION, LARGE, { locale: "fr-FR" });
  const focus = async (name) => {
    for (let i = 0; i < 40; i += 1) {
      const at = await page.evaluate(() => document.activeElement?.textContent || document.activeElement?.id || document.activeElement?.value || "");
      if (at.startsWith(name)) return;
      await page.keyboard.press("Tab");
    }
    assert.fail(`${name} cannot be reached by Tab`);
  };
  await page.getByRole("button", { name: "Commencer" }).waitFor();
  assert.equal(await page.evaluate(() => document.documentElement.lang), "fr");
  await accessible(page, "bienvenue");
  await shot(page, "large-welcome-fr");
  await focus("Commencer");
  await page.keyboard.press("Enter");
  await heading(page, "Avant de commencer");
  await focus("agree");
  await page.keyboard.press("Space");
  await focus("Continuer");
  await page.keyboard.press("Enter");
  await heading(page, "Comment vous voyez les images");
  await focus("card-width");
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowLeft");
  await focus("gamma");
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Space");
  await shot(page, "large-conditions-fr");
  await focus("Continuer");
  await page.keyboard.press("Enter");
  await heading(page, "Entraînement");
  await page.getByText("Celui-ci ne compte pas").waitFor();
  await page.keyboard.press("d");
  await heading(page, "Essai 2");
  await page.getByText("Cliquez où vous voyez").waitFor();
  // The cross begins in the middle of 384×256 and moves by 22 pixels: to each tile in turn
  const canvas = test_picture(page);
  assert.ok(await canvas.evaluate((c) => c === document.activeElement), "the picture has the focus");
  const walk = async (key, times) => { for (let i = 0; i < times; i += 1) await page.keyboard.press(key); };
  const mark = async () => { await page.keyboard.press("Enter"); await page.keyboard.press("Enter"); await page.keyboard.press("Enter"); await page.keyboard.press("Backspace"); };
  await walk("ArrowLeft", 6);
  await walk("ArrowUp", 3);
  await mark();
  await shot(page, "large-acquisition-fr");
  await accessible(page, "essai");
  for (let i = 0; i < 2; i += 1) { await walk("ArrowRight", 6); await mark(); }
  await walk("ArrowDown", 6);
  await mark();
  for (let i = 0; i < 2; i += 1) { await walk("ArrowLeft", 6); await mark(); }
  assert.deepEqual(await levels(page), [2, 2, 2, 2, 2, 2]);
  await page.keyboard.press("d");
  await heading(page, "Merci");
  await shot(page, "large-farewell-fr");
});

test("a session goes on after the browser was closed, and elsewhere by its code", async (t) => {
  const { context, page, problems } = await open(t, ACQUISITION, SMALL);
  await arrive(page);
  await ready(page, 0);
  for (let i = 0; i < 3; i += 1) await test_picture(page).click({ position: middle(4) });
  assert.deepEqual(await levels(page), [0, 0, 0, 0, 3, 0]);
  await page.close();
  const again = await context.newPage();
  watch(again, problems);
  await again.goto(ACQUISITION);
  await ready(again, 0);
  assert.deepEqual(await levels(again), [0, 0, 0, 0, 3, 0]);
  await again.getByRole("button", { name: "Pause" }).click();
  await heading(again, "Paused");
  await accessible(again, "paused");
  const code = (await again.locator("#code").textContent()).toLowerCase();

  const other = await open(t, ACQUISITION, LARGE);
  await other.page.getByLabel("Your code").fill("0000-0000-0000");
  await other.page.getByRole("button", { name: "Go on where you stopped" }).click();
  await other.page.getByText("No session has this code").waitFor();
  await other.page.getByLabel("Your code").fill(code);
  await other.page.getByRole("button", { name: "Go on where you stopped" }).click();
  await heading(other.page, "Paused");
  await other.page.getByRole("button", { name: "Go on where you stopped" }).click();
  await ready(other.page, 0);
  assert.deepEqual(await levels(other.page), [0, 0, 0, 0, 3, 0]);
});

test("clicks made without a connection arrive later, in order", async (t) => {
  const { context, page } = await open(t, ACQUISITION, SMALL);
  await arrive(page);
  await ready(page, 0);
  await context.setOffline(true);
  for (let i = 0; i < 4; i += 1) await test_picture(page).click({ position: middle(i % 2) });
  await page.getByText("The server cannot be reached").waitFor();
  await shot(page, "small-offline");
  await context.setOffline(false);
  assert.deepEqual(await levels(page), [2, 2, 0, 0, 0, 0]);
});

/** Pixels of the screen where the picture is, against the pixels of the picture. */
async function unscaled(page, ratio) {
  const canvas = page.locator("canvas.picture").first();
  const box = await canvas.boundingBox();
  for (const at of [box.x, box.y]) assert.equal(at * ratio, Math.round(at * ratio), JSON.stringify(box));
  // The whole window: clips are rounded to CSS pixels
  const png = await page.screenshot({ scale: "device" });
  return canvas.evaluate(async (picture, [base64, x, y]) => {
    const shown = await createImageBitmap(new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], { type: "image/png" }));
    const screen = new OffscreenCanvas(shown.width, shown.height).getContext("2d");
    screen.drawImage(shown, 0, 0);
    const { width, height } = picture;
    const a = screen.getImageData(x, y, width, height).data;
    const b = picture.getContext("2d").getImageData(0, 0, width, height).data;
    return a.reduce((count, v, i) => count + (v === b[i] ? 0 : 1), 0);
  }, [png.toString("base64"), box.x * ratio, box.y * ratio]);
}

for (const ratio of [1, 2]) {
  test(`one image pixel is one device pixel at ratio ${ratio}`, async (t) => {
    const { page } = await open(t, VALIDATION, LARGE, { deviceScaleFactor: ratio });
    await arrive(page);
    await page.getByText("Are these two pictures identical?").waitFor();
    assert.equal(await unscaled(page, ratio), 0, "values on the screen that are not those of the picture");
  });
}

test("scaled or cut off pictures are not shown", async (t) => {
  const zoomed = await open(t, VALIDATION, LARGE, { deviceScaleFactor: 1.25 });
  await zoomed.page.getByRole("button", { name: "Begin" }).click();
  await zoomed.page.getByText("The page is zoomed").waitFor();
  await shot(zoomed.page, "large-zoomed");
  await accessible(zoomed.page, "zoomed");
  const { page } = await open(t, VALIDATION, { width: 700, height: 500 });
  await page.getByRole("button", { name: "Begin" }).click();
  await page.getByText("The window is too small").waitFor();
  await page.setViewportSize(LARGE);
  await heading(page, "Before you begin");
  await page.getByLabel("I have read this").check();
});

test("validation, by keys", async (t) => {
  const { page } = await open(t, VALIDATION, SMALL);
  await arrive(page);
  await page.getByText("Are these two pictures identical?").waitFor();
  await accessible(page, "validation");
  for (let trial = 0; trial < 5; trial += 1) {
    await heading(page, trial < 2 ? "Practice" : `Trial ${trial + 1}`);
    await page.getByText("Are these two pictures identical?").waitFor();
    if (trial === 2) await shot(page, "small-validation");
    await page.locator("progress").evaluate((p, n) => { if (p.value !== n) throw new Error(`at ${p.value}`); }, trial);
    await page.keyboard.press(trial % 2 ? "1" : "2");
    await page.waitForFunction((n) => (document.querySelector("progress")?.value ?? 99) > n, trial);
  }
  await heading(page, "Thank you");
});

test("forced choice, and erasure", async (t) => {
  const { page } = await open(t, FORCED, SMALL);
  await arrive(page);
  for (let trial = 0; trial < 6; trial += 1) {
    await page.getByRole("button", { name: "First" }).waitFor();
    if (trial === 4) { await accessible(page, "forced choice"); await shot(page, "small-forced-choice"); }
    await page.keyboard.press(trial % 2 ? "1" : "2");
    await page.waitForFunction((n) => (document.querySelector("progress")?.value ?? 99) > n, trial);
  }
  await heading(page, "Thank you");
  await page.getByRole("button", { name: "Erase my answers" }).click();
  await page.getByRole("button", { name: "Erase them for good?" }).click();
  await heading(page, "Erased");
  assert.equal(await page.evaluate(() => localStorage.length), 0);
});
