// A page that renders a glTF model with three-gpu-pathtracer, on WebGPU or WebGL 2, and stops when nobody sees noise.
// What noisefloor costs stands between the two lines; the rest is what such a page has anyway, and the map of
// tiles.

import { ACESFilmicToneMapping, Color, PerspectiveCamera, Scene } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { GradientEquirectTexture } from "three-gpu-pathtracer";
import { toneMappingOf, viewing } from "noisefloor";
import { BackgroundSession } from "noisefloor/background";
import { drawTiles } from "./tiles.js";

const query = new URLSearchParams(location.search);
const size = Number(query.get("size") ?? 512);
const tile = Number(query.get("tile") ?? 64);
const status = document.querySelector("#status");

const device = !query.has("webgl") && (await navigator.gpu?.requestAdapter());
const { open } = await (device ? import("./webgpu.js") : import("./webgl.js"));
const tracer = await open(query);
const { renderer } = tracer;
renderer.setPixelRatio(devicePixelRatio);
renderer.setSize(size, size);
renderer.toneMapping = ACESFilmicToneMapping;
document.querySelector("#picture").prepend(renderer.domElement);

const { scene: model, cameras } = await new GLTFLoader().loadAsync(
  new URL("./model.gltf", import.meta.url).href,
);
const scene = new Scene().add(model);
const sky = new GradientEquirectTexture(16);
sky.topColor.set(0xdde6f0);
sky.bottomColor.set(0xb5afa6);
sky.update();
scene.environment = sky;
scene.background = new Color(0xc8d0da);
const camera = cameras[0] ?? new PerspectiveCamera();
camera.aspect = 1;
camera.updateProjectionMatrix();
tracer.setScene(scene, camera);
const { width, height } = renderer.domElement;

// ---- noisefloor
const seen = viewing({ canvas: renderer.domElement, distance: Number(query.get("distance") ?? 0.6) });
const options = { toneMapping: toneMappingOf(renderer), viewing: seen, tile };
const session = await BackgroundSession.open(width, height, options);
let handed = 0; // samples per pixel that the session has
async function render() {
  if (tracer.samples >= session.nextSpp && !session.pending) {
    const [pixels, batch] = await tracer.read(session);
    await session.pushRunning(pixels, batch);
    handed = batch.spp;
  }
  if (tracer.samples - handed < session.sppLeft) tracer.renderSample(); // or only a verdict is to come
}
// ----

async function frame() {
  const error = await render().then(
    () => undefined,
    ({ message }) => message,
  );
  const { states, warnings, isDone } = session;
  drawTiles(document.querySelector("#tiles"), width, height, states);
  const done = states.filter(({ reason }) => reason !== "open").length;
  const progress = `${Math.round(tracer.samples)} samples per pixel, ${done} of ${states.length} tiles done`;
  status.textContent = [error ?? progress, ...warnings].join(" · ") + (isDone ? " · finished" : "");
  window.noisefloor = { session, states, warnings, isDone, error, device: device ? "WebGPU" : "WebGL" }; // for the test
  if (!isDone && !error) requestAnimationFrame(frame);
}
const checkbox = document.querySelector("#show");
checkbox.onchange = () => document.querySelector("#tiles").classList.toggle("hidden", !checkbox.checked);
frame();
