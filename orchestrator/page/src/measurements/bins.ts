/** A range of a covariate, and the rows in it. */
export interface Bin {
  /** Bounds of the range. The upper one belongs to the next bin, if there is one; equal bounds: one value. */
  from: number;
  to: number;
  rows: number[];
}

/** Bins of a curve. */
const BINS = 12;
/** Half of a 90 % interval of a mean, in standard errors. */
export const HALF_90 = 1.645;

/**
 * Bins with about as many rows each, of the rows that have a value and a residual; a bin for each value where these are few, none where
 * the values do not differ.
 */
export function bins(values: ArrayLike<number>, residual: ArrayLike<number>): Bin[] {
  const known: number[] = [];
  for (let row = 0; row < values.length; row++) if (Number.isFinite(values[row]) && Number.isFinite(residual[row])) known.push(row);
  known.sort((a, b) => values[a] - values[b] || a - b);
  if (known.length === 0) return [];
  const distinct = new Set(known.map((row) => values[row]));
  if (distinct.size <= BINS) {
    return distinct.size < 2 ? [] : [...distinct].map((value) => ({ from: value, to: value, rows: known.filter((row) => values[row] === value) }));
  }
  const edges = new Set<number>();
  for (let k = 0; k <= BINS; k++) edges.add(values[known[Math.round((k * (known.length - 1)) / BINS)]]);
  const ascending = [...edges];
  const found: Bin[] = ascending.slice(1).map((to, k) => ({ from: ascending[k], to, rows: [] }));
  let bin = 0;
  for (const row of known) {
    while (bin + 1 < found.length && values[row] >= found[bin].to) bin++;
    found[bin].rows.push(row);
  }
  return found.filter(({ rows }) => rows.length > 0);
}

/** Mean residual of some rows and half of its 90 % interval, as if rows were independent. Rows without a residual are left out. */
export function meanOf(rows: readonly number[], residual: ArrayLike<number>): { count: number; mean: number; half: number } {
  let [count, sum, squares] = [0, 0, 0];
  for (const row of rows) {
    const value = residual[row];
    if (!Number.isFinite(value)) continue;
    count++;
    sum += value;
    squares += value * value;
  }
  const mean = sum / count;
  const variance = count > 1 ? Math.max(0, (squares - count * mean * mean) / (count - 1)) : Number.NaN;
  return { count, mean, half: HALF_90 * Math.sqrt(variance / count) };
}
