import { defineConfig } from "vite";

// Of each page one script and one style sheet with fixed names, since the Rust program embeds them; an IIFE, since a module script
// cannot be loaded from a file:// page. `vite build` makes the page of a run, and `vite build --mode runs` then that of many runs.
export default defineConfig(({ mode }) => {
  const page = mode === "runs" ? { input: "src/runs/main.ts", name: "runs" } : { input: "src/main.ts", name: "page" };
  return {
    build: {
      target: "es2022",
      outDir: "dist",
      emptyOutDir: page.name === "page",
      cssCodeSplit: false,
      rollupOptions: {
        input: page.input,
        output: {
          format: "iife",
          inlineDynamicImports: true,
          entryFileNames: `${page.name}.js`,
          assetFileNames: `${page.name}[extname]`,
        },
      },
    },
    publicDir: "static",
  };
});
