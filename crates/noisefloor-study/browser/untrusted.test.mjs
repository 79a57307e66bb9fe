// Behind a proxy that the server was not told to trust.

import { test } from "node:test";
import { LARGE, open } from "./kit.mjs";

test("a session is refused, and the page says what to do", async (t) => {
  const { page } = await open(t, `${process.env.PROXY}/noise/`, LARGE, {
    ignoreHTTPSErrors: true,
    refusals: true,
  });
  await page.getByRole("button", { name: "Begin" }).click();
  await page.getByText("--trust-proxy").waitFor();
});
