// A participant behind nginx, which the Rust test `proxy` starts: TLS, and a path before that of the study.

import { test } from "node:test";
import assert from "node:assert/strict";
import { LARGE, arrive, heading, look, open, settled } from "./kit.mjs";

const { PROXY } = process.env;

for (const path of ["/noise/", "/stripped/"]) {
  test(`a session through ${path}`, async (t) => {
    const { page } = await open(t, `${PROXY}${path}`, LARGE, { ignoreHTTPSErrors: true });
    await arrive(page);
    for (let trial = 0; trial < 5; trial += 1) {
      await page.getByText("Are these two pictures identical?").waitFor();
      await look(page);
      const { trial: shown } = await settled(page);
      await page.keyboard.press(JSON.stringify(shown.left) === JSON.stringify(shown.right) ? "1" : "2");
      await page.waitForFunction((n) => (document.querySelector("progress")?.value ?? 99) > n, trial);
    }
    await heading(page, "Thank you");
  });
}

test("a path without its last slash leads to the page", async (t) => {
  const { page } = await open(t, `${PROXY}/noise`, LARGE, { ignoreHTTPSErrors: true });
  await page.getByRole("button", { name: "Begin" }).waitFor();
  assert.equal(new URL(page.url()).pathname, "/noise/");
});
