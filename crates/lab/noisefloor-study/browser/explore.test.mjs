// One's own pictures in Chromium, at an explorer that the Rust test `browser` starts.

import { test } from "node:test";
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { basename } from "node:path";
import { LARGE, PATIENCE, SMALL, accessible, open, retype, saved, shot } from "./kit.mjs";

const { EXPLORER, STACK } = process.env;
/** Files of a stack, and one of another size. */
const { stack, other } = JSON.parse(STACK);

/** Drops files on the page, as the file manager does. */
async function drop(page, paths) {
  const files = paths.map((path) => ({
    name: basename(path),
    base64: readFileSync(path).toString("base64"),
  }));
  const transfer = await page.evaluateHandle((files) => {
    const made = new DataTransfer();
    for (const { name, base64 } of files)
      made.items.add(new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], name));
    return made;
  }, files);
  await page.dispatchEvent("#drop", "dragover", { dataTransfer: transfer });
  await page.dispatchEvent("#drop", "drop", { dataTransfer: transfer });
}

const tile = (page, n) => page.locator("#tiles button").nth(n);
const label = (page, n) => tile(page, n).getAttribute("aria-label");
const state = (page) => page.evaluate(async () => (await fetch("/api/state")).json());
const kept = async (page) => (await state(page)).disagreements;
const until = async (what, condition) => {
  for (const end = Date.now() + PATIENCE; Date.now() < end; ) {
    if (await condition()) return;
    await new Promise((go) => setTimeout(go, 25));
  }
  assert.fail(what);
};

/** Nothing of the tests before. */
async function empty(page) {
  await page.evaluate(async () => {
    await fetch("/api/pictures", { method: "DELETE" });
    for (let id = 1; id < 60; id += 1) await fetch(`/api/disagreements/${id}`, { method: "DELETE" });
  });
  await page.reload();
  await page.getByText("Judge pictures of your own").waitFor();
}

test("pictures are dropped, judged and disagreed with by mouse, in a small window", async (t) => {
  const { page } = await open(t, EXPLORER, SMALL, { refusals: true });
  await empty(page);
  await accessible(page, "empty");
  await shot(page, "explore-empty");

  // One alone says what is missing; another size is refused; then the stack
  await drop(page, [stack[0]]);
  await page.getByRole("alert").getByText("othing to compare the picture with").waitFor();
  await accessible(page, "one picture");
  await shot(page, "explore-alone");
  await drop(page, [other]);
  await page.getByRole("alert").getByText("different sizes").waitFor();
  await drop(page, stack.slice(1));
  // These pictures do not show whether they share samples: the page asks
  await page.getByRole("alert").getByText("do not show whether").waitFor();
  await page.locator("#samples").selectOption("independent");
  await page.getByText("tiles have converged at").waitFor();
  await until("nothing is wrong any more", () => page.getByRole("alert").isHidden());
  const tiles = await page.locator("#tiles button").count();
  assert.equal(tiles, 6);
  await accessible(page, "judged");
  await shot(page, "explore-small");

  // The levels of the stack: noisy first, converged last
  const summary = () => page.locator("#summary").textContent();
  assert.match(await summary(), /^0 of 6 tiles have converged at 50 spp/);
  await page.locator("#level").fill(String(stack.length - 2));
  await page.getByText(`6 of 6 tiles have converged at`).waitFor();
  await page.locator("#level").fill("0");
  await page.getByText("0 of 6").waitFor();

  // The share of people changes verdicts at once, and the audience what is needed
  const probability = async () => Number(/P (\d\.\d+)/.exec(await label(page, 0))[1]);
  const need = async () => Number(/, (\d+) spp predicted/.exec(await label(page, 0))?.[1]);
  const before = await need();
  await page.locator("#audience").selectOption("line");
  await retype(page, "#slope", "2");
  await until("a harder audience needs more", async () => (await need()) > 1.8 * before);
  await page.locator("#audience").selectOption("observers");
  await until("the observers need as much as before", async () => (await need()) === before);
  await page.locator("#level").fill("1");
  await page.getByText("at 3000 spp").waitFor();
  const p = await probability();
  assert.ok(p > 0.05 && p < 0.99, `P ${p}`);
  await page.locator("#people").fill(Math.max(p - 0.02, 0.05).toFixed(2));
  await until("fewer people are content sooner", async () => (await label(page, 0)).includes(": converged"));
  await page.locator("#people").fill(Math.min(p + 0.02, 0.99).toFixed(2));
  await until("a higher one does not", async () => (await label(page, 0)).includes(": noise seen"));
  await page.locator("#people").fill("0.9");

  // Disagree, take back by clicking again, and by undoing
  await until("noise at P = 0.9", async () => (await label(page, 0)).includes(": noise seen"));
  await tile(page, 0).click();
  await page.getByText("Kept: none is seen in tile 1.").waitFor();
  assert.equal(await kept(page), 1);
  // The page adjusts to who answers, and says what that changes
  await page.getByText("1 answers: T′ =").waitFor();
  assert.equal(await page.locator("#audience").inputValue(), "you");
  await page.locator("#yours-here").getByText(/In this picture \d → \d of 6 tiles have converged/).waitFor();
  assert.match(await page.locator("#yours-share").textContent(), /^--audience 0\.\d+,-?\d/);
  await page.locator("#audience").selectOption("observers");
  await until("noise again for the observers", async () => (await label(page, 0)).includes(": noise seen"));
  await tile(page, 4).click();
  await page.getByText("in tile 5.").waitFor();
  await shot(page, "explore-disagreed");
  await accessible(page, "disagreed");
  await tile(page, 4).click();
  await page.getByText("Taken back.").waitFor();
  assert.equal(await kept(page), 1);
  await page.getByRole("button", { name: "Undo" }).click();
  await until("the answer is back", async () => (await kept(page)) === 2);
  await page.getByRole("button", { name: "Undo" }).click();
  await page.getByRole("button", { name: "Undo" }).click();
  await until("nothing is kept", async () => (await kept(page)) === 0);
  await until("nothing is left to undo", () => page.getByRole("button", { name: "Undo" }).isDisabled());

  // Layers
  await page.getByLabel("Visible noise (key N)").check();
  await until("the noise is shown", () => page.locator("#noise").isVisible());
  await accessible(page, "noise");
  await shot(page, "explore-noise");
  await page.getByLabel("Verdicts (key V)").uncheck();
  await until("verdicts are hidden", () => page.locator(".chip.top").first().isHidden());
});

test("a dozen answers turn verdicts", async (t) => {
  const { page } = await open(t, EXPLORER, SMALL, { refusals: true });
  await empty(page);
  await drop(page, stack);
  await page.getByRole("alert").getByText("do not show whether").waitFor();
  await page.locator("#samples").selectOption("independent");
  for (const [level, spp] of [50, 3000].entries()) {
    await page.locator("#level").fill(String(level));
    for (let n = 0; n < 6; n += 1) {
      await page.locator("#audience").selectOption("observers");
      await page.getByText(`0 of 6 tiles have converged at ${spp} spp`).waitFor();
      await page.evaluate((n) => {
        const button = document.querySelectorAll("#tiles button")[n];
        globalThis.turned = new Promise((turned) => {
          new MutationObserver(() => {
            if (button.getAttribute("aria-label").includes(", you: none")) turned();
          }).observe(button, { attributeFilter: ["aria-label"] });
        });
        button.click();
      }, n);
      await page.evaluate(() => globalThis.turned);
    }
  }
  await page.locator("#audience").selectOption("you");
  await page.locator("#yours-here").getByText(/In this picture 0 → [4-6] of 6/).waitFor();
  await page.getByText("12 answers: T′ =").waitFor();
  await accessible(page, "the line");
});

test("everything goes by keyboard alone, in a large window", async (t) => {
  const { page } = await open(t, EXPLORER, LARGE, { refusals: true });
  // Asked for well before the key that opens it: Chromium is told to hand choosers over only while somebody listens, and
  // a key pressed right after that overtakes it.
  const chooser = page.waitForEvent("filechooser", { timeout: 60000 });
  await empty(page);
  const focus = async (matches, by = "Tab") => {
    for (let i = 0; i < 60; i += 1) {
      const at = await page.evaluate(() =>
        [
          document.activeElement?.id,
          document.activeElement?.getAttribute("aria-label"),
          document.activeElement?.textContent,
        ].join("|"),
      );
      if (matches.test(at)) return;
      await page.keyboard.press(by);
    }
    assert.fail(`${matches} cannot be reached by Tab`);
  };
  await focus(/^files/);
  await page.keyboard.press("Enter");
  await (await chooser).setFiles(stack);
  await page.getByRole("alert").getByText("do not show whether").waitFor();
  await focus(/^samples/);
  await page.keyboard.type("independent");
  await page.getByText("tiles have converged at").waitFor();
  // A name that says nothing: the samples are typed
  // It lies before: past the end of the page, Firefox goes through its own toolbar
  await focus(/Samples per pixel of last\.png/, "Shift+Tab");
  await page.keyboard.type("51200");
  await page.keyboard.press("Tab");
  await until(
    "there is one more level",
    async () => (await page.locator("#level").getAttribute("max")) === String(stack.length - 1),
  );
  await focus(/^scene/);
  await page.keyboard.press("Control+A");
  await page.keyboard.type("hall");
  await page.keyboard.press("Tab");
  await until("the scene has a name", async () => (await state(page)).scene === "hall");
  await focus(/^level/);
  await page.keyboard.press("End");
  await page.getByText("at 51200 spp").waitFor();
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  await page.getByText("at 3000 spp").waitFor();
  await focus(/^show-noise/);
  await page.keyboard.press("Space");
  await until("the noise is shown", () => page.locator("#noise").isVisible());
  await page.keyboard.press("n");
  await until("the noise is hidden", () => page.locator("#noise").isHidden());
  await focus(/\|Tile 1,/);
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowDown");
  await page.keyboard.press("ArrowDown");
  assert.match(
    await page.evaluate(() => document.activeElement.getAttribute("aria-label")),
    /^Tile 5, row 2, column 2/,
  );
  await page.keyboard.press("Enter");
  await page.getByText("in tile 5.").waitFor();
  assert.equal(await kept(page), 1);
  // The focus stays where it is while the verdicts are drawn again
  const focused = () => page.evaluate(() => document.activeElement.getAttribute("aria-label"));
  await until("the answer is in the label", async () => /^Tile 5.*, you: none/.test(await focused()));
  await page.keyboard.press("Home");
  await page.keyboard.press("Enter");
  await page.getByText("in tile 4.").waitFor();
  await page.keyboard.press("Backspace");
  await until("one is undone", async () => (await kept(page)) === 1);
  await shot(page, "explore-large");

  // Retrain, with progress, scores before and after, and the new model in use
  // A line is learned sooner than anybody sees: until it is looked at, the page is told that it is at a step
  const running = { state: "running", done: 1, of: 3, doing: "one scene left out" };
  let held = true;
  await page.route("**/api/retrain", (route) =>
    held && route.request().method() === "GET" ? route.fulfill({ json: running }) : route.continue(),
  );
  await focus(/^retrain/, "Shift+Tab");
  await page.keyboard.press("Enter");
  await page.locator("#progress").waitFor();
  await page.getByText("2 of 3: one scene left out").waitFor();
  await shot(page, "explore-working");
  held = false;
  await page.getByText("People of the table").waitFor({ timeout: 120000 });
  await accessible(page, "learned");
  const outcome = await page.locator("#outcome").innerText();
  assert.match(outcome, /error factor\s+×\d\.\d{3}\s+×\d\.\d{3}/);
  assert.match(outcome, /after, having learned them\s+[01] \/ 1/);
  assert.match(outcome, /predicted (worse now|no worse)/);
  const asked = await label(page, 4);
  await focus(/^use/);
  await page.keyboard.press("Space");
  await page.locator("#model", { hasText: "Retrained model" }).waitFor();
  await until("the new model says something else", async () => (await label(page, 4)) !== asked);
  await page.locator("#outcome").scrollIntoViewIfNeeded();
  await shot(page, "explore-learned");
  await focus(/Save the model/);
  const model = await saved(page, () => page.keyboard.press("Enter"), () => Buffer.from("NFMODEL"));
  assert.equal(model.subarray(0, 7).toString(), "NFMODEL");

  // What was said is there when the page comes back, and the last outcome too
  await page.reload();
  await page.getByText("1 kept in explore.sqlite").waitFor();
  await page.getByText("People of the table").waitFor();
});

test("pictures are enlarged, brightened and set beside one another, by keyboard", async (t) => {
  // Without a word about their samples, the pictures are refused at first
  const { page } = await open(t, EXPLORER, LARGE, { refusals: true });
  await empty(page);
  await drop(page, stack);
  await page.getByText("do not show whether").waitFor();
  await page.locator("#samples").selectOption("independent");
  await page.getByText("tiles have converged at").waitFor();

  // A select would take the letters
  await page.locator("#stage").focus();
  // Small pictures are enlarged by whole factors; tiles go with them
  const width = (id) => page.locator(id).evaluate((element) => element.getBoundingClientRect().width);
  const own = await page.locator("#picture").evaluate((canvas) => canvas.width);
  const zoom = async () => Number(/×(\d)/.exec(await page.locator("#zoom-now").textContent())[1]);
  await until("it is enlarged", async () => (await zoom()) > 1);
  assert.equal(await width("#picture"), own * (await zoom()));
  await page.getByText("Enlarged ×").waitFor();
  await page.keyboard.press("1");
  await until("pixel by pixel", async () => (await width("#picture")) === own);
  const tile_width = await tile(page, 0).evaluate((button) => button.getBoundingClientRect().width);
  await page.keyboard.press("+");
  await until("twice as large", async () => (await width("#picture")) === 2 * own);
  assert.equal(await tile(page, 0).evaluate((button) => button.getBoundingClientRect().width), 2 * tile_width);

  // Exposure is that of linear light: a stop doubles what is not white
  const mean = (id) =>
    page.locator(id).evaluate((canvas) => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      const sums = [0, 0, 0];
      data.forEach((value, at) => (at % 4 < 3 ? (sums[at % 4] += value) : null));
      return sums.map((sum) => (4 * sum) / data.length);
    });
  const before = await mean("#picture");
  await page.keyboard.press("Shift+E");
  await page.keyboard.press("Shift+E");
  await page.getByText("-1 stops").waitFor();
  await until("it is darker", async () => (await mean("#picture"))[1] < before[1] - 5);
  await page.keyboard.press("o");
  await until("it is as before", async () => (await mean("#picture"))[1] === before[1]);

  // One channel of three
  await page.keyboard.press("g");
  await until("it is grey", async () => new Set(await mean("#picture")).size === 1);
  assert.equal((await mean("#picture"))[0], before[1]);
  await page.keyboard.press("c");
  await until("it has colours again", async () => (await mean("#picture"))[0] === before[0]);

  // The other picture: flipped, then split where the pointer is
  await page.keyboard.press("x");
  await page.locator("#beside").waitFor();
  const name = page.locator("#name");
  const other_name = await name.textContent();
  await page.keyboard.press("x");
  await until("the first again", () => page.locator("#beside").isHidden());
  assert.notEqual(await name.textContent(), other_name);
  await page.keyboard.press("s");
  await page.locator("#split").waitFor({ state: "attached" });
  const box = await page.locator("#frame").boundingBox();
  await page.mouse.move(box.x + box.width / 4, box.y + 10);
  await until("the line follows", async () =>
    /inset\(0px 0px 0px 2[45]/.test(await page.locator("#beside").evaluate((e) => getComputedStyle(e).clipPath)),
  );
  await shot(page, "explore-split");
  await page.keyboard.press("s");

  // One map at a time: of visible noise, or of JODs lost, which are fewer with more samples
  await page.keyboard.press("n");
  await until("the noise is shown", () => page.locator("#noise").isVisible());
  await page.keyboard.press("j");
  await until("the JODs are shown", () => page.locator("#lost").isVisible());
  assert.ok(await page.locator("#noise").isHidden());
  await page.getByText("0.1 JOD").waitFor();
  const first = await mean("#lost");
  await shot(page, "explore-lost");
  await accessible(page, "JODs lost");
  await page.locator("#level").fill("1");
  await until("the other picture has lost less", async () =>
    (await page.locator("#lost").isVisible()) && (await mean("#lost"))[0] < first[0] - 5,
  );
  await page.locator("#level").fill("0");
  await until("the first is drawn again", async () => (await mean("#lost"))[0] === first[0]);
  await page.locator("#stage").focus();
  await page.keyboard.press("j");
  await until("no map is shown", () => page.locator("#lost").isHidden());

  // Samples per pixel over the tiles
  await page.keyboard.press("m");
  assert.match(await tile(page, 0).textContent(), /spp/);
  await shot(page, "explore-needs");
  await accessible(page, "viewer");
});
