export default {
  base: "./",
  build: { target: "es2022", chunkSizeWarningLimit: 2000 },
  worker: { format: "es" },
  // The package lies outside this folder
  server: { fs: { allow: ["../.."] } },
  // Vite would copy the file of JavaScript away from the one of WebAssembly
  optimizeDeps: { exclude: ["noisefloor"] },
};
