import { EventKind } from "./gen/murmuration/view/v1/view_pb.ts";
import { OKABE_ITO } from "./swarm/colours.ts";

/** How events of a kind are shown. */
export interface EventStyle {
  label: string;
  colour: string;
  /** Marks differ in shape as well as in colour. */
  shape: "circle" | "cross" | "diamond" | "square" | "up" | "down" | "bar";
  /** Rare and important: drawn in the upper row of the timeline. */
  major: boolean;
}

const OTHER: EventStyle = { label: "other", colour: "#8b949e", shape: "circle", major: false };

export const EVENT_STYLES = new Map<EventKind, EventStyle>([
  [EventKind.ORDER, { label: "order", colour: OKABE_ITO.blue, shape: "diamond", major: true }],
  [EventKind.DEATH, { label: "lost", colour: OKABE_ITO.vermilion, shape: "cross", major: true }],
  [EventKind.BIRTH, { label: "added", colour: OKABE_ITO.green, shape: "square", major: true }],
  [EventKind.JOIN, { label: "joined", colour: OKABE_ITO.green, shape: "up", major: false }],
  [EventKind.LEAVE, { label: "left", colour: OKABE_ITO.vermilion, shape: "down", major: false }],
  [EventKind.PARENT, { label: "parent", colour: OKABE_ITO.purple, shape: "bar", major: false }],
  [EventKind.FORMED, { label: "formed", colour: OKABE_ITO.green, shape: "diamond", major: true }],
  [EventKind.TASK, { label: "task done", colour: OKABE_ITO.sky, shape: "square", major: true }],
  [EventKind.ISOLATED, { label: "isolated", colour: OKABE_ITO.orange, shape: "down", major: false }],
  [EventKind.REACHED, { label: "reached", colour: OKABE_ITO.sky, shape: "up", major: false }],
]);

export function eventStyle(kind: EventKind): EventStyle {
  return EVENT_STYLES.get(kind) ?? OTHER;
}

/** Draws the mark of an event about a point. */
export function drawEventMark(context: CanvasRenderingContext2D, style: EventStyle, x: number, y: number, r: number): void {
  context.fillStyle = style.colour;
  context.strokeStyle = style.colour;
  context.lineWidth = 2;
  context.beginPath();
  switch (style.shape) {
    case "circle": context.arc(x, y, r * 0.8, 0, 2 * Math.PI); break;
    case "square": context.rect(x - r * 0.8, y - r * 0.8, r * 1.6, r * 1.6); break;
    case "bar": context.rect(x - 1, y - r, 2, 2 * r); break;
    case "diamond":
      context.moveTo(x, y - r);
      context.lineTo(x + r, y);
      context.lineTo(x, y + r);
      context.lineTo(x - r, y);
      break;
    case "up":
    case "down": {
      const s = style.shape === "up" ? -1 : 1;
      context.moveTo(x, y + s * r);
      context.lineTo(x + r, y - s * r * 0.8);
      context.lineTo(x - r, y - s * r * 0.8);
      break;
    }
    case "cross":
      context.moveTo(x - r, y - r);
      context.lineTo(x + r, y + r);
      context.moveTo(x - r, y + r);
      context.lineTo(x + r, y - r);
      context.stroke();
      return;
  }
  context.fill();
}
