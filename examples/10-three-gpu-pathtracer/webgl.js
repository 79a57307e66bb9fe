// three-gpu-pathtracer on WebGL 2: where there is no WebGPU.

import { HalfFloatType, WebGLRenderer } from "three";
import { WebGLPathTracer } from "three-gpu-pathtracer";

export async function open(query) {
  const renderer = new WebGLRenderer({ antialias: false });
  const tracer = new WebGLPathTracer(renderer);
  tracer.tiles.set(1, 1); // every pixel has as many samples when it is read
  tracer.bounces = 3;
  tracer.multipleImportanceSampling = false; // a sky without a sun needs none
  tracer.renderDelay = 0;
  tracer.fadeDuration = 0;
  tracer.minSamples = 1;
  // As whoever renders where floats cannot be blended has to: for the test
  if (query.has("half")) tracer._pathTracer._primaryTarget.texture.type = HalfFloatType;
  return {
    renderer,
    setScene(scene, camera) {
      tracer.setScene(scene, camera);
      // Independent random numbers; by default all pixels have the same ones, turned by a blue noise
      tracer._pathTracer.material.setDefine("RANDOM_TYPE", 0);
    },
    get samples() {
      return tracer.samples;
    },
    renderSample: () => tracer.renderSample(),
    /** The mean of all samples, and how it lies. */
    async read(session) {
      const { width, height, texture } = tracer.target;
      const halfFloats = texture.type === HalfFloatType;
      const pixels = session.buffer(4 * width * height, halfFloats ? Uint16Array : Float32Array);
      renderer.readRenderTargetPixels(tracer.target, 0, 0, width, height, pixels);
      return [pixels, { spp: tracer.samples, fromBottom: true, halfFloats }];
    },
  };
}
