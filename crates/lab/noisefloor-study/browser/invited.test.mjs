// People who come by links, and the experimenter, at a server that the Rust test `browser` starts.

import { describe, test } from "node:test";
import assert from "node:assert/strict";
import {
  LARGE,
  SIDE_BY_SIDE,
  SMALL,
  accessible,
  heading,
  look,
  measure,
  open,
  press,
  reach,
  retype,
  settled,
  shot,
  test_picture,
} from "./kit.mjs";

const { ARABIC, INVITED, STRICT } = process.env;

describe("people who were invited", SIDE_BY_SIDE, () => {
  test("by a personal link, questions, a break, and a completion code at the end alone", async (t) => {
    const { url, link, experimenter } = JSON.parse(INVITED);
    const alone = await open(t, url, LARGE);
    await alone.page.getByText("open to invited participants").waitFor();
    assert.equal(await alone.page.getByRole("button", { name: "Begin" }).count(), 0);

    const { page } = await open(t, `${url}/?link=${link}&PROLIFIC_PID=5f00&other=1`, LARGE);
    await page.getByText("about 7 minutes").waitFor();
    await page.getByRole("button", { name: "Begin" }).click();
    await heading(page, "Before you begin");
    assert.equal(new URL(page.url()).search, "", "the link is not left in the address");
    assert.equal(await page.getByText("COMPLETE-77").count(), 0);
    await page.getByLabel("I have read this").check();
    await page.getByRole("button", { name: "Go on" }).click();
    await heading(page, "A few questions");
    await accessible(page, "questions");
    await shot(page, "large-questions");
    await page.getByLabel("Your age").fill("17");
    await page.getByRole("button", { name: "Go on" }).click();
    await heading(page, "A few questions");
    await retype(page, "#question-age", "41");
    await page.getByLabel("Do you wear glasses").selectOption("yes");
    await page.getByRole("button", { name: "Go on" }).click();
    await measure(page);
    // Practice: the obvious pair, and the identical one, which the server tells apart by its levels
    let breaks = 0;
    for (let trial = 0; trial < 5; trial += 1) {
      const { trial: shown, break_due: due } = await settled(page);
      if (due) {
        await heading(page, "Time for a short break");
        await accessible(page, "break");
        await shot(page, "large-break");
        breaks += 1;
        await press(page, "Go on");
      }
      await page.getByText("Are these two pictures identical?").waitFor();
      await look(page);
      assert.ok(
        await page.evaluate(() => document.activeElement?.tagName !== "BUTTON"),
        "no answer has the focus",
      );
      const same = JSON.stringify(shown.left) === JSON.stringify(shown.right);
      await page.keyboard.press(same ? "1" : "2");
      await page.waitForFunction((n) => (document.querySelector("progress")?.value ?? 99) > n, trial);
    }
    assert.equal(breaks, 1);
    await heading(page, "Thank you");
    await page.getByText("COMPLETE-77").waitFor();
    await page.getByText("This was about noise.").waitFor();
    assert.equal(
      await page.getByRole("link", { name: "Finish and return" }).getAttribute("href"),
      "https://example.org/done",
    );
    await accessible(page, "completion");
    await shot(page, "large-completion");

    // The same link, somewhere else: the same session, and no second one
    const again = await open(t, `${url}/?link=${link}`, LARGE);
    await again.page.getByRole("button", { name: "Begin" }).click();
    await heading(again.page, "Thank you");

    // The experimenter sees it
    const watching = await open(t, `${url}${experimenter}`, LARGE, { refusals: true });
    await watching.page.getByText("1 session ·").waitFor();
    await watching.page.getByText("PROLIFIC_PID 5f00").waitFor();
    await watching.page.getByText("finished", { exact: true }).waitFor();
    assert.equal(new URL(watching.page.url()).hash, "", "the key is not left in the address");
    await accessible(watching.page, "experimenter");
    await shot(watching.page, "large-experimenter");
    await watching.page.reload();
    await watching.page.getByText("1 session ·").waitFor();
    await reach(watching.page, "scroll");
    const stranger = await open(t, `${url}/experimenter.html#WRONG`, LARGE, { refusals: true });
    await stranger.page.getByText("this page is for the experimenter").waitFor();
  });

  test("who fails the practice is sent back, and can erase everything, by keyboard alone", async (t) => {
    const { page } = await open(t, STRICT, SMALL);
    await page.getByRole("button", { name: "Begin" }).waitFor();
    await press(page, "Begin");
    await heading(page, "Before you begin");
    await press(page, "agree", "Space");
    await press(page, "Go on");
    await heading(page, "A few questions");
    await reach(page, "question-age");
    await page.keyboard.type("41");
    await press(page, "question-glasses", "ArrowDown");
    await press(page, "Go on");
    await heading(page, "How you see the pictures");
    await press(page, "card-width", "End");
    await page.locator("#card-width").fill("324");
    await reach(page, "distance");
    await page.keyboard.type("60");
    await press(page, "gamma", "PageDown");
    await page.locator("#gamma").fill("186");
    await page.keyboard.press("Tab");
    await page.keyboard.press("ArrowDown");
    await press(page, "Go on");
    for (let trial = 0; trial < 2; trial += 1) {
      await heading(page, `Practice ${trial + 1} of 2`);
      await look(page);
      if (trial === 0) {
        await page.keyboard.press("p");
        await heading(page, "Paused");
        await press(page, "Go on where you stopped");
        await heading(page, "Practice 1 of 2");
        await look(page);
      }
      const { trial: shown } = await settled(page);
      const same = JSON.stringify(shown.left) === JSON.stringify(shown.right);
      await page.keyboard.press(same ? "2" : "1");
    }
    await heading(page, "Thank you for trying");
    await accessible(page, "screened out");
    await shot(page, "small-screened-out");
    const back = page.getByRole("link", { name: "Finish and return" });
    assert.equal(await back.getAttribute("href"), "https://example.org/screened-out");
    await reach(page, "Finish and return");
    await press(page, "Erase my answers");
    await page.keyboard.press("Enter");
    await heading(page, "Erased");
    await accessible(page, "erased");
  });

  test("in a language written from right to left, pictures are not mirrored", async (t) => {
    const { page } = await open(t, ARABIC, SMALL, { locale: "ar-EG" });
    const begin = page.getByRole("button", { name: "ابدأ" });
    await begin.waitFor();
    const html = await page.evaluate(() => [document.documentElement.lang, document.documentElement.dir]);
    assert.deepEqual(html, ["ar", "rtl"]);
    await accessible(page, "welcome, right to left");
    await shot(page, "rtl-welcome");
    await begin.click();
    await page.getByLabel("قرأت هذا وأشارك.").check();
    await shot(page, "rtl-consent");
    await page.getByRole("button", { name: "متابعة" }).click();
    await page.locator("#card-width").fill("324");
    await page.locator("#distance").fill("60");
    await page.locator("#gamma").fill("186");
    await page.locator("[name=ambient][value=dim]").check();
    await accessible(page, "conditions, right to left");
    await shot(page, "rtl-conditions");
    await page.getByRole("button", { name: "متابعة" }).click();
    await heading(page, "تدريب 1 من 2");
    await look(page);
    await accessible(page, "trial, right to left");
    // The reference is at the left, and the first tile at the top left, as in every language
    const place = async (n) => (await page.locator("canvas.picture").nth(n).boundingBox()).x;
    assert.ok((await place(0)) < (await place(1)));
    await test_picture(page).click({ position: { x: 5, y: 5 } });
    assert.deepEqual((await settled(page)).trial.levels, [1, 0, 0, 0, 0, 0]);
    for (const key of ["ArrowLeft", "ArrowLeft", "ArrowUp", "Enter"]) await page.keyboard.press(key);
    await shot(page, "rtl-trial");
    assert.deepEqual((await settled(page)).trial.levels, [1, 1, 0, 0, 0, 0]);
  });
});
