import type { Series } from "./gen/murmuration/view/v1/view_pb.ts";

/** A curve over time; null: no value. */
export interface Curve {
  timeS: number[];
  value: (number | null)[];
}

export function curve(series: Series): Curve {
  return { timeS: series.timeS, value: series.value.map((value) => (Number.isNaN(value) ? null : value)) };
}

/** Value of a curve at a time, interpolated between the points around it; null outside of it and beside missing values. */
export function valueAt(of: Curve, timeS: number): number | null {
  const next = lowerBound(of.timeS, timeS);
  if (next >= of.timeS.length) return null;
  const value = of.value[next];
  if (of.timeS[next] === timeS || next === 0) return of.timeS[next] === timeS ? value : null;
  const before = of.value[next - 1];
  if (value === null || before === null) return null;
  return before + ((value - before) * (timeS - of.timeS[next - 1])) / (of.timeS[next] - of.timeS[next - 1]);
}

/** Index of the first entry of an ascending list that is not less than a value. */
export function lowerBound(ascending: number[], value: number): number {
  let low = 0;
  let high = ascending.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (ascending[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** B minus A at the times of A, and its mean over the time that both cover; null if they share none. */
export function difference(a: Curve, b: Curve): { curve: Curve; mean: number | null } {
  let sum = 0;
  let count = 0;
  const value = a.timeS.map((timeS, i) => {
    const other = valueAt(b, timeS);
    const own = a.value[i];
    if (other === null || own === null) return null;
    sum += other - own;
    count++;
    return other - own;
  });
  return { curve: { timeS: a.timeS, value }, mean: count === 0 ? null : sum / count };
}

/** The curves over the union of their times, as uPlot takes them. Curves have gaps (undefined) at times of others. */
export function aligned(curves: Curve[]): { timeS: number[]; values: (number | null | undefined)[][] } {
  if (curves.length === 1) return { timeS: curves[0].timeS, values: [curves[0].value] };
  const timeS = [...new Set(curves.flatMap((c) => c.timeS))].sort((p, q) => p - q);
  const values = curves.map((c) => {
    const column: (number | null | undefined)[] = new Array(timeS.length).fill(undefined);
    let at = 0;
    c.timeS.forEach((t, i) => {
      while (timeS[at] < t) at++;
      column[at] = c.value[i];
    });
    return column;
  });
  return { timeS, values };
}
