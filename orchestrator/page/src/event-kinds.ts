import { EventKind } from "./gen/murmuration/view/v1/view_pb.ts";
import { OKABE_ITO } from "./swarm/colours.ts";

/** How events of a kind are shown. */
export interface EventStyle {
  label: string;
  /** What one of them is called in a count, and several; "" where there is one at most. */
  one: string;
  many: string;
  colour: string;
  /** Marks differ in shape as well as in colour. */
  shape: "circle" | "pair" | "cross" | "diamond" | "square" | "up" | "down" | "bar";
  /** Rare and important: drawn in the upper row of the timeline. */
  major: boolean;
}

const OTHER: EventStyle = { label: "other", one: "other event", many: "other events", colour: "#8b949e", shape: "circle", major: false };

export const EVENT_STYLES = new Map<EventKind, EventStyle>([
  [EventKind.ORDER, { label: "order", one: "order", many: "orders", colour: OKABE_ITO.blue, shape: "diamond", major: true }],
  [EventKind.DEATH, { label: "lost", one: "failure", many: "failures", colour: OKABE_ITO.vermilion, shape: "cross", major: true }],
  [EventKind.BIRTH, { label: "added", one: "addition", many: "additions", colour: OKABE_ITO.green, shape: "square", major: true }],
  [EventKind.JOIN, { label: "joined", one: "join", many: "joins", colour: OKABE_ITO.green, shape: "up", major: false }],
  [EventKind.LEAVE, { label: "left", one: "departure", many: "departures", colour: OKABE_ITO.vermilion, shape: "down", major: false }],
  [EventKind.PARENT, { label: "parent", one: "parent change", many: "parent changes", colour: OKABE_ITO.purple, shape: "bar", major: false }],
  [EventKind.FORMED, { label: "formed", one: "network formed", many: "", colour: OKABE_ITO.green, shape: "diamond", major: true }],
  [EventKind.TASK, { label: "task done", one: "task done", many: "", colour: OKABE_ITO.sky, shape: "square", major: true }],
  [EventKind.ISOLATED, { label: "isolated", one: "isolation", many: "isolations", colour: OKABE_ITO.orange, shape: "down", major: false }],
  [EventKind.REACHED, { label: "reached", one: "end of isolation", many: "ends of isolation", colour: OKABE_ITO.sky, shape: "up", major: false }],
  [EventKind.COLLISION, { label: "collision", one: "collision", many: "collisions", colour: OKABE_ITO.vermilion, shape: "pair", major: false }],
  [EventKind.SITE_COLLISION, { label: "site collision", one: "site collision", many: "site collisions", colour: OKABE_ITO.vermilion, shape: "square", major: false }],
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
    case "pair":
      context.arc(x - r * 0.55, y, r * 0.65, 0, 2 * Math.PI);
      context.arc(x + r * 0.55, y, r * 0.65, 0, 2 * Math.PI);
      break;
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
