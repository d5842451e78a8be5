import { defineConfig } from "vite";

export default defineConfig({
  base: "./",
  build: {
    outDir: "../aerodaas/service/http/page",
    emptyOutDir: true,
    // One name for each file: the server knows them, and what ships can be compared.
    rollupOptions: {
      output: {
        entryFileNames: "console.js",
        assetFileNames: "console[extname]",
      },
    },
    license: { fileName: "licences.md" },
    modulePreload: false,
    target: "es2022",
  },
});
