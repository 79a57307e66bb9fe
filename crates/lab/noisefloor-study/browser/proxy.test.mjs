// Participants behind nginx and Caddy, which the Rust test `proxy` starts: TLS, and a path before that of the study.

import { describe, test } from "node:test";
import assert from "node:assert/strict";
import { LARGE, SIDE_BY_SIDE, SMALL, accessible, arrive, heading, look, open, settled } from "./kit.mjs";

const { PROXIES, UNTRUSTED } = process.env;
const options = { ignoreHTTPSErrors: true };

describe("behind a proxy", SIDE_BY_SIDE, () => {
  for (const [name, url] of Object.entries(JSON.parse(PROXIES))) {
    for (const path of ["/noise/", "/stripped/"]) {
      test(`a session through ${name} under ${path}`, async (t) => {
        const { page } = await open(t, `${url}${path}`, SMALL, options);
        await arrive(page);
        for (let trial = 0; trial < 5; trial += 1) {
          await page.getByText("Are these two pictures identical?").waitFor();
          await look(page);
          const { trial: shown } = await settled(page);
          const same = JSON.stringify(shown.left) === JSON.stringify(shown.right);
          await page.keyboard.press(same ? "1" : "2");
          await page.waitForFunction((n) => (document.querySelector("progress")?.value ?? 99) > n, trial);
        }
        await heading(page, "Thank you");
      });
    }

    test(`a path of ${name} without its last slash leads to the page`, async (t) => {
      const { page } = await open(t, `${url}/noise`, SMALL, options);
      await page.getByRole("button", { name: "Begin" }).waitFor();
      assert.equal(new URL(page.url()).pathname, "/noise/");
    });
  }

  test("a server that was not told to trust the proxy refuses, and the page says what to do", async (t) => {
    const { page } = await open(t, `${UNTRUSTED}/noise/`, LARGE, { ...options, refusals: true });
    await page.getByRole("button", { name: "Begin" }).click();
    await page.getByText("--trust-proxy").waitFor();
    await accessible(page, "refused");
  });
});
