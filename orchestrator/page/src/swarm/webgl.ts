import type { Camera } from "../store.ts";
import { pack } from "./colours.ts";
import { cornerIndices, DART_STRIDE, DartCorners, LineCorners } from "./corners.ts";
import { type FillLayer, FILL_STRIDE, type LineLayer, LINE_STRIDE, type Picture, type RobotLayer } from "./picture.ts";

/** Draws pictures onto a canvas. */
export interface Painter {
  readonly name: "webgl2" | "canvas2d" | "raster";
  paint(picture: Picture, camera: Camera, width: number, height: number, ratio: number): void;
}

const TRANSFORM = `#version 300 es
precision highp float;
uniform vec2 centre, perMetre, perPixel;
vec4 place(vec2 metres, vec2 pixels) { return vec4((metres - centre) * perMetre + pixels * perPixel, 0.0, 1.0); }
`;
const PLAIN_FRAGMENT = `#version 300 es
precision mediump float;
in vec4 shade;
out vec4 colour;
void main() { colour = shade; }`;
const FILL_VERTEX = `${TRANSFORM}
layout(location = 0) in vec2 position;
layout(location = 1) in vec4 tint;
out vec4 shade;
void main() { gl_Position = place(position, vec2(0.0)); shade = tint; }`;
const ROBOT_VERTEX = `${TRANSFORM}
layout(location = 0) in vec2 position;
layout(location = 1) in vec2 corner;
layout(location = 2) in vec4 tint;
uniform float radius;
out vec4 shade;
void main() { gl_Position = place(position, radius * corner); shade = tint; }`;
const LINE_VERTEX = `${TRANSFORM}
layout(location = 0) in vec2 position;
layout(location = 1) in vec2 offset;
layout(location = 2) in float along;
layout(location = 3) in vec4 tint;
out vec4 shade;
out float metres;
void main() { gl_Position = place(position, offset); shade = tint; metres = along; }`;
const DASHED_FRAGMENT = `#version 300 es
precision mediump float;
in vec4 shade;
in highp float metres;
uniform highp float dashesPerMetre;
out vec4 colour;
void main() {
  colour = vec4(shade.rgb, fract(metres * dashesPerMetre) > 0.55 ? 0.0 : shade.a);
}`;
/** Length of a dash and the gap after it (CSS px). */
const DASH_PX = 9;

interface Attribute {
  size: number;
  offset: number;
  colour?: boolean;
}

interface Buffered {
  buffer: WebGLBuffer;
  array: WebGLVertexArrayObject;
  version: number;
  capacity: number;
}

/** Four programs and one buffer per layer; a layer is uploaded only when its version has changed. */
export class WebGlPainter implements Painter {
  readonly name = "webgl2";
  private readonly fill: WebGLProgram;
  private readonly line: WebGLProgram;
  private readonly dashed: WebGLProgram;
  private readonly robot: WebGLProgram;
  private readonly uniforms = new Map<WebGLProgram, Map<string, WebGLUniformLocation | null>>();
  private readonly buffers = new Map<object, Buffered>();
  private readonly dartCorners = new DartCorners();
  private readonly lineCorners = new LineCorners();
  private readonly indices: WebGLBuffer;
  /** Pairs of triangles that the index buffer covers. */
  private indexed = 0;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.fill = this.program(FILL_VERTEX, PLAIN_FRAGMENT);
    this.line = this.program(LINE_VERTEX, PLAIN_FRAGMENT);
    this.dashed = this.program(LINE_VERTEX, DASHED_FRAGMENT);
    this.robot = this.program(ROBOT_VERTEX, PLAIN_FRAGMENT);
    this.indices = gl.createBuffer();
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  paint(picture: Picture, camera: Camera, width: number, height: number, ratio: number): void {
    const gl = this.gl;
    gl.viewport(0, 0, Math.round(width * ratio), Math.round(height * ratio));
    const back = pack(picture.background);
    gl.clearColor((back & 255) / 255, ((back >> 8) & 255) / 255, ((back >> 16) & 255) / 255, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    for (const program of [this.fill, this.line, this.dashed, this.robot]) {
      gl.useProgram(program);
      gl.uniform2f(this.uniform(program, "centre"), camera.x, camera.y);
      gl.uniform2f(this.uniform(program, "perMetre"), (2 * camera.scale) / width, (2 * camera.scale) / height);
      gl.uniform2f(this.uniform(program, "perPixel"), 2 / width, 2 / height);
    }
    gl.useProgram(this.fill);
    this.drawFills(picture.fills);
    gl.useProgram(this.line);
    for (const layer of picture.solidLines) this.drawLines(layer);
    gl.useProgram(this.dashed);
    gl.uniform1f(this.uniform(this.dashed, "dashesPerMetre"), camera.scale / DASH_PX);
    this.drawLines(picture.missed);
    gl.useProgram(this.robot);
    gl.uniform1f(this.uniform(this.robot, "radius"), picture.robotRadiusPx);
    this.drawRobots(picture.robots);
    gl.useProgram(this.line);
    this.drawLines(picture.marks);
  }

  private drawFills(layer: FillLayer): void {
    if (layer.count === 0) return;
    const bound = this.bind(layer, FILL_STRIDE, [{ size: 2, offset: 0 }, { size: 4, offset: 2, colour: true }]);
    if (bound.version !== layer.version) this.upload(bound, layer.data, layer.count * FILL_STRIDE, layer.version);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, layer.count);
  }

  private drawLines(layer: LineLayer): void {
    if (layer.count === 0) return;
    const bound = this.bind(layer, LINE_STRIDE,
      [{ size: 2, offset: 0 }, { size: 2, offset: 2 }, { size: 1, offset: 4 }, { size: 4, offset: 5, colour: true }]);
    if (bound.version !== layer.version) this.upload(bound, this.lineCorners.expand(layer), layer.count * 2 * LINE_STRIDE, layer.version);
    this.drawQuads(layer.count / 2);
  }

  private drawRobots(layer: RobotLayer): void {
    if (layer.count === 0) return;
    const bound = this.bind(layer, DART_STRIDE, [{ size: 2, offset: 0 }, { size: 2, offset: 2 }, { size: 4, offset: 4, colour: true }]);
    if (bound.version !== layer.version) this.upload(bound, this.dartCorners.expand(layer), layer.count * 4 * DART_STRIDE, layer.version);
    this.drawQuads(layer.count);
  }

  private drawQuads(count: number): void {
    const gl = this.gl;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    if (this.indexed < count) {
      this.indexed = Math.max(count, 2 * this.indexed);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, cornerIndices(this.indexed), gl.STATIC_DRAW);
    }
    gl.drawElements(gl.TRIANGLES, count * 6, gl.UNSIGNED_INT, 0);
  }

  /** Binds a layer's vertex array; creates it the first time. */
  private bind(layer: object, stride: number, attributes: Attribute[]): Buffered {
    const gl = this.gl;
    let known = this.buffers.get(layer);
    if (known === undefined) {
      known = { buffer: gl.createBuffer(), array: gl.createVertexArray(), version: -1, capacity: 0 };
      this.buffers.set(layer, known);
      gl.bindVertexArray(known.array);
      gl.bindBuffer(gl.ARRAY_BUFFER, known.buffer);
      attributes.forEach(({ size, offset, colour }, location) => {
        gl.enableVertexAttribArray(location);
        gl.vertexAttribPointer(location, size, colour === true ? gl.UNSIGNED_BYTE : gl.FLOAT, colour === true, stride * 4, offset * 4);
      });
    }
    gl.bindVertexArray(known.array);
    return known;
  }

  private upload(bound: Buffered, data: Float32Array, length: number, version: number): void {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, bound.buffer);
    if (bound.capacity < data.byteLength) {
      gl.bufferData(gl.ARRAY_BUFFER, data.byteLength, gl.DYNAMIC_DRAW);
      bound.capacity = data.byteLength;
    }
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, data, 0, length);
    bound.version = version;
  }

  private uniform(program: WebGLProgram, name: string): WebGLUniformLocation | null {
    let known = this.uniforms.get(program);
    if (known === undefined) this.uniforms.set(program, (known = new Map()));
    let location = known.get(name);
    if (location === undefined) known.set(name, (location = this.gl.getUniformLocation(program, name)));
    return location;
  }

  private program(vertex: string, fragment: string): WebGLProgram {
    const gl = this.gl;
    const program = gl.createProgram() as WebGLProgram;
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(type) as WebGLShader;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? "shader does not link");
    return program;
  }
}

/** Software renderers pay for multisampling with most of their speed. */
function rendersInSoftware(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (probe === null) return true;
  const info = probe.getExtension("WEBGL_debug_renderer_info");
  const renderer = String(probe.getParameter(info === null ? probe.RENDERER : info.UNMASKED_RENDERER_WEBGL));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(renderer);
}

let software: boolean | null = null;

/** Whether WebGL runs on the processor, or there is none. */
export function isSoftware(): boolean {
  return (software ??= rendersInSoftware());
}

/** A painter by WebGL2; null where the browser has none. */
export function webGlPainter(canvas: HTMLCanvasElement): Painter | null {
  const gl = canvas.getContext("webgl2", { antialias: !isSoftware(), alpha: false, depth: false, stencil: false, powerPreference: "high-performance" });
  return gl === null ? null : new WebGlPainter(gl);
}
