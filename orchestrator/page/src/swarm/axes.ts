import { niceStep } from "../format.ts";
import type { Shape } from "../sketch.ts";
import type { Camera } from "../store.ts";
import type { Theme } from "./colours.ts";
import { type Label, type Picture, ROBOT_STRIDE } from "./picture.ts";

/** At most so many robots have their number beside them. */
const NUMBERED_ROBOTS = 80;

/** Fills in the grid and returns the step between its lines (m). */
export function drawGrid(picture: Picture, camera: Camera, width: number, height: number, theme: Theme): number {
  const step = niceStep(90 / camera.scale);
  const { grid } = picture;
  grid.clear();
  const [x0, x1] = [camera.x - width / 2 / camera.scale, camera.x + width / 2 / camera.scale];
  const [y0, y1] = [camera.y - height / 2 / camera.scale, camera.y + height / 2 / camera.scale];
  for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) grid.segment(x, y0, x, y1, theme.grid);
  for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) grid.segment(x0, y, x1, y, theme.grid);
  return step;
}

/** Axes, a scale, and the numbers and names beside what the picture shows. */
export function annotations(picture: Picture, camera: Camera, width: number, height: number, selected: number | null, theme: Theme): Shape[] {
  const shapes: Shape[] = [];
  const step = niceStep(90 / camera.scale);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const px = (x: number): number => width / 2 + (x - camera.x) * camera.scale;
  const py = (y: number): number => height / 2 - (y - camera.y) * camera.scale;
  const text = { kind: "text", fill: theme.faintText, size: 11, halo: theme.background } as const;
  const [x0, x1] = [camera.x - width / 2 / camera.scale, camera.x + width / 2 / camera.scale];
  const [y0, y1] = [camera.y - height / 2 / camera.scale, camera.y + height / 2 / camera.scale];
  for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
    if (px(x) > 40 && px(x) < width - 100) shapes.push({ ...text, x: px(x), y: height - 10, text: x.toFixed(digits), anchor: "middle" });
  }
  for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
    if (py(y) > 30 && py(y) < height - 28) shapes.push({ ...text, x: 6, y: py(y), text: y.toFixed(digits) });
  }
  shapes.push({ ...text, x: width - 8, y: height - 10, text: "x, east (m)", anchor: "end" });
  shapes.push({ ...text, x: 6, y: 12, text: "y, north (m)" });
  scaleBar(shapes, step, step * camera.scale, width, height, theme);
  for (const label of [...picture.siteLabels, ...picture.labels]) pushLabel(shapes, label, px, py, theme);
  robotNumbers(shapes, picture, camera, width, height, selected, theme);
  return shapes;
}

function scaleBar(shapes: Shape[], metres: number, lengthPx: number, width: number, height: number, theme: Theme): void {
  const right = width - 12;
  const y = height - 30;
  const text = `${+metres.toPrecision(3)} m`;
  shapes.push({ kind: "line", x1: right - lengthPx, y1: y, x2: right, y2: y, stroke: theme.text, width: 2 });
  shapes.push({ kind: "text", x: right - lengthPx / 2, y: y - 10, text, fill: theme.text, size: 11, anchor: "middle", halo: theme.background });
}

function pushLabel(shapes: Shape[], label: Label, px: (x: number) => number, py: (y: number) => number, theme: Theme): void {
  const anchor = label.offsetPx === 0 ? "middle" : "start";
  const { text, colour } = label;
  shapes.push({
    kind: "text", x: px(label.x) + label.offsetPx, y: py(label.y) - label.offsetPx, text, fill: colour, size: 11, anchor, halo: theme.background,
  });
}

/** Numbers beside robots, if those within the picture are few enough; the selected robot always has one. */
function robotNumbers(
  shapes: Shape[], picture: Picture, camera: Camera, width: number, height: number, selected: number | null, theme: Theme,
): void {
  const { robots, dead } = picture;
  const visible: { agent: number; x: number; y: number }[] = [];
  const add = (agent: number, xM: number, yM: number): void => {
    const x = width / 2 + (xM - camera.x) * camera.scale;
    const y = height / 2 - (yM - camera.y) * camera.scale;
    if (x > 0 && y > 0 && x < width && y < height) visible.push({ agent, x, y });
  };
  for (let i = 0; i < robots.count; i++) add(robots.agents[i], robots.data[i * ROBOT_STRIDE], robots.data[i * ROBOT_STRIDE + 1]);
  for (let i = 0; i < dead.length; i += 3) add(dead[i], dead[i + 1], dead[i + 2]);
  const shown = visible.length <= NUMBERED_ROBOTS ? visible : visible.filter(({ agent }) => agent === selected);
  for (const { agent, x, y } of shown) {
    const bold = agent === selected;
    shapes.push({ kind: "text", x: x + 9, y: y - 9, text: String(agent), fill: theme.text, size: bold ? 13 : 11, bold, halo: theme.background });
  }
}
