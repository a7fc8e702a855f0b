import type { MeasuredRows } from "../gen/murmuration/view/v1/view_pb.ts";
import { neutral, OKABE_ITO, pack, type Packed, type Theme } from "../swarm/colours.ts";
import type { Picture } from "../swarm/picture.ts";

/** With more lines than this, places are drawn instead of them. */
const MOST_LINES = 3000;
/** Places along the longer side of the map. */
const PLACES = 24;

/** What classes of mean residuals are called, from far below the prediction to far above it. */
export const CLASSES = ["much less than predicted", "less", "as predicted", "more", "much more than predicted"];

/** The class of a mean residual: within a third of the noise as predicted, beyond the noise far from it. */
export function residualClass(mean: number, noise: number): number {
  const share = mean / noise;
  if (share < -1) return 0;
  if (share < -1 / 3) return 1;
  if (share <= 1 / 3) return 2;
  return share <= 1 ? 3 : 4;
}

export function classColours(theme: Theme): Packed[] {
  return [theme.dark ? "#2f7fe0" : OKABE_ITO.blue, theme.dark ? "#a6dbf7" : OKABE_ITO.sky, neutral(theme.dark), OKABE_ITO.orange, OKABE_ITO.vermilion].map((colour) => pack(colour, 0.9));
}

/** A line between two places with the mean residual of its rows. */
export interface MeasuredLine {
  from: number;
  to: number;
  ends: [number, number, number, number];
  count: number;
  mean: number;
}

/** A square of the map with the mean residual of the rows that have an end in it. */
export interface MeasuredPlace {
  x: number;
  y: number;
  count: number;
  mean: number;
}

/** Means by the place of rows: lines where there are few, else places. Rows without a place or a residual are left out. */
export function residualMap(data: MeasuredRows, rows: Iterable<number>, residual: ArrayLike<number>): { lines: MeasuredLine[]; places: MeasuredPlace[] } {
  const lines = new Map<string, MeasuredLine>();
  const used: number[] = [];
  for (const row of rows) {
    const ends: [number, number, number, number] = [data.fromXM[row], data.fromYM[row], data.toXM[row], data.toYM[row]];
    if (!Number.isFinite(residual[row]) || !ends.every(Number.isFinite)) continue;
    used.push(row);
    const [from, to] = [data.from[row], data.to[row]];
    // Both directions between two places are one line.
    const key = from <= to ? `${from} ${to} ${ends.join()}` : `${to} ${from} ${ends[2]},${ends[3]},${ends[0]},${ends[1]}`;
    let line = lines.get(key);
    if (line === undefined) lines.set(key, (line = { from: Math.min(from, to), to: Math.max(from, to), ends, count: 0, mean: 0 }));
    line.count++;
    line.mean += (residual[row] - line.mean) / line.count;
  }
  if (lines.size <= MOST_LINES) return { lines: [...lines.values()], places: [] };
  return { lines: [], places: places(data, used, residual) };
}

function places(data: MeasuredRows, rows: number[], residual: ArrayLike<number>): MeasuredPlace[] {
  let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
  const eachEnd = (visit: (x: number, y: number, row: number) => void): void => {
    for (const row of rows) {
      visit(data.fromXM[row], data.fromYM[row], row);
      visit(data.toXM[row], data.toYM[row], row);
    }
  };
  eachEnd((x, y) => {
    [x0, x1, y0, y1] = [Math.min(x0, x), Math.max(x1, x), Math.min(y0, y), Math.max(y1, y)];
  });
  const side = Math.max(x1 - x0, y1 - y0) / PLACES || 1;
  const found = new Map<string, MeasuredPlace>();
  eachEnd((x, y, row) => {
    const [column, line] = [Math.floor((x - x0) / side), Math.floor((y - y0) / side)];
    const key = `${column} ${line}`;
    let place = found.get(key);
    if (place === undefined) found.set(key, (place = { x: x0 + (column + 0.5) * side, y: y0 + (line + 0.5) * side, count: 0, mean: 0 }));
    place.count++;
    place.mean += (residual[row] - place.mean) / place.count;
  });
  return [...found.values()];
}

/** Draws the residuals in place of a run's links. */
export function drawResiduals(picture: Picture, map: { lines: MeasuredLine[]; places: MeasuredPlace[] }, noise: number, theme: Theme): void {
  const colours = classColours(theme);
  picture.links.clear();
  // Large residuals lie over small ones.
  const bySize = <T extends { mean: number }>(all: T[]): T[] => [...all].sort((a, b) => Math.abs(a.mean) - Math.abs(b.mean));
  for (const { ends, mean } of bySize(map.lines)) picture.links.segment(...ends, colours[residualClass(mean, noise)]);
  for (const { x, y, mean } of bySize(map.places)) {
    for (const radius of [1, 2, 3, 4, 5]) picture.links.ring(x, y, radius, colours[residualClass(mean, noise)], 10);
  }
}
