import type { Way } from "../network/way.ts";
import type { Shape } from "../sketch.ts";
import type { Camera } from "../store.ts";
import { OKABE_ITO, type Theme } from "./colours.ts";

/** Room between the line of a hop and the middle of a robot (px). */
const GAP_PX = 9;
/** Length of arrow heads (px). */
const HEAD_PX = 13;

export function wayColour(theme: Theme): string {
  return theme.dark ? OKABE_ITO.yellow : OKABE_ITO.orange;
}

/** The way of the followed packet over the map: an arrow for each hop between where its ends were then, with its number and its attempts. */
export function wayShapes(way: Way, camera: Camera, width: number, height: number, theme: Theme): Shape[] {
  const lines: Shape[] = [];
  const labels: Shape[] = [];
  const colour = wayColour(theme);
  const edge = theme.dark ? "#000000" : "#3b2a00";
  const px = ([x, y]: [number, number]): [number, number] => [width / 2 + (x - camera.x) * camera.scale, height / 2 - (y - camera.y) * camera.scale];
  way.hops.forEach((hop, i) => {
    if (hop.from === null) return;
    const [x0, y0] = px(hop.from);
    const attempts = hop.frames.length > 1 ? ` (${hop.frames.length} frames)` : "";
    const text = `${i + 1}${attempts}`;
    if (hop.to === null) {
      // For everyone in reach: rings instead of an arrow.
      for (const [stroke, w] of [[edge, 6], [colour, 4]] as const) lines.push({ kind: "circle", x: x0, y: y0, r: 20, stroke, width: w });
      labels.push({ kind: "text", x: x0 + 26, y: y0 - 18, text, fill: theme.text, bold: true, halo: theme.background });
      return;
    }
    const [x1, y1] = px(hop.to);
    const length = Math.hypot(x1 - x0, y1 - y0);
    const [ux, uy] = length > 0 ? [(x1 - x0) / length, (y1 - y0) / length] : [1, 0];
    const gap = Math.min(GAP_PX, length / 4);
    const head = Math.min(HEAD_PX, length / 2);
    const tip = [x1 - ux * gap, y1 - uy * gap];
    const neck = [tip[0] - ux * head, tip[1] - uy * head];
    const dash = hop.received ? undefined : [10, 7];
    for (const [stroke, w] of [[edge, 6.5], [colour, 4.5]] as const) {
      lines.push({ kind: "line", x1: x0 + ux * gap, y1: y0 + uy * gap, x2: neck[0] + ux, y2: neck[1] + uy, stroke, width: w, dash });
    }
    const half = 0.55 * head;
    const points = [tip[0], tip[1], neck[0] - uy * half, neck[1] + ux * half, neck[0] + uy * half, neck[1] - ux * half, tip[0], tip[1]];
    lines.push({ kind: "path", points, fill: colour, stroke: edge, width: 1 });
    // Beside the line, on its left: the labels of a hop and of one in the other direction do not cover each other.
    const [mx, my] = [(x0 + x1) / 2 + uy * 13, (y0 + y1) / 2 - ux * 13];
    labels.push({ kind: "text", x: mx, y: my, text, fill: theme.text, bold: true, anchor: "middle", halo: theme.background });
  });
  return [...lines, ...labels];
}
