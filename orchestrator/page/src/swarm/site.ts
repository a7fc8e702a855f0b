import { type MovedObstacle } from "../gen/cosim/v1/common_pb.ts";
import { type Ground, ObstacleKind, type Place } from "../gen/murmuration/view/v1/view_pb.ts";
import { css, mix, type Packed, pack, type Theme } from "./colours.ts";
import type { FillLayer, LineLayer, Picture } from "./picture.ts";
import { triangulate } from "./triangulate.ts";

/** Ground is drawn with at most so many rectangles a side. */
const GROUND_CELLS = 128;

/** Fills in the layers of what stands still: ground, foliage, obstacles, walls. */
export function drawSite(picture: Picture, place: Place | undefined, moved: MovedObstacle[], theme: Theme): void {
  picture.fills.clear();
  picture.site.clear();
  picture.siteLabels.length = 0;
  if (place === undefined) return;
  if (place.ground !== undefined) drawGround(picture.fills, place.ground, theme);
  for (const polygon of place.foliage) {
    for (const i of triangulate(polygon.xM, polygon.yM)) picture.fills.corner(polygon.xM[i], polygon.yM[i], theme.foliage);
  }
  for (const obstacle of place.obstacles) {
    const at = moved.find((m) => m.name !== "" && m.name === obstacle.name);
    const x = at?.xM ?? obstacle.xM;
    const y = at?.yM ?? obstacle.yM;
    let colour = theme.obstacle;
    let text = obstacle.name;
    if (obstacle.kind === ObstacleKind.HIDDEN) {
      colour = theme.hidden;
      text = `${obstacle.name} hidden`.trim();
    } else if (obstacle.kind === ObstacleKind.ESTIMATED) {
      colour = theme.estimated;
      text = `${obstacle.name} estimated`.trim();
    } else {
      disc(picture.fills, x, y, obstacle.radiusM, theme.obstacleFill);
    }
    const dashed = obstacle.kind !== ObstacleKind.UNSPECIFIED;
    // Estimated ones are dotted: more corners give shorter dashes.
    const corners = obstacle.kind === ObstacleKind.ESTIMATED ? 120 : 48;
    picture.site.circle(x, y, obstacle.radiusM, colour, dashed, corners);
    // Estimated obstacles lie over the hidden ones that they estimate: their labels must not.
    const labelY = obstacle.kind === ObstacleKind.ESTIMATED ? y + obstacle.radiusM * 0.5 : y;
    if (text !== "") picture.siteLabels.push({ x, y: labelY, offsetPx: 0, text, colour: css(colour) });
  }
  for (const wall of place.walls) {
    const { fromXM, fromYM, toXM, toYM } = wall;
    if (wall.kind === ObstacleKind.UNSPECIFIED) {
      picture.site.segment(fromXM, fromYM, toXM, toYM, theme.wall);
      thicken(picture.fills, fromXM, fromYM, toXM, toYM, theme.wall);
      continue;
    }
    const isEstimate = wall.kind === ObstacleKind.ESTIMATED;
    const colour = isEstimate ? theme.estimated : theme.hidden;
    dashes(picture.site, fromXM, fromYM, toXM, toYM, isEstimate ? 41 : 15, colour);
    const share = isEstimate ? 0.3 : 0.7;
    const text = `${wall.name} ${isEstimate ? "estimated" : "hidden"}`.trim();
    picture.siteLabels.push({ x: fromXM + share * (toXM - fromXM), y: fromYM + share * (toYM - fromYM), offsetPx: 6, text, colour: css(colour) });
  }
}

/** A line of dashes, with gaps as long as they are. */
function dashes(lines: LineLayer, x0: number, y0: number, x1: number, y1: number, parts: number, colour: Packed): void {
  const at = (from: number, to: number, i: number): number => from + ((to - from) * i) / parts;
  for (let i = 0; i < parts; i += 2) lines.segment(at(x0, x1, i), at(y0, y1, i), at(x0, x1, i + 1), at(y0, y1, i + 1), colour);
}

function disc(fills: FillLayer, x: number, y: number, radius: number, colour: Packed): void {
  const corners = 32;
  for (let i = 0; i < corners; i++) {
    const a = (2 * Math.PI * i) / corners;
    const b = (2 * Math.PI * (i + 1)) / corners;
    fills.corner(x, y, colour);
    fills.corner(x + radius * Math.cos(a), y + radius * Math.sin(a), colour);
    fills.corner(x + radius * Math.cos(b), y + radius * Math.sin(b), colour);
  }
}

/** Walls are 0.2 m wide in the picture, so that they stand out from links. */
function thicken(fills: FillLayer, x0: number, y0: number, x1: number, y1: number, colour: Packed): void {
  const length = Math.hypot(x1 - x0, y1 - y0) || 1;
  const nx = (-(y1 - y0) / length) * 0.1;
  const ny = ((x1 - x0) / length) * 0.1;
  quad(fills, [x0 - nx, y0 - ny, x1 - nx, y1 - ny, x1 + nx, y1 + ny, x0 + nx, y0 + ny], [colour, colour, colour, colour]);
}

function quad(fills: FillLayer, xy: number[], colours: Packed[]): void {
  for (const corner of [0, 1, 2, 0, 2, 3]) fills.corner(xy[2 * corner], xy[2 * corner + 1], colours[corner]);
}

/** Shades heights: low ground like the background, high ground darker (lighter in the dark theme). */
function drawGround(fills: FillLayer, ground: Ground, theme: Theme): void {
  const columns = ground.columns;
  const rows = columns > 0 ? Math.floor(ground.heightM.length / columns) : 0;
  if (columns < 2 || rows < 2) return;
  const { least, most } = groundRange(ground);
  const low = pack(theme.dark ? "#1b2126" : "#fbfaf6");
  const high = pack(theme.dark ? "#3d392f" : "#e0d6bd");
  const every = Math.max(1, Math.ceil(Math.max(columns, rows) / GROUND_CELLS));
  const colour = (c: number, r: number): Packed => mix(low, high, most > least ? (ground.heightM[r * columns + c] - least) / (most - least) : 0);
  for (let r = 0; r < rows - 1; r += every) {
    const r1 = Math.min(rows - 1, r + every);
    for (let c = 0; c < columns - 1; c += every) {
      const c1 = Math.min(columns - 1, c + every);
      const x0 = ground.xM + c * ground.dxM;
      const x1 = ground.xM + c1 * ground.dxM;
      const y0 = ground.yM + r * ground.dyM;
      const y1 = ground.yM + r1 * ground.dyM;
      quad(fills, [x0, y0, x1, y0, x1, y1, x0, y1], [colour(c, r), colour(c1, r), colour(c1, r1), colour(c, r1)]);
    }
  }
}

/** Least and greatest height (m). */
export function groundRange(ground: Ground): { least: number; most: number } {
  let least = Number.POSITIVE_INFINITY;
  let most = Number.NEGATIVE_INFINITY;
  for (const height of ground.heightM) {
    if (height < least) least = height;
    if (height > most) most = height;
  }
  return { least, most };
}
