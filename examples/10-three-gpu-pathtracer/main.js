// A page that renders a glTF model with three-gpu-pathtracer, and stops when nobody sees noise. What
// noisefloor costs stands between the two lines; the rest is what such a page has anyway, and the map of
// tiles.

import { ACESFilmicToneMapping, Color, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { GradientEquirectTexture, WebGLPathTracer } from "three-gpu-pathtracer";
import { toneMappingOf, viewing } from "noisefloor";
import { drawTiles } from "./tiles.js";

const query = new URLSearchParams(location.search);
const size = Number(query.get("size") ?? 512);
const tile = Number(query.get("tile") ?? 64);
const status = document.querySelector("#status");

const renderer = new WebGLRenderer({ antialias: false });
renderer.setPixelRatio(devicePixelRatio);
renderer.setSize(size, size);
renderer.toneMapping = ACESFilmicToneMapping;
document.querySelector("#picture").prepend(renderer.domElement);

const pathTracer = new WebGLPathTracer(renderer);
pathTracer.tiles.set(1, 1); // every pixel has as many samples when it is read
pathTracer.bounces = 3;
pathTracer.multipleImportanceSampling = false; // a sky without a sun needs none
pathTracer.renderDelay = 0;
pathTracer.fadeDuration = 0;
pathTracer.minSamples = 1;

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
pathTracer.setScene(scene, camera);
const { width, height } = renderer.domElement;

// ---- noisefloor
// Independent random numbers; by default all pixels have the same ones, turned by a blue noise
pathTracer._pathTracer.material.setDefine("RANDOM_TYPE", 0);
const judge = new Worker(new URL("./judge.js", import.meta.url), { type: "module" });
const seen = viewing({ canvas: renderer.domElement, distance: Number(query.get("distance") ?? 0.6) });
const options = { toneMapping: toneMappingOf(renderer), viewing: seen, tile };
judge.postMessage({ open: [width, height, options] });
let next = Infinity; // samples per pixel at which the judge wants to see the picture
judge.onmessage = ({ data }) => ({ next, isDone: pathTracer.pausePathTracing = false } = data);
const pixels = new Float32Array(4 * width * height);
function read() {
  next = Infinity; // until the judge has answered
  renderer.readRenderTargetPixels(pathTracer.target, 0, 0, width, height, pixels);
  judge.postMessage({ pixels, spp: pathTracer.samples });
}
// ----

let state = { states: [], warnings: [] };
judge.addEventListener("message", ({ data }) => {
  state = { ...state, ...data };
  drawTiles(document.querySelector("#tiles"), width, height, state.states);
  window.noisefloor = state; // for the test
});

function frame() {
  pathTracer.renderSample();
  if (pathTracer.samples >= next) read(); // noisefloor
  const { states, error, warnings, isDone } = state;
  const done = states.filter(({ reason }) => reason !== "open").length;
  const samples = Math.round(pathTracer.samples);
  const progress = `${samples} samples per pixel, ${done} of ${states.length} tiles done`;
  status.textContent = [error ?? progress, ...warnings].join(" · ") + (isDone ? " · finished" : "");
  if (!error) requestAnimationFrame(frame);
}
const checkbox = document.querySelector("#show");
checkbox.onchange = () => document.querySelector("#tiles").classList.toggle("hidden", !checkbox.checked);
frame();
