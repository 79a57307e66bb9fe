// three-gpu-pathtracer on WebGPU.

import { WebGPURenderer } from "three/webgpu";
import { WebGPUPathTracer } from "three-gpu-pathtracer/webgpu";
import * as RANDOM_PCG from "three-gpu-pathtracer/src/webgpu/nodes/rand/pcg.wgsl.js";

/** Pixels get their samples at different times: so many at once, and then they wait for each other. */
const ROUND = 8;

export async function open() {
  const renderer = new WebGPURenderer({ antialias: false });
  await renderer.init();
  const tracer = new WebGPUPathTracer(renderer);
  tracer.maxBounces = 3;
  tracer.clampIndirect = 0; // light is light
  tracer.filterGlossyFactor = 0;
  tracer.dynamicLowRes = false;
  tracer.renderDelay = 0;
  tracer.fadeDuration = 0;
  tracer.maxSamples = ROUND;
  let [samples, counting] = [0, false];
  async function count() {
    counting = true;
    const { min } = await tracer.getSampleCountsAsync();
    if (min >= tracer.maxSamples) samples = tracer.maxSamples;
    counting = false;
  }
  return {
    renderer,
    setScene(scene, camera) {
      const { width, height } = renderer.domElement;
      tracer.frameBudget = width * height; // all pixels in one round
      // Independent random numbers; by default all pixels have the same ones, turned by a blue noise
      tracer.setRandom(RANDOM_PCG);
      tracer.setScene(scene, camera);
    },
    /** Of every pixel. */
    get samples() {
      return samples;
    },
    renderSample() {
      if (samples === tracer.maxSamples) tracer.maxSamples += ROUND;
      tracer.renderSample();
      if (!counting) count();
    },
    /** The mean of all samples, and how it lies: rows of a multiple of 256 bytes. */
    async read() {
      const { width, height } = tracer.target;
      const spp = samples;
      const pixels = await renderer.backend.copyTextureToBuffer(tracer.target, 0, 0, width, height, 0);
      return [pixels, { spp, channels: 4, stride: 64 * Math.ceil(width / 16) }];
    },
  };
}
