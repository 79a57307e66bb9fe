// The package in a page, in Chromium: by Vite's server for development, as Vite builds it, and without a bundler. Run by
// release/npm.sh in a folder of Vite's template that has the package; it writes src/main.ts there.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { once } from "node:events";

const { chromium } = createRequire(`${process.cwd()}/`)("playwright-core");
const body = `
const pixels = (seed) => Float32Array.from({ length: 3072 }, (_, i) => 0.5 + 1e-3 * Math.sin(seed * 97 + i * i));
const session = await BackgroundSession.open(32, 32, { tile: 32, toneMapping: { curve: "linear" }, minSpp: 20 });
for (let n = 0; !session.isDone && n < 20; n++) await session.push(pixels(n), { spp: 16 });
await session.finish();
document.title = session.states[0].reason;
`;
const caught = (code) => `try {${code}} catch (error) { document.title = String(error); }`;
writeFileSync("src/main.ts", `import { BackgroundSession } from "noisefloor/background";\n${caught(body)}`);
writeFileSync("public/plain.html", `<!doctype html><title></title><script type="module">
const { BackgroundSession } = await import("/node_modules/noisefloor/background.js");${caught(body)}</script>`);
writeFileSync("public/lacking.html", `<!doctype html><title></title><script type="module">
const { BackgroundSession } = await import("/node_modules/noisefloor/background.js");
${caught(`const worker = new Worker("/absent.js", { type: "module" }); await BackgroundSession.open(32, 32, { worker });`)}</script>`);
writeFileSync("public/elsewhere.html", `<!doctype html><title></title><script type="module">
const { load } = await import("/node_modules/noisefloor/noisefloor.js");${caught(`await load("/index.html");`)}</script>`);
// What the README says
writeFileSync("vite.config.js", `export default { optimizeDeps: { exclude: ["noisefloor"] } };\n`);

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });

async function titled(url) {
  const page = await browser.newPage();
  await page.goto(url);
  await page.waitForFunction(() => document.title && document.title !== "app", null, { timeout: 300000 });
  const title = await page.title();
  await page.close();
  return title;
}

async function served(command, paths) {
  const server = spawn("npx", command, { detached: true, stdio: ["ignore", "pipe", "inherit"] });
  try {
    let said = "";
    while (!/http:\S+\//.test(said)) said += (await once(server.stdout, "data"))[0].toString().replace(/\x1b\[\d+m/g, "");
    const [address] = said.match(/http:\S+\//);
    const titles = [];
    for (const path of paths) titles.push(await titled(address + path));
    return titles;
  } finally {
    process.kill(-server.pid);
  }
}

const html = `<!doctype html><title>app</title><script type="module" src="/src/main.ts"></script>`;
writeFileSync("index.html", html);
try {
  const [dev, plain, lacking, elsewhere] = await served(
    ["vite", "--port", "0"],
    ["", "plain.html", "lacking.html", "elsewhere.html"],
  );
  assert.equal(dev, "converged");
  assert.equal(plain, "converged");
  assert.match(lacking, /worker\.js of noisefloor.*cannot be loaded.*background\.js/);
  assert.match(elsewhere, /index\.html is not the module of noisefloor: text\/html/);
  const build = spawnSync("npx", ["vite", "build", "--logLevel", "warn"], { encoding: "utf8" });
  assert.equal(build.status, 0, build.stdout + build.stderr);
  assert.deepEqual(await served(["vite", "preview", "--port", "0"], [""]), ["converged"]);
} finally {
  await browser.close();
}
