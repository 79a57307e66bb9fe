// The example as Vite builds it, on WebGL 2 and on WebGPU, the package without a bundler, and its tone curves against
// three.js' own shader: in Chromium, whose SwiftShader needs no GPU.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { after, before, test } from "node:test";
import { extname, join } from "node:path";
import { chromium } from "playwright-core";

const here = import.meta.dirname;
const FOLDERS = {
  example: join(here, "dist"),
  package: join(here, "node_modules/noisefloor"),
  three: join(here, "node_modules/three/build"),
};
const TYPES = {
  ".css": "text/css",
  ".gltf": "model/gltf+json",
  ".html": "text/html",
  ".js": "text/javascript",
  ".wasm": "application/wasm",
};
const PATIENCE = 300000;

/** Pages of no file. */
const PAGES = {
  "/plain": "<!doctype html><title>plain</title><link rel=icon href=data:,>",
  "/worker.js": `import { Session, viewing } from "/package/noisefloor.js";
    onmessage = async () => {
      const session = await Session.open(64, 48, { tile: 32, viewing: viewing({ pixelRatio: 2 }) });
      session.pushRunning(new Float32Array(4 * 64 * 48).fill(0.5), { spp: 10, fromBottom: true });
      postMessage({ image: session.image().length, spp: session.states().map(({ spp }) => spp) });
      session.close();
    };`,
};

let browser, server, address;

before(async () => {
  const build = spawnSync("npx", ["vite", "build", "--logLevel", "warn"], { cwd: here, encoding: "utf8" });
  assert.equal(build.status, 0, build.stdout + build.stderr);
  server = createServer(async ({ url }, response) => {
    const path = new URL(url, "http://localhost").pathname;
    const [, folder, ...file] = path.split("/");
    try {
      const body = PAGES[path] ?? (await readFile(join(FOLDERS[folder], ...file)));
      response.setHeader("content-type", TYPES[extname(path) || ".html"] ?? "application/octet-stream");
      response.end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  address = `http://127.0.0.1:${server.address().port}`;
  browser = await launch();
});

function launch(...more) {
  return chromium.launch({
    executablePath: "/usr/bin/chromium",
    args: [
      "--headless",
      "--no-sandbox",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--ignore-gpu-blocklist",
      ...more,
    ],
  });
}
after(async () => {
  await browser?.close();
  server?.close();
});

/** A page on which nothing may go wrong. */
async function open(t, path, in_ = browser) {
  const page = await in_.newPage();
  const wrong = [];
  page.on("pageerror", (error) => wrong.push(String(error)));
  page.on("console", (message) => message.type() === "error" && wrong.push(message.text()));
  page.setDefaultTimeout(PATIENCE);
  t.after(async () => {
    await page.close();
    assert.deepEqual(wrong, []);
  });
  await page.goto(address + path);
  return page;
}

test("a model is rendered until nobody sees noise", async (t) => {
  // Seen from two metres noise disappears soon
  const [size, tile] = [128, 64];
  const page = await open(t, `/example/index.html?size=${size}&tile=${tile}&distance=2`);
  const status = () => page.evaluate(() => window.noisefloor);
  await page.waitForFunction(() => window.noisefloor?.error || window.noisefloor?.isDone);
  const { states, warnings, error } = await status();
  assert.equal(error, undefined);
  console.log(
    `tiles stopped after ${states.map(({ spp }) => spp)} samples per pixel`,
    `(${states.map(({ reason }) => reason)}); warnings: ${warnings.join("; ") || "none"}`,
  );
  assert.equal(states.length, (size / tile) ** 2);
  assert.ok(states.every(({ reason, spp }) => reason === "converged" && spp >= 50));
  assert.ok(states.every(({ probability }) => probability > 0.5));
  // It stops rendering, too
  const finished = page.locator("#status", { hasText: "4 of 4 tiles done · finished" });
  const text = await finished.textContent();
  await page.waitForTimeout(1000);
  assert.equal(await page.locator("#status").textContent(), text);
  if (process.env.NOISEFLOOR_SCREENSHOTS) {
    await page.screenshot({ path: join(process.env.NOISEFLOOR_SCREENSHOTS, "three-gpu-pathtracer.png") });
  }
});

/** What a page is done with: states, and the mean of each of 8x8 blocks. */
async function rendered(page) {
  await page.waitForFunction(() => window.noisefloor?.error || window.noisefloor?.isDone);
  return page.evaluate(async () => {
    const { session, states, warnings, error, device } = window.noisefloor;
    const blocks = Array(64).fill(0);
    const { width, height } = session;
    (await session.image()).forEach((value, i) => {
      const [x, y] = [Math.floor(i / 3) % width, Math.floor(i / 3 / width)];
      blocks[8 * Math.floor((8 * y) / height) + Math.floor((8 * x) / width)] += (value * 64) / (3 * width * height);
    });
    return { states, warnings, error, device, blocks };
  });
}

test("on WebGPU, the same picture stops as well", async (t) => {
  // SwiftShader for Vulkan, too: a device of any other kind cannot show its picture here, and is lost
  const withGpu = await launch("--enable-unsafe-webgpu", "--enable-features=Vulkan", "--use-vulkan=swiftshader");
  t.after(() => withGpu.close());
  const page = await open(t, "/plain", withGpu);
  if (!(await page.evaluate(async () => Boolean(await navigator.gpu?.requestAdapter())))) {
    return t.skip("this Chromium has no WebGPU device");
  }
  const query = "/example/index.html?size=40&tile=40&distance=2"; // rows of 640 bytes, of which 768 are read
  const [gpu, gl] = [await open(t, query, withGpu), await open(t, `${query}&webgl`)];
  const [there, here] = [await rendered(gpu), await rendered(gl)];
  for (const { states, warnings, error, device } of [there, here]) {
    console.log(`${device}: ${states.map(({ spp, reason }) => `${reason} at ${spp}`)}; ${error ?? warnings.join()}`);
    assert.equal(error, undefined);
    assert.deepEqual(warnings, []);
    assert.ok(states.every(({ reason, spp }) => reason === "converged" && spp >= 50));
  }
  assert.deepEqual([there.device, here.device], ["WebGPU", "WebGL"]);
  // The two path tracers differ by some percent: not by rows from the other end, or read beside their place
  const apart = (blocks) => Math.max(...blocks.map((value, i) => Math.abs(value / here.blocks[i] - 1)));
  const flipped = there.blocks.map((_, i) => there.blocks[8 * (7 - (i >> 3)) + (i & 7)]);
  console.log(`blocks differ by ${apart(there.blocks)}, flipped by ${apart(flipped)}`);
  assert.ok(apart(there.blocks) < 0.3 && apart(flipped) > 0.6);
});

test("running means in half floats are noticed before a tile stops", async (t) => {
  const page = await open(t, "/example/index.html?size=64&tile=64&distance=2&half");
  // In floats, tiles stop at 104 to 112
  await page.waitForFunction(() => {
    const { error, states } = window.noisefloor ?? {};
    return error || states?.every(({ spp, reason }) => spp >= 150 || reason !== "open");
  });
  const { states, warnings, error } = await page.evaluate(() => window.noisefloor);
  console.log(`after ${states.map(({ spp }) => spp)} samples: ${error ?? warnings.join("; ")}`);
  assert.match(warnings.join(), /half floats/);
  assert.ok(states.every(({ reason }) => reason === "open"));
});

test("no bundler is needed, in a page and in a worker", async (t) => {
  const page = await open(t, "/plain");
  const inPage = await page.evaluate(async () => {
    const { Session } = await import("/package/noisefloor.js");
    const session = await Session.open(64, 48, { tile: 32 });
    session.push(new Float32Array(3 * 64 * 48), { spp: 10 });
    const { spp } = session.states()[3];
    session.close();
    return spp;
  });
  assert.equal(inPage, 10);
  const inWorker = await page.evaluate(async () => {
    const worker = new Worker("/worker.js", { type: "module" });
    return new Promise((resolve, reject) => {
      worker.onmessage = ({ data }) => resolve(data);
      worker.onerror = (event) => reject(new Error(event.message));
      worker.postMessage("begin");
    });
  });
  assert.deepEqual(inWorker, { image: 3 * 64 * 48, spp: [10, 10, 10, 10] });
});

test("tone curves are those of three.js' shader", async (t) => {
  const page = await open(t, "/plain");
  const largest = await page.evaluate(async () => {
    const three = await import("/three/three.module.js");
    const { curves, toneMappingOf } = await import("/package/noisefloor.js");
    const size = 64;
    const colours = new Float32Array(4 * size * size);
    let state = 1;
    const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
    for (let i = 0; i < size * size; i++) {
      const level = 2 ** (20 * random() - 12);
      for (let c = 0; c < 3; c++) colours[4 * i + c] = level * random() ** 2;
    }
    const map = new three.DataTexture(colours, size, size, three.RGBAFormat, three.FloatType);
    map.needsUpdate = true;
    const renderer = new three.WebGLRenderer();
    renderer.toneMappingExposure = 1.5;
    const target = new three.WebGLRenderTarget(size, size, { type: three.FloatType });
    const [scene, camera] = [new three.Scene(), new three.OrthographicCamera()];
    const found = {};
    for (const name of ["Linear", "Reinhard", "Cineon", "ACESFilmic", "AgX", "Neutral"]) {
      const material = new three.ShaderMaterial({
        uniforms: { map: { value: map }, toneMappingExposure: { value: 1.5 } },
        vertexShader: "void main() { gl_Position = vec4(2.0 * position.xy, 0.0, 1.0); }",
        fragmentShader: `uniform sampler2D map;
          ${three.ShaderChunk.tonemapping_pars_fragment}
          void main() {
            vec3 colour = texelFetch(map, ivec2(gl_FragCoord.xy), 0).rgb;
            gl_FragColor = vec4(${name}ToneMapping(colour), 1.0);
          }`,
        toneMapped: false,
      });
      scene.clear();
      scene.add(new three.Mesh(new three.PlaneGeometry(), material));
      renderer.setRenderTarget(target);
      renderer.render(scene, camera);
      const shown = new Float32Array(4 * size * size);
      renderer.readRenderTargetPixels(target, 0, 0, size, size, shown);

      renderer.toneMapping = three[`${name}ToneMapping`];
      const { curve, exposure } = toneMappingOf(renderer);
      const ours = curve === "linear" ? (colour) => colour : curves[curve];
      const clamp = (x) => Math.min(Math.max(x, 0), 1);
      let worst = 0;
      for (let i = 0; i < size * size; i++) {
        const colour = [0, 1, 2].map((c) => exposure * colours[4 * i + c]);
        ours(colour).forEach(
          (x, c) => (worst = Math.max(worst, Math.abs(clamp(x) - clamp(shown[4 * i + c])))),
        );
      }
      found[name] = worst;
    }
    return found;
  });
  console.log(largest);
  assert.equal(Object.keys(largest).length, 6);
  // Shaders compute in single precision, and powers less exactly
  for (const [name, difference] of Object.entries(largest))
    assert.ok(difference < 2e-4, `${name}: ${difference}`);
});
