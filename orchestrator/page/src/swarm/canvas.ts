import type { Camera } from "../store.ts";
import { css } from "./colours.ts";
import { DART, eachStroke, type FillLayer, FILL_STRIDE, type LineLayer, LINE_STRIDE, type Picture, type RobotLayer, ROBOT_STRIDE } from "./picture.ts";
import type { Painter } from "./webgl.ts";

/** Draws pictures by Canvas 2D: for browsers without WebGL2, and for PNG files. */
export class CanvasPainter implements Painter {
  readonly name = "canvas2d";

  constructor(private readonly context: CanvasRenderingContext2D) {}

  paint(picture: Picture, camera: Camera, width: number, height: number, ratio: number): void {
    const context = this.context;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = picture.background;
    context.fillRect(0, 0, width, height);
    const px = (x: number): number => width / 2 + (x - camera.x) * camera.scale;
    const py = (y: number): number => height / 2 - (y - camera.y) * camera.scale;
    this.fills(picture.fills, px, py);
    for (const layer of picture.linesBelow) this.lines(layer, px, py);
    this.robots(picture.robots, picture.robotRadiusPx, px, py);
    this.lines(picture.marks, px, py);
  }

  private fills(layer: FillLayer, px: (x: number) => number, py: (y: number) => number): void {
    const { data } = layer;
    for (let i = 0; i + 2 < layer.count; i += 3) {
      this.context.fillStyle = css(layer.colour(i));
      this.context.beginPath();
      for (let k = 0; k < 3; k++) this.context.lineTo(px(data[(i + k) * FILL_STRIDE]), py(data[(i + k) * FILL_STRIDE + 1]));
      this.context.fill();
    }
  }

  private lines(layer: LineLayer, px: (x: number) => number, py: (y: number) => number): void {
    const context = this.context;
    const { data } = layer;
    context.lineWidth = 1;
    let colour = -1;
    let dashed = false;
    context.beginPath();
    eachStroke(layer, (vertex, from, to, next) => {
      const a = vertex * LINE_STRIDE;
      const b = a + LINE_STRIDE;
      if (next !== colour || data[a + 4] >= 0 !== dashed) {
        context.stroke();
        context.beginPath();
        colour = next;
        dashed = data[a + 4] >= 0;
        context.strokeStyle = css(colour);
        context.setLineDash(dashed ? [5, 4] : []);
      }
      const [x0, y0] = [px(data[a]) + data[a + 2], py(data[a + 1]) - data[a + 3]];
      const [dx, dy] = [px(data[b]) + data[b + 2] - x0, py(data[b + 1]) - data[b + 3] - y0];
      context.moveTo(x0 + from * dx, y0 + from * dy);
      context.lineTo(x0 + to * dx, y0 + to * dy);
    });
    context.stroke();
    context.setLineDash([]);
  }

  private robots(layer: RobotLayer, radius: number, px: (x: number) => number, py: (y: number) => number): void {
    const context = this.context;
    for (let i = 0; i < layer.count; i++) {
      const at = i * ROBOT_STRIDE;
      const c = Math.cos(layer.data[at + 2]) * radius;
      const s = Math.sin(layer.data[at + 2]) * radius;
      const x = px(layer.data[at]);
      const y = py(layer.data[at + 1]);
      context.fillStyle = css(layer.colour(i));
      context.beginPath();
      for (let k = 0; k < DART.length; k += 2) context.lineTo(x + c * DART[k] - s * DART[k + 1], y - s * DART[k] - c * DART[k + 1]);
      context.fill();
    }
  }
}
