import type { Camera } from "../store.ts";
import { css } from "./colours.ts";
import { DART, eachStroke, FILL_STRIDE, type LineLayer, LINE_STRIDE, type Picture, ROBOT_STRIDE } from "./picture.ts";

const round = (value: number): string => String(Math.round(value * 10) / 10);

/** A picture as elements of an SVG document. */
export function pictureToSvg(picture: Picture, camera: Camera, width: number, height: number): string {
  const px = (x: number): number => width / 2 + (x - camera.x) * camera.scale;
  const py = (y: number): number => height / 2 - (y - camera.y) * camera.scale;
  const parts: string[] = [];
  const { fills, robots } = picture;
  for (let i = 0; i + 2 < fills.count; i += 3) {
    const points = [0, 1, 2].map((k) => `${round(px(fills.data[(i + k) * FILL_STRIDE]))},${round(py(fills.data[(i + k) * FILL_STRIDE + 1]))}`);
    parts.push(`<polygon points="${points.join(" ")}" fill="${css(fills.colour(i))}"/>`);
  }
  for (const layer of picture.linesBelow) lines(parts, layer, px, py);
  for (let i = 0; i < robots.count; i++) {
    const at = i * ROBOT_STRIDE;
    const c = Math.cos(robots.data[at + 2]) * picture.robotRadiusPx;
    const s = Math.sin(robots.data[at + 2]) * picture.robotRadiusPx;
    const points: string[] = [];
    for (let k = 0; k < DART.length; k += 2) {
      const x = px(robots.data[at]) + c * DART[k] - s * DART[k + 1];
      const y = py(robots.data[at + 1]) - s * DART[k] - c * DART[k + 1];
      points.push(`${round(x)},${round(y)}`);
    }
    parts.push(`<polygon points="${points.join(" ")}" fill="${css(robots.colour(i))}"><title>robot ${robots.agents[i]}</title></polygon>`);
  }
  lines(parts, picture.marks, px, py);
  return parts.join("\n");
}

/** Joins segments of one colour to a path, so that a file stays small. */
function lines(parts: string[], layer: LineLayer, px: (x: number) => number, py: (y: number) => number): void {
  const { data } = layer;
  let path = "";
  let style = "";
  const flush = (): void => {
    if (path !== "") parts.push(`<path d="${path}" fill="none" ${style}/>`);
    path = "";
  };
  eachStroke(layer, (vertex, from, to, colour) => {
    const a = vertex * LINE_STRIDE;
    const b = a + LINE_STRIDE;
    const next = `stroke="${css(colour)}"${data[a + 4] >= 0 ? ' stroke-dasharray="5 4"' : ""}`;
    if (next !== style) flush();
    style = next;
    const [x0, y0] = [px(data[a]) + data[a + 2], py(data[a + 1]) - data[a + 3]];
    const [dx, dy] = [px(data[b]) + data[b + 2] - x0, py(data[b + 1]) - data[b + 3] - y0];
    path += `M${round(x0 + from * dx)} ${round(y0 + from * dy)}L${round(x0 + to * dx)} ${round(y0 + to * dy)}`;
  });
  flush();
}
