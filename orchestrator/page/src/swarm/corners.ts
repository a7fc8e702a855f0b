import { DART, type LineLayer, LINE_STRIDE, type RobotLayer, ROBOT_STRIDE } from "./picture.ts";

// Robots and lines become pairs of triangles, four corners each. They are computed here and not by instanced drawing or line primitives:
// software renderers treat every instance as a draw call of its own, and draw a line at twice the cost of two triangles.

/** Floats per corner of a robot: x, y (m), offset x, y (robot radii), colour. */
export const DART_STRIDE = 5;
/** Width of lines (CSS px). */
const LINE_PX = 1.2;

/** A buffer of corners that grows and is refilled in place. */
class Corners {
  protected corners = new Float32Array(0);
  protected colours = new Uint32Array(0);

  protected reserve(length: number): void {
    if (this.corners.length >= length) return;
    this.corners = new Float32Array(Math.max(length, 2 * this.corners.length));
    this.colours = new Uint32Array(this.corners.buffer);
  }
}

/** Corners of line segments: both ends to either side, with the layout of a vertex of `LineLayer`. */
export class LineCorners extends Corners {
  expand(layer: LineLayer): Float32Array {
    this.reserve(layer.count * 2 * LINE_STRIDE);
    const { corners, colours } = this;
    const { data } = layer;
    let at = 0;
    for (let i = 0; i + 1 < layer.count; i += 2) {
      const a = i * LINE_STRIDE;
      const b = a + LINE_STRIDE;
      // A segment runs between two points of the world, or between two pixels beside one point: the directions agree on the screen.
      const dx = data[b] - data[a] + (data[b + 2] - data[a + 2]);
      const dy = data[b + 1] - data[a + 1] + (data[b + 3] - data[a + 3]);
      const half = (0.5 * LINE_PX) / (Math.sqrt(dx * dx + dy * dy) || 1);
      const nx = -dy * half;
      const ny = dx * half;
      for (let k = 0; k < 4; k++) {
        const from = k < 2 ? a : b;
        const side = k === 0 || k === 3 ? 1 : -1;
        corners[at] = data[from];
        corners[at + 1] = data[from + 1];
        corners[at + 2] = data[from + 2] + side * nx;
        corners[at + 3] = data[from + 3] + side * ny;
        corners[at + 4] = data[from + 4];
        colours[at + 5] = layer.colour(k < 2 ? i : i + 1);
        at += LINE_STRIDE;
      }
    }
    return corners;
  }
}

/** Corners of robots. */
export class DartCorners extends Corners {
  expand(layer: RobotLayer): Float32Array {
    this.reserve(layer.count * 4 * DART_STRIDE);
    const { corners, colours } = this;
    let at = 0;
    for (let i = 0; i < layer.count; i++) {
      const from = i * ROBOT_STRIDE;
      const c = Math.cos(layer.data[from + 2]);
      const s = Math.sin(layer.data[from + 2]);
      const colour = layer.colour(i);
      for (let k = 0; k < 8; k += 2) {
        corners[at] = layer.data[from];
        corners[at + 1] = layer.data[from + 1];
        corners[at + 2] = c * DART[k] - s * DART[k + 1];
        corners[at + 3] = s * DART[k] + c * DART[k + 1];
        colours[at + 4] = colour;
        at += DART_STRIDE;
      }
    }
    return corners;
  }
}

/** Two triangles for every four corners; a robot's share the edge from its nose to the notch of its tail. */
export function cornerIndices(quads: number): Uint32Array {
  const indices = new Uint32Array(quads * 6);
  for (let i = 0; i < quads; i++) {
    const [to, from] = [6 * i, 4 * i];
    indices[to] = indices[to + 3] = from;
    indices[to + 1] = from + 1;
    indices[to + 2] = indices[to + 4] = from + 2;
    indices[to + 5] = from + 3;
  }
  return indices;
}
