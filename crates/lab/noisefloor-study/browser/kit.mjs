// What the browser's tests share: one Chromium, windows that may ask nobody else, axe, screenshots.

import { before, after } from "node:test";
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { readFileSync, mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium, firefox } from "playwright-core";

const shots = process.env.NOISEFLOOR_SCREENSHOTS;
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
export const SMALL = { width: 1024, height: 640 };
export const LARGE = { width: 1920, height: 1080 };
/** The style by which Playwright hides the caret in screenshots: in Firefox, the policy of the pages forbids it. */
const CARET = "sha256-YjaKGiklmzC6wjXA513HAMmzus8VE61XCOT+SmwNZWA=";
/** Time after which something on a page has failed to come, in milliseconds; long, since tests run side by side. */
export const PATIENCE = 60000;

/** Firefox as it is installed, driven by WebDriver BiDi, if the environment asks for it; Chromium otherwise. */
export const FIREFOX = process.env.NOISEFLOOR_BROWSER === "firefox";

/** Tests of one file that know nothing of one another: most of their time is spent waiting. Firefox, which gives the
 * focus to one window only, runs them one by one. */
export const SIDE_BY_SIDE = { concurrency: FIREFOX ? 1 : 3 };

let browser;
const profile = mkdtempSync(join(tmpdir(), "noisefloor-browser-"));

const launch_chromium = (...more) =>
  chromium.launch({
    executablePath: "/usr/bin/chromium",
    args: [
      "--headless",
      "--no-sandbox",
      "--disable-gpu",
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      ...more,
    ],
    env: { ...process.env, HOME: profile },
  });

/** A mouse, which Firefox lacks without a display: fine, and able to hover. */
const MOUSE = { "ui.primaryPointerCapabilities": 6, "ui.allPointerCapabilities": 6 };
const launch_firefox = (preferences = {}, ...args) =>
  firefox.launch({
    channel: "moz-firefox",
    executablePath: "/usr/bin/firefox-esr",
    args,
    firefoxUserPrefs: { ...MOUSE, ...preferences },
    env: { ...process.env, HOME: profile },
  });

const launch = () => (FIREFOX ? launch_firefox() : launch_chromium());

before(async () => {
  browser = await launch();
  if (shots) mkdirSync(shots, { recursive: true });
});
after(async () => {
  await browser.close();
  rmSync(profile, { recursive: true, force: true });
});

/** A window of a system whose scaling is not 100 %. */
export async function openScaled(t, url, ratio) {
  const scaled = FIREFOX
    ? await launch_firefox({ "layout.css.devPixelsPerPx": String(ratio) }, "--width=2400", "--height=1500")
    : await launch_chromium(`--force-device-scale-factor=${ratio}`, "--window-size=2400,1500");
  const context = await scaled.newContext({ viewport: null, locale: "en-GB" });
  t.after(() => scaled.close());
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  await page.goto(url);
  return { page };
}

/** In a page: notes its frames, in the order in which the browser draws them, as [their time, when they were drawn]. */
const note = () => {
  globalThis.drawn = [];
  const next = (time) => {
    globalThis.drawn.push([time, performance.now()]);
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
};

/** A window of its own. Requests to any other machine, and anything written to the console as an error, fail the
 * test; `refusals` are expected where a test asks for them. Its frames are noted if `frames` says so. */
export async function open(t, url, viewport, { refusals = false, frames = false, ...options } = {}) {
  const context = await browser.newContext({ viewport, locale: "en-GB", ...options });
  const problems = [];
  context.on("request", (request) => {
    const to = new URL(request.url());
    if (to.protocol !== "blob:" && to.origin !== new URL(url).origin)
      problems.push(`left the machine: ${to}`);
  });
  const page = await context.newPage();
  watch(page, problems, refusals);
  page.setDefaultTimeout(PATIENCE);
  t.after(async () => {
    await context.close();
    assert.deepEqual(problems, []);
  });
  if (frames) await page.addInitScript(note);
  await page.goto(url);
  return { context, page, problems };
}

export function watch(page, problems, refusals = false) {
  page.on("pageerror", (error) => {
    if (!String(error).includes(CARET)) problems.push(String(error));
  });
  page.on("console", (said) => {
    const text = said.text();
    const expected =
      /ERR_INTERNET_DISCONNECTED|404/.test(text) || (refusals && /status of 4(22|03)/.test(text));
    if (said.type() === "error" && !expected) problems.push(said.text());
  });
}

export async function accessible(page, name) {
  // The policy of the pages forbids scripts from elsewhere: axe is evaluated by the debugger
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  const found = violations.map((v) => `${v.id}: ${v.help} (${v.nodes.map((n) => n.target).join(", ")})`);
  assert.deepEqual(found, [], name);
}

export async function shot(page, name) {
  if (shots) await page.screenshot({ path: join(shots, `${name}.png`) });
}

/** Puts a number in place of the one in a field, by keys: what `fill` does in Firefox adds to it. */
export async function retype(page, id, text) {
  await page.locator(id).press("Control+A");
  await page.keyboard.type(text);
}

/** The bytes of the file that `act` saves; Firefox does not tell its driver of downloads, so there `otherwise` says. */
export async function saved(page, act, otherwise) {
  const download = FIREFOX ? null : page.waitForEvent("download");
  await act();
  return download ? readFileSync(await (await download).path()) : otherwise();
}

export const heading = (page, text) => page.getByRole("heading", { name: text }).waitFor();

/** Measures the screen: nothing is filled in beforehand, and nothing can be left out. */
export async function measure(page) {
  await heading(page, "How you see the pictures");
  const go = page.getByRole("button", { name: "Go on" });
  assert.ok(await go.isDisabled());
  await page.getByText("Still missing: size of the screen, distance").waitFor();
  await page.locator("#card-width").fill("324");
  await page.locator("#distance").fill("60");
  await page.locator("#gamma").fill("186");
  assert.ok(await go.isDisabled());
  await page.getByLabel("dim").check();
  await go.click();
}

/** Consent and conditions, from the first page to the first trial. `each(page, name)` looks at every page. */
export async function arrive(page, each = async () => {}) {
  const begin = page.getByRole("button", { name: "Begin" });
  await begin.waitFor();
  await each(page, "welcome");
  if ((await page.locator("#group").count()) > 0) {
    assert.ok(await begin.isDisabled(), "a group has to be chosen");
    await page.locator("#group").selectOption({ index: 1 });
  }
  await begin.click();
  await heading(page, "Before you begin");
  await each(page, "consent");
  assert.ok(await page.getByRole("button", { name: "Go on" }).isDisabled());
  await page.getByLabel("I have read this").check();
  await page.getByRole("button", { name: "Go on" }).click();
  await heading(page, "How you see the pictures");
  await each(page, "conditions");
  await measure(page);
}

/** Code of the session in this window. */
export const code = (page) =>
  page.evaluate(() => localStorage.getItem(`noisefloor.code.${location.pathname}`));

/** The session as the server has it, once nothing is under way. */
export const settled = (page) =>
  page.evaluate(async (patience) => {
    const of = localStorage.getItem(`noisefloor.code.${location.pathname}`);
    for (const end = Date.now() + patience; Date.now() < end; ) {
      if (JSON.parse(localStorage.getItem(`noisefloor.outbox.${of}`)).length === 0) break;
      await new Promise((go) => setTimeout(go, 10));
    }
    return (await fetch(`api/sessions/${of}`)).json();
  }, PATIENCE);

/** The frames of a window that notes them. */
export const noted = (page) => page.evaluate(() => globalThis.drawn);

/** Waits until answers count: what comes sooner is not taken. */
export const look = (page) =>
  page.waitForFunction(() => {
    const from = document.querySelector(".stage")?.dataset.answers;
    return from !== undefined && performance.now() > Number(from);
  });

/** Presses Tab until something has the focus whose name or identifier begins so. */
export async function reach(page, name) {
  for (let i = 0; i < 60; i += 1) {
    const at = await page.evaluate(() => {
      const { id, textContent } = document.activeElement ?? {};
      return [id, textContent].map((text) => text?.trim() ?? "");
    });
    if (at.some((text) => text.startsWith(name))) return;
    await page.keyboard.press("Tab");
  }
  assert.fail(`${name} cannot be reached by Tab`);
}

/** Goes to a control by Tab alone, and presses a key there. */
export async function press(page, name, key = "Enter") {
  await reach(page, name);
  await page.keyboard.press(key);
}

export const test_picture = (page) => page.locator("canvas.picture").nth(1);

/** Pixels of the screen where the picture is, against the pixels of the picture. */
export async function unscaled(page, ratio) {
  const canvas = page.locator("canvas.picture").first();
  const box = await canvas.boundingBox();
  for (const at of [box.x, box.y])
    assert.ok(Math.abs(at * ratio - Math.round(at * ratio)) < 0.02, JSON.stringify(box));
  // The whole window: clips are rounded to CSS pixels
  const png = await page.screenshot({ scale: "device" });
  return canvas.evaluate(
    async (picture, [base64, x, y]) => {
      const shown = await createImageBitmap(
        new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], { type: "image/png" }),
      );
      const screen = new OffscreenCanvas(shown.width, shown.height).getContext("2d");
      screen.drawImage(shown, 0, 0);
      const { width, height } = picture;
      const a = screen.getImageData(x, y, width, height).data;
      const b = picture.getContext("2d").getImageData(0, 0, width, height).data;
      return a.reduce((count, v, i) => count + (v === b[i] ? 0 : 1), 0);
    },
    [png.toString("base64"), Math.round(box.x * ratio), Math.round(box.y * ratio)],
  );
}
