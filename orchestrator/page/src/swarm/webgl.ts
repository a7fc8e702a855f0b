import type { Camera } from "../store.ts";
import { pack } from "./colours.ts";
import { DART, type FillLayer, FILL_STRIDE, type LineLayer, LINE_STRIDE, type Picture, type RobotLayer, ROBOT_STRIDE } from "./picture.ts";

/** Draws pictures onto a canvas. */
export interface Painter {
  readonly name: "webgl2" | "canvas2d";
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
layout(location = 0) in vec2 corner;
layout(location = 1) in vec3 pose;
layout(location = 2) in vec4 tint;
uniform float radius;
out vec4 shade;
void main() {
  float c = cos(pose.z), s = sin(pose.z);
  gl_Position = place(pose.xy, radius * vec2(c * corner.x - s * corner.y, s * corner.x + c * corner.y));
  shade = tint;
}`;
const LINE_VERTEX = `${TRANSFORM}
layout(location = 0) in vec2 position;
layout(location = 1) in vec2 offset;
layout(location = 2) in float along;
layout(location = 3) in vec4 tint;
out vec4 shade;
out float metres;
void main() { gl_Position = place(position, offset); shade = tint; metres = along; }`;
const LINE_FRAGMENT = `#version 300 es
precision mediump float;
in vec4 shade;
in highp float metres;
uniform highp float dashesPerMetre;
out vec4 colour;
void main() {
  if (metres >= 0.0 && fract(metres * dashesPerMetre) > 0.55) discard;
  colour = shade;
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

/** Three programs and one buffer per layer; a layer is uploaded only when its version has changed. */
export class WebGlPainter implements Painter {
  readonly name = "webgl2";
  private readonly fill: WebGLProgram;
  private readonly line: WebGLProgram;
  private readonly robot: WebGLProgram;
  private readonly uniforms = new Map<WebGLProgram, Map<string, WebGLUniformLocation | null>>();
  private readonly buffers = new Map<object, Buffered>();

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.fill = this.program(FILL_VERTEX, PLAIN_FRAGMENT);
    this.line = this.program(LINE_VERTEX, LINE_FRAGMENT);
    this.robot = this.program(ROBOT_VERTEX, PLAIN_FRAGMENT);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  paint(picture: Picture, camera: Camera, width: number, height: number, ratio: number): void {
    const gl = this.gl;
    gl.viewport(0, 0, Math.round(width * ratio), Math.round(height * ratio));
    const back = pack(picture.background);
    gl.clearColor((back & 255) / 255, ((back >> 8) & 255) / 255, ((back >> 16) & 255) / 255, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    for (const program of [this.fill, this.line, this.robot]) {
      gl.useProgram(program);
      gl.uniform2f(this.uniform(program, "centre"), camera.x, camera.y);
      gl.uniform2f(this.uniform(program, "perMetre"), (2 * camera.scale) / width, (2 * camera.scale) / height);
      gl.uniform2f(this.uniform(program, "perPixel"), 2 / width, 2 / height);
    }
    gl.useProgram(this.fill);
    this.draw(picture.fills);
    gl.useProgram(this.line);
    gl.uniform1f(this.uniform(this.line, "dashesPerMetre"), camera.scale / DASH_PX);
    for (const layer of picture.linesBelow) this.draw(layer);
    gl.useProgram(this.robot);
    gl.uniform1f(this.uniform(this.robot, "radius"), picture.robotRadiusPx);
    this.drawRobots(picture.robots);
    gl.useProgram(this.line);
    this.draw(picture.marks);
  }

  private draw(layer: FillLayer | LineLayer): void {
    if (layer.count === 0) return;
    const gl = this.gl;
    const lines = !("corner" in layer);
    this.upload(layer, lines ? LINE_STRIDE : FILL_STRIDE, lines
      ? [{ size: 2, offset: 0 }, { size: 2, offset: 2 }, { size: 1, offset: 4 }, { size: 4, offset: 5, colour: true }]
      : [{ size: 2, offset: 0 }, { size: 4, offset: 2, colour: true }], 0);
    gl.drawArrays(lines ? gl.LINES : gl.TRIANGLES, 0, layer.count);
  }

  private drawRobots(layer: RobotLayer): void {
    if (layer.count === 0) return;
    const gl = this.gl;
    this.upload(layer, ROBOT_STRIDE, [{ size: 3, offset: 0 }, { size: 4, offset: 3, colour: true }], 1);
    gl.drawArraysInstanced(gl.TRIANGLE_FAN, 0, DART.length / 2, layer.count);
  }

  /** Binds a layer's vertex array, after uploading the layer if it has changed. */
  private upload(layer: FillLayer | LineLayer | RobotLayer, stride: number, attributes: Attribute[], firstLocation: number): void {
    const gl = this.gl;
    let known = this.buffers.get(layer);
    if (known === undefined) {
      known = { buffer: gl.createBuffer() as WebGLBuffer, array: gl.createVertexArray() as WebGLVertexArrayObject, version: -1, capacity: 0 };
      this.buffers.set(layer, known);
      gl.bindVertexArray(known.array);
      if (firstLocation === 1) this.bindDart();
      gl.bindBuffer(gl.ARRAY_BUFFER, known.buffer);
      attributes.forEach(({ size, offset, colour }, i) => {
        const location = firstLocation + i;
        gl.enableVertexAttribArray(location);
        gl.vertexAttribPointer(location, size, colour === true ? gl.UNSIGNED_BYTE : gl.FLOAT, colour === true, stride * 4, offset * 4);
        if (firstLocation === 1) gl.vertexAttribDivisor(location, 1);
      });
    }
    gl.bindVertexArray(known.array);
    if (known.version === layer.version) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, known.buffer);
    if (known.capacity < layer.data.byteLength) {
      gl.bufferData(gl.ARRAY_BUFFER, layer.data.byteLength, gl.DYNAMIC_DRAW);
      known.capacity = layer.data.byteLength;
    }
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, layer.data, 0, layer.count * stride);
    known.version = layer.version;
  }

  private bindDart(): void {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    // The dart is concave at its tail: a fan around that corner covers it.
    const fan = [...DART.slice(4, 8), ...DART.slice(0, 4)];
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(fan), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
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

/** A painter by WebGL2; null where the browser has none. */
export function webGlPainter(canvas: HTMLCanvasElement): Painter | null {
  software ??= rendersInSoftware();
  const gl = canvas.getContext("webgl2", { antialias: !software, alpha: false, depth: false, stencil: false, powerPreference: "high-performance" });
  return gl === null ? null : new WebGlPainter(gl);
}
