// People who come by links, and the experimenter, at a server that the Rust test `browser` starts.

import { test } from "node:test";
import assert from "node:assert/strict";
import { LARGE, accessible, heading, look, measure, open, settled, shot } from "./kit.mjs";

const { INVITED } = process.env;

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
  await page.getByLabel("Your age").fill("41");
  await page.getByLabel("Do you wear glasses").selectOption("yes");
  await page.getByRole("button", { name: "Go on" }).click();
  await measure(page);
  // Practice: the obvious pair, and the identical one, which the server tells apart by its levels
  let breaks = 0;
  for (let trial = 0; trial < 5; trial += 1) {
    const { trial: shown, break_due: due } = await settled(page);
    if (due) {
      await heading(page, "Time for a short break");
      await shot(page, "large-break");
      breaks += 1;
      await page.getByRole("button", { name: "Go on" }).click();
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
  await watching.page.getByText("1 sessions").waitFor();
  await watching.page.getByText("PROLIFIC_PID 5f00").waitFor();
  await watching.page.getByText("finished", { exact: true }).waitFor();
  assert.equal(new URL(watching.page.url()).hash, "", "the key is not left in the address");
  await accessible(watching.page, "experimenter");
  await shot(watching.page, "large-experimenter");
  const stranger = await open(t, `${url}/experimenter.html#WRONG`, LARGE, { refusals: true });
  await stranger.page.getByText("this page is for the experimenter").waitFor();
});
