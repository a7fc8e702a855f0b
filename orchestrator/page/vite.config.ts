import { defineConfig } from "vite";

// One script and one style sheet with fixed names, since the Rust program embeds them; an IIFE, since a module script cannot be
// loaded from a file:// page.
export default defineConfig({
  build: {
    target: "es2022",
    outDir: "dist",
    cssCodeSplit: false,
    rollupOptions: {
      input: "src/main.ts",
      output: {
        format: "iife",
        inlineDynamicImports: true,
        entryFileNames: "page.js",
        assetFileNames: "page[extname]",
      },
    },
  },
  publicDir: "static",
});
