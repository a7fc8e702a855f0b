import type { Exported } from "./app.ts";
import { element } from "./dom.ts";

/** PNG files have this many pixels per CSS pixel. */
const PNG_RATIO = 2;

/** Hands over a file. */
export function download(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  const link = element("a", { href: url, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Saves what a view shows as an SVG file. */
export function saveSvg(view: Exported, name: string): void {
  download(new Blob([view.svg()], { type: "image/svg+xml" }), `${name}.svg`);
}

/** Saves what a view shows as a PNG file. */
export function savePng(view: Exported, name: string): void {
  const canvas = element("canvas", { width: Math.round(view.width * PNG_RATIO), height: Math.round(view.height * PNG_RATIO) });
  view.paint(canvas.getContext("2d") as CanvasRenderingContext2D, PNG_RATIO);
  canvas.toBlob((blob) => {
    if (blob !== null) download(blob, `${name}.png`);
  });
}
