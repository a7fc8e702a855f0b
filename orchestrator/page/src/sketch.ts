/** A drawing of few shapes in CSS pixels, which a canvas and an SVG document show alike. */
export type Shape =
  | { kind: "rect"; x: number; y: number; w: number; h: number; fill?: string; stroke?: string; dash?: number[]; width?: number }
  | { kind: "line"; x1: number; y1: number; x2: number; y2: number; stroke: string; width?: number; dash?: number[] }
  | { kind: "path"; points: number[]; stroke?: string; fill?: string; width?: number; dash?: number[] }
  | { kind: "circle"; x: number; y: number; r: number; fill?: string; stroke?: string; width?: number; dash?: number[] }
  | {
      kind: "text"; x: number; y: number; text: string; fill: string; size?: number; anchor?: "start" | "middle" | "end";
      halo?: string; bold?: boolean; turned?: boolean;
    };

const FONT = "system-ui, sans-serif";

function strokeAndFill(context: CanvasRenderingContext2D, shape: { fill?: string; stroke?: string; width?: number; dash?: number[] }): void {
  if (shape.fill !== undefined) {
    context.fillStyle = shape.fill;
    context.fill();
  }
  if (shape.stroke !== undefined) {
    context.strokeStyle = shape.stroke;
    context.lineWidth = shape.width ?? 1;
    context.setLineDash(shape.dash ?? []);
    context.stroke();
  }
}

/** Draws shapes onto a canvas. Text is centred vertically on its y. */
export function paintShapes(context: CanvasRenderingContext2D, shapes: Shape[]): void {
  context.lineJoin = "round";
  for (const shape of shapes) {
    if (shape.kind === "text") {
      context.save();
      context.translate(shape.x, shape.y);
      if (shape.turned === true) context.rotate(-Math.PI / 2);
      context.font = `${shape.bold === true ? "600 " : ""}${shape.size ?? 12}px ${FONT}`;
      context.textAlign = shape.anchor === "middle" ? "center" : (shape.anchor ?? "start");
      context.textBaseline = "middle";
      if (shape.halo !== undefined) {
        context.strokeStyle = shape.halo;
        context.lineWidth = 3;
        context.setLineDash([]);
        context.strokeText(shape.text, 0, 0);
      }
      context.fillStyle = shape.fill;
      context.fillText(shape.text, 0, 0);
      context.restore();
      continue;
    }
    context.beginPath();
    if (shape.kind === "rect") context.rect(shape.x, shape.y, shape.w, shape.h);
    else if (shape.kind === "circle") context.arc(shape.x, shape.y, shape.r, 0, 2 * Math.PI);
    else if (shape.kind === "line") {
      context.moveTo(shape.x1, shape.y1);
      context.lineTo(shape.x2, shape.y2);
    } else {
      for (let i = 0; i < shape.points.length; i += 2) context.lineTo(shape.points[i], shape.points[i + 1]);
    }
    strokeAndFill(context, shape);
  }
}

/** Escapes text for XML. */
export function escapeXml(text: string): string {
  return text.replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c] as string);
}

const round = (value: number): string => String(Math.round(value * 100) / 100);

/** The same shapes as elements of an SVG document. */
export function shapesToSvg(shapes: Shape[]): string {
  const parts: string[] = [];
  for (const shape of shapes) {
    if (shape.kind === "text") {
      const halo = shape.halo === undefined ? "" : ` stroke="${shape.halo}" stroke-width="3" paint-order="stroke" stroke-linejoin="round"`;
      const turn = shape.turned === true ? ` transform="rotate(-90 ${round(shape.x)} ${round(shape.y)})"` : "";
      parts.push(
        `<text x="${round(shape.x)}" y="${round(shape.y)}" font-size="${shape.size ?? 12}" fill="${shape.fill}" dominant-baseline="central" ` +
          `text-anchor="${shape.anchor ?? "start"}"${shape.bold === true ? ' font-weight="600"' : ""}${halo}${turn}>${escapeXml(shape.text)}</text>`,
      );
      continue;
    }
    const fill = "fill" in shape && shape.fill !== undefined ? shape.fill : "none";
    const dash = shape.dash === undefined ? "" : ` stroke-dasharray="${shape.dash.join(" ")}"`;
    const paint = `fill="${fill}" stroke="${shape.stroke ?? "none"}" stroke-width="${shape.width ?? 1}"${dash}`;
    if (shape.kind === "rect") {
      parts.push(`<rect x="${round(shape.x)}" y="${round(shape.y)}" width="${round(shape.w)}" height="${round(shape.h)}" ${paint}/>`);
    } else if (shape.kind === "circle") {
      parts.push(`<circle cx="${round(shape.x)}" cy="${round(shape.y)}" r="${round(shape.r)}" ${paint}/>`);
    } else if (shape.kind === "line") {
      parts.push(`<line x1="${round(shape.x1)}" y1="${round(shape.y1)}" x2="${round(shape.x2)}" y2="${round(shape.y2)}" ${paint}/>`);
    } else {
      const points: string[] = [];
      for (let i = 0; i < shape.points.length; i += 2) points.push(`${round(shape.points[i])},${round(shape.points[i + 1])}`);
      parts.push(`<polyline points="${points.join(" ")}" ${paint}/>`);
    }
  }
  return parts.join("\n");
}

/** A whole SVG document. */
export function svgDocument(width: number, height: number, background: string, content: string): string {
  return (
    `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}" font-family="${FONT}">\n` +
    `<rect width="100%" height="100%" fill="${background}"/>\n${content}\n</svg>\n`
  );
}

/** Sizes a canvas for the screen's pixel ratio and returns its context, scaled to CSS pixels and cleared. */
export function sizedContext(canvas: HTMLCanvasElement, width: number, height: number): CanvasRenderingContext2D {
  const ratio = window.devicePixelRatio || 1;
  const w = Math.max(1, Math.round(width * ratio));
  const h = Math.max(1, Math.round(height * ratio));
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
  }
  const context = canvas.getContext("2d") as CanvasRenderingContext2D;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}
