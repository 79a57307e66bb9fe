// Prints the snippet of the README as a module of TypeScript, with what it takes for granted declared.

import { readFileSync } from "node:fs";

const readme = readFileSync(new URL("../README.md", import.meta.url), "utf8");
const [, snippet] = readme.match(/^```js\n(.*?)^```$/ms);
const [imports] = snippet.match(/^import .*$/m);
const body = snippet.replace(imports, "");
console.log(`${imports}
declare const renderer: {
  domElement: HTMLCanvasElement;
  toneMapping: number;
  toneMappingExposure: number;
  readRenderTargetPixels(target: object, x: number, y: number, w: number, h: number, to: Float32Array): void;
};
declare const target: object;
declare const pixels: Float32Array;
declare const samples: number;
declare function renderSomeSamples(): Promise<void>;
${body}`);
