import type { Packed } from "./colours.ts";

/** Floats per vertex of a line: x, y (m), offset x, y (px), metres along a dashed line or -1, colour. */
export const LINE_STRIDE = 6;
/** Floats per robot: x, y (m), heading (rad), colour. */
export const ROBOT_STRIDE = 4;
/** Floats per vertex of a filled triangle: x, y (m), colour. */
export const FILL_STRIDE = 3;

/** A vertex buffer that grows, is refilled in place and counts its changes, so that painters upload only what has changed. */
class Layer {
  data: Float32Array;
  /** The same memory, for colours. */
  protected colours: Uint32Array;
  count = 0;
  version = 0;

  constructor(private readonly stride: number) {
    this.data = new Float32Array(stride * 256);
    this.colours = new Uint32Array(this.data.buffer);
  }

  clear(): void {
    this.count = 0;
    this.version++;
  }

  protected reserve(more: number): number {
    const needed = (this.count + more) * this.stride;
    if (needed > this.data.length) {
      const data = new Float32Array(Math.max(needed, this.data.length * 2));
      data.set(this.data);
      this.data = data;
      this.colours = new Uint32Array(data.buffer);
    }
    const at = this.count * this.stride;
    this.count += more;
    return at;
  }

  /** Colour of entry `i`. */
  colour(i: number): Packed {
    return this.colours[(i + 1) * this.stride - 1];
  }
}

/** Line segments, two vertices each. */
export class LineLayer extends Layer {
  constructor() {
    super(LINE_STRIDE);
  }

  /** A line between two points of the world. */
  segment(x0: number, y0: number, x1: number, y1: number, colour: Packed, dashed = false): void {
    this.write(x0, y0, x1, y1, 0, 0, 0, 0, dashed ? Math.hypot(x1 - x0, y1 - y0) : -1, colour);
  }

  /** A line between two pixels beside a point of the world; y points up. */
  stroke(x: number, y: number, ox0: number, oy0: number, ox1: number, oy1: number, colour: Packed): void {
    this.write(x, y, x, y, ox0, oy0, ox1, oy1, -1, colour);
  }

  /** A circle of constant size on the screen around a point of the world. */
  ring(x: number, y: number, radiusPx: number, colour: Packed, corners = 16): void {
    for (let i = 0; i < corners; i++) {
      const a = (2 * Math.PI * i) / corners;
      const b = (2 * Math.PI * (i + 1)) / corners;
      const r = radiusPx;
      this.stroke(x, y, r * Math.cos(a), r * Math.sin(a), r * Math.cos(b), r * Math.sin(b), colour);
    }
  }

  /** A circle of the world. */
  circle(x: number, y: number, radius: number, colour: Packed, dashed = false, corners = 48): void {
    for (let i = 0; i < corners; i++) {
      if (dashed && i % 2 === 1) continue;
      const a = (2 * Math.PI * i) / corners;
      const b = (2 * Math.PI * (i + 1)) / corners;
      this.segment(x + radius * Math.cos(a), y + radius * Math.sin(a), x + radius * Math.cos(b), y + radius * Math.sin(b), colour);
    }
  }

  private write(
    x0: number, y0: number, x1: number, y1: number,
    ox0: number, oy0: number, ox1: number, oy1: number,
    length: number, colour: Packed,
  ): void {
    const at = this.reserve(2);
    const d = this.data;
    d[at] = x0;
    d[at + 1] = y0;
    d[at + 2] = ox0;
    d[at + 3] = oy0;
    d[at + 4] = length < 0 ? -1 : 0;
    this.colours[at + 5] = colour;
    d[at + 6] = x1;
    d[at + 7] = y1;
    d[at + 8] = ox1;
    d[at + 9] = oy1;
    d[at + 10] = length;
    this.colours[at + 11] = colour;
  }
}

/** Lines between pairs of robots, which remembers the pairs. */
export class PairLayer extends LineLayer {
  readonly pairs: number[] = [];
  /** Which robots each line is between. */
  private readonly ends: number[] = [];

  override clear(): void {
    super.clear();
    this.pairs.length = 0;
    this.ends.length = 0;
  }

  /** Moves the ends of all lines to where the robots are. */
  place(x: Float32Array, y: Float32Array): void {
    const { data, ends } = this;
    for (let i = 0, at = 0; i < ends.length; i += 2, at += 2 * LINE_STRIDE) {
      const [a, b] = [ends[i], ends[i + 1]];
      const [x0, y0, x1, y1] = [x[a], y[a], x[b], y[b]];
      data[at] = x0;
      data[at + 1] = y0;
      data[at + 6] = x1;
      data[at + 7] = y1;
      if (data[at + 10] >= 0) data[at + 10] = Math.sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0));
    }
    this.version++;
  }

  link(sender: number, receiver: number, x: Float32Array, y: Float32Array, colour: Packed, dashed: boolean): void {
    this.segment(x[sender], y[sender], x[receiver], y[receiver], colour, dashed);
    this.pairs.push(sender, receiver);
    this.ends.push(sender, receiver);
  }

  /** Both directions between two robots as one line, which at each end has the colour of what the robot there sent. */
  linkBoth(a: number, b: number, x: Float32Array, y: Float32Array, colourA: Packed, colourB: Packed): void {
    this.segment(x[a], y[a], x[b], y[b], colourA);
    this.colours[this.count * LINE_STRIDE - 1] = colourB;
    this.pairs.push(a, b, b, a);
    this.ends.push(a, b);
  }
}

/** Calls `draw` with the ends of every line (indices of its vertices and the share of the way at which to begin and end) and its colour. */
export function eachStroke(layer: LineLayer, draw: (vertex: number, from: number, to: number, colour: Packed) => void): void {
  for (let i = 0; i + 1 < layer.count; i += 2) {
    const [first, second] = [layer.colour(i), layer.colour(i + 1)];
    if (first === second) draw(i, 0, 1, first);
    else {
      draw(i, 0, 0.5, first);
      draw(i, 0.5, 1, second);
    }
  }
}

/** Robots that exist. */
export class RobotLayer extends Layer {
  /** Which robot each entry is. */
  readonly agents: number[] = [];

  constructor() {
    super(ROBOT_STRIDE);
  }

  override clear(): void {
    super.clear();
    this.agents.length = 0;
  }

  add(agent: number, x: number, y: number, heading: number, colour: Packed): void {
    const at = this.reserve(1);
    this.data[at] = x;
    this.data[at + 1] = y;
    this.data[at + 2] = heading;
    this.colours[at + 3] = colour;
    this.agents.push(agent);
  }

  /** Moves all robots. */
  place(x: Float32Array, y: Float32Array, heading: Float32Array): void {
    const { data, agents } = this;
    for (let i = 0, at = 0; i < agents.length; i++, at += ROBOT_STRIDE) {
      const agent = agents[i];
      data[at] = x[agent];
      data[at + 1] = y[agent];
      data[at + 2] = heading.length > 0 ? heading[agent] : 0;
    }
    this.version++;
  }
}

/** Filled triangles. */
export class FillLayer extends Layer {
  constructor() {
    super(FILL_STRIDE);
  }

  corner(x: number, y: number, colour: Packed): void {
    const at = this.reserve(1);
    this.data[at] = x;
    this.data[at + 1] = y;
    this.colours[at + 2] = colour;
  }
}

/** Text beside a point of the world. */
export interface Label {
  x: number;
  y: number;
  offsetPx: number;
  text: string;
  colour: string;
}

/** Robots where a neighbour last heard them to be. */
export interface Ghost {
  neighbour: number;
  x: number;
  y: number;
  errorM: number;
  agoNs: number;
  rssiDbm: number;
}

/** All that a painter draws, in drawing order. The buffers are reused from frame to frame. */
export class Picture {
  readonly fills = new FillLayer();
  readonly grid = new LineLayer();
  readonly site = new LineLayer();
  readonly trails = new LineLayer();
  /** From the end of the trails to where robots are between two frames. */
  readonly trailHeads = new LineLayer();
  readonly links = new PairLayer();
  readonly missed = new PairLayer();
  readonly robots = new RobotLayer();
  readonly marks = new LineLayer();
  /** Robots that do not exist any more, at their last position: agent, x, y. */
  readonly dead: number[] = [];
  readonly ghosts: Ghost[] = [];
  readonly siteLabels: Label[] = [];
  readonly labels: Label[] = [];
  robotRadiusPx = 7;
  background = "#ffffff";

  /** Layers below the robots without dashes. */
  readonly solidLines: LineLayer[] = [this.grid, this.site, this.trails, this.trailHeads, this.links];

  /** All layers below the robots. */
  get linesBelow(): LineLayer[] {
    return [...this.solidLines, this.missed];
  }
}

/** Corners of a robot that faces +x, in units of its radius: a dart. */
export const DART = [1.15, 0, -0.85, 0.8, -0.45, 0, -0.85, -0.8] as const;
