import { paintShapes, type Shape, sizedContext } from "../sketch.ts";
import type { Camera } from "../store.ts";
import { pack, type Packed } from "./colours.ts";
import { DART, type FillLayer, FILL_STRIDE, type LineLayer, LINE_STRIDE, type Picture, type RobotLayer, ROBOT_STRIDE } from "./picture.ts";
import type { Painter } from "./webgl.ts";

/** Length of a dash with the gap after it, and of the dash (px). */
const PERIOD_PX = 9;
const DASH_PX = 5;

/** Pixels of a picture, least significant byte red, and what can be drawn onto them. Nothing has smooth edges. */
export class Raster {
  /** Signed, since the processor computes with signed numbers fastest. */
  readonly pixels: Int32Array;

  constructor(
    readonly width: number,
    readonly height: number,
    buffer: ArrayBufferLike = new ArrayBuffer(4 * width * height),
  ) {
    this.pixels = new Int32Array(buffer);
  }

  /** A line one pixel wide. The colour changes to the second one half-way. */
  line(x0: number, y0: number, x1: number, y1: number, first: Packed, second: Packed, dashed: boolean): void {
    const { width, height } = this;
    const dx = x1 - x0;
    const dy = y1 - y0;
    // Along the longer direction one pixel after the other.
    const count = Math.max(1, Math.round(Math.max(Math.abs(dx), Math.abs(dy))));
    const mx = dx / count;
    const my = dy / count;
    // Only the part within the picture.
    let from = 0;
    let to = count;
    if (x0 < 1 || y0 < 1 || x1 < 1 || y1 < 1 || x0 > width - 2 || x1 > width - 2 || y0 > height - 2 || y1 > height - 2) {
      for (let axis = 0; axis < 2; axis++) {
        const start = axis === 0 ? x0 : y0;
        const step = axis === 0 ? mx : my;
        const most = (axis === 0 ? width : height) - 0.01;
        if (Math.abs(step) < 1e-9) {
          if (start < 0 || start >= most) return;
          continue;
        }
        const a = -start / step;
        const b = (most - start) / step;
        from = Math.max(from, Math.ceil(Math.min(a, b)));
        to = Math.min(to, Math.floor(Math.max(a, b)));
      }
      if (from > to) return;
    }
    const period = dashed ? PERIOD_PX / Math.sqrt(mx * mx + my * my) : 0;
    const middle = first === second ? to : Math.min(to, Math.floor(count / 2));
    if (from <= middle) this.span(x0, y0, mx, my, from, middle, first | 0, period);
    if (middle < to) this.span(x0, y0, mx, my, Math.max(from, middle + 1), to, second | 0, period);
  }

  /** The pixels `from` to `to` of a line; of a dashed one those in the first part of each period. */
  private span(x0: number, y0: number, mx: number, my: number, from: number, to: number, colour: number, period: number): void {
    const { pixels, width } = this;
    // 16 bits after the point.
    let x = ((x0 + from * mx) * 65536) | 0;
    let y = ((y0 + from * my) * 65536) | 0;
    const sx = (mx * 65536) | 0;
    const sy = (my * 65536) | 0;
    const alpha = colour >>> 24;
    if (alpha === 255 && period === 0) {
      for (let i = from; i <= to; i++, x += sx, y += sy) pixels[Math.imul(y >> 16, width) + (x >> 16)] = colour;
      return;
    }
    const share = alpha + (alpha >> 7);
    const rest = 256 - share;
    const redBlue = Math.imul(colour & 0xff00ff, share);
    const green = Math.imul(colour & 0xff00, share);
    // Dashes are counted in parts of 1/256 of a pixel.
    const length = (period * 256) | 0;
    const dash = ((length * DASH_PX) / PERIOD_PX) | 0;
    let phase = length > 0 ? (from * 256) % length : 0;
    for (let i = from; i <= to; i++, x += sx, y += sy) {
      if (length > 0) {
        phase += 256;
        if (phase >= length) phase -= length;
        if (phase > dash) continue;
      }
      const at = Math.imul(y >> 16, width) + (x >> 16);
      const under = pixels[at];
      pixels[at] = -16777216 | (((Math.imul(under & 0xff00ff, rest) + redBlue) >>> 8) & 0xff00ff) | (((Math.imul(under & 0xff00, rest) + green) >>> 8) & 0xff00);
    }
  }

  /** A triangle: all pixels whose centre is in it. */
  triangle(x0: number, y0: number, x1: number, y1: number, x2: number, y2: number, packed: Packed): void {
    const { width, height, pixels } = this;
    const colour = packed | 0;
    const alpha = packed >>> 24;
    const top = Math.max(0, Math.ceil(Math.min(y0, y1, y2) - 0.5));
    const bottom = Math.min(height - 1, Math.floor(Math.max(y0, y1, y2) - 0.5));
    for (let row = top; row <= bottom; row++) {
      const y = row + 0.5;
      let left = 1e9;
      let right = -1e9;
      if (y0 <= y !== y1 <= y) {
        const x = x0 + ((y - y0) * (x1 - x0)) / (y1 - y0);
        left = x;
        right = x;
      }
      if (y1 <= y !== y2 <= y) {
        const x = x1 + ((y - y1) * (x2 - x1)) / (y2 - y1);
        if (x < left) left = x;
        if (x > right) right = x;
      }
      if (y2 <= y !== y0 <= y) {
        const x = x2 + ((y - y2) * (x0 - x2)) / (y0 - y2);
        if (x < left) left = x;
        if (x > right) right = x;
      }
      const start = row * width;
      const from = start + Math.max(0, Math.ceil(left - 0.5));
      const to = start + Math.min(width - 1, Math.ceil(right - 0.5) - 1);
      if (alpha === 255) for (let at = from; at <= to; at++) pixels[at] = colour;
      else for (let at = from; at <= to; at++) pixels[at] = blend(pixels[at], colour, alpha);
    }
  }
}

/** A colour over an opaque one. */
function blend(under: number, over: number, alpha: number): number {
  // Parts of 256, so that red and blue can share one product each.
  const share = alpha + (alpha >> 7);
  const rest = 256 - share;
  const redBlue = ((Math.imul(under & 0xff00ff, rest) + Math.imul(over & 0xff00ff, share)) >>> 8) & 0xff00ff;
  const green = ((Math.imul(under & 0xff00, rest) + Math.imul(over & 0xff00, share)) >>> 8) & 0xff00;
  return -16777216 | redBlue | green;
}

/**
 * Draws pictures with many lines and robots pixel by pixel, without a graphics library: for browsers whose WebGL runs on the processor,
 * where a line costs many times as much.
 */
export class RasterPainter implements Painter {
  readonly name = "raster";
  private image: ImageData | null = null;
  private raster = new Raster(0, 0);
  /** Background, grid and site, which stay as they are while robots move. */
  private still = new Int32Array(0);
  private stillKey = "";
  private scratch: CanvasRenderingContext2D | null = null;
  /** Pixels that are drawn last, and their colours. */
  private stamp = { at: new Int32Array(0), colours: new Int32Array(0) };

  constructor(private readonly context: CanvasRenderingContext2D) {}

  paint(picture: Picture, camera: Camera, width: number, height: number, ratio: number): void {
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.image === null || this.raster.width !== w || this.raster.height !== h) {
      this.image = new ImageData(w, h);
      this.raster = new Raster(w, h, this.image.data.buffer);
      this.still = new Int32Array(w * h);
      this.stillKey = "";
    }
    const to: Transform = { x0: w / 2 - camera.x * camera.scale * ratio, y0: h / 2 + camera.y * camera.scale * ratio, scale: camera.scale * ratio, ratio };
    const { fills, grid, site, trails, trailHeads, links, missed, robots, marks } = picture;
    const key = [picture.background, to.x0, to.y0, to.scale, fills.version, grid.version, site.version].join();
    if (key === this.stillKey) this.raster.pixels.set(this.still);
    else {
      this.stillKey = key;
      this.raster.pixels.fill(pack(picture.background));
      this.fills(fills, to);
      this.lines(grid, to);
      this.lines(site, to);
      this.still.set(this.raster.pixels);
    }
    for (const layer of [trails, trailHeads, links, missed]) this.lines(layer, to);
    this.robots(robots, picture.robotRadiusPx * ratio, to);
    this.lines(marks, to);
    const { at, colours } = this.stamp;
    for (let i = 0; i < at.length; i++) this.raster.pixels[at[i]] = blend(this.raster.pixels[at[i]], colours[i], colours[i] >>> 24);
    this.context.putImageData(this.image, 0, 0);
  }

  /** Takes text and axes, to be drawn over each picture; null: draws none. Sizes are those of the picture (CSS px). */
  setStamp(shapes: Shape[] | null, width: number, height: number): void {
    this.stamp = { at: new Int32Array(0), colours: new Int32Array(0) };
    if (shapes === null) return;
    this.scratch ??= document.createElement("canvas").getContext("2d", { willReadFrequently: true }) as CanvasRenderingContext2D;
    paintShapes(sizedContext(this.scratch.canvas, width, height), shapes);
    const { canvas } = this.scratch;
    const pixels = new Int32Array(this.scratch.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    const at = pixels.reduce((found: number[], pixel, i) => {
      if (pixel >>> 24 !== 0) found.push(i);
      return found;
    }, []);
    this.stamp = { at: Int32Array.from(at), colours: Int32Array.from(at, (i) => pixels[i]) };
  }

  private fills(layer: FillLayer, { x0, y0, scale }: Transform): void {
    const { data } = layer;
    for (let i = 0; i + 2 < layer.count; i += 3) {
      const [a, b, c] = [i * FILL_STRIDE, (i + 1) * FILL_STRIDE, (i + 2) * FILL_STRIDE];
      this.raster.triangle(x0 + data[a] * scale, y0 - data[a + 1] * scale, x0 + data[b] * scale, y0 - data[b + 1] * scale,
        x0 + data[c] * scale, y0 - data[c + 1] * scale, layer.colour(i));
    }
  }

  private lines(layer: LineLayer, { x0, y0, scale, ratio }: Transform): void {
    const { data } = layer;
    for (let i = 0; i + 1 < layer.count; i += 2) {
      const a = i * LINE_STRIDE;
      const b = a + LINE_STRIDE;
      this.raster.line(x0 + data[a] * scale + data[a + 2] * ratio, y0 - data[a + 1] * scale - data[a + 3] * ratio,
        x0 + data[b] * scale + data[b + 2] * ratio, y0 - data[b + 1] * scale - data[b + 3] * ratio,
        layer.colour(i), layer.colour(i + 1), data[a + 4] >= 0);
    }
  }

  private robots(layer: RobotLayer, radius: number, { x0, y0, scale }: Transform): void {
    const { data } = layer;
    const { width, height } = this.raster;
    const [px, py] = [new Float64Array(4), new Float64Array(4)];
    for (let i = 0; i < layer.count; i++) {
      const at = i * ROBOT_STRIDE;
      const x = x0 + data[at] * scale;
      const y = y0 - data[at + 1] * scale;
      if (x < -20 || y < -20 || x > width + 20 || y > height + 20) continue;
      const c = Math.cos(data[at + 2]) * radius;
      const s = Math.sin(data[at + 2]) * radius;
      for (let k = 0; k < 4; k++) {
        px[k] = x + c * DART[2 * k] - s * DART[2 * k + 1];
        py[k] = y - s * DART[2 * k] - c * DART[2 * k + 1];
      }
      const colour = layer.colour(i);
      this.raster.triangle(px[0], py[0], px[1], py[1], px[2], py[2], colour);
      this.raster.triangle(px[0], py[0], px[2], py[2], px[3], py[3], colour);
    }
  }
}

/** Where metres are in the picture: pixel of the origin, and pixels per metre and per CSS pixel. */
interface Transform {
  x0: number;
  y0: number;
  scale: number;
  ratio: number;
}
