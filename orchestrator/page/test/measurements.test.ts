import { create } from "@bufbuild/protobuf";
import assert from "node:assert/strict";
import { test } from "node:test";
import { MeasuredRowsSchema, MeasurementsSchema } from "../src/gen/murmuration/view/v1/view_pb.ts";
import { bins, meanOf } from "../src/measurements/bins.ts";
import { residualClass, residualMap } from "../src/measurements/map.ts";
import { ShownRows } from "../src/measurements/shown.ts";
import { INITIAL } from "../src/store.ts";

test("bins hold every row with a value and a residual once, in ranges that follow each other", () => {
  const values = Array.from({ length: 240 }, (_, i) => (i % 7 === 3 ? Number.NaN : (i * 37) % 50));
  const residual = values.map((_, i) => (i % 11 === 5 ? Number.NaN : 1));
  const found = bins(values, residual);
  const rows = found.flatMap((bin) => bin.rows);
  const known = values.map((_, i) => i).filter((i) => Number.isFinite(values[i]) && Number.isFinite(residual[i]));
  assert.deepEqual([...rows].sort((a, b) => a - b), known);
  found.forEach((bin, i) => {
    if (i > 0) assert.equal(bin.from, found[i - 1].to);
    const last = i === found.length - 1;
    for (const row of bin.rows) assert.ok(values[row] >= bin.from && (values[row] < bin.to || (last && values[row] === bin.to)));
  });
  assert.deepEqual(bins([3, 3, 3], [1, 2, 3]), []);
});

test("the interval of a mean is 1.645 standard errors to each side", () => {
  const { count, mean, half } = meanOf([0, 1, 2, 3], [1, 3, Number.NaN, 5]);
  assert.equal(count, 3);
  assert.equal(mean, 3);
  assert.ok(Math.abs(half - 1.645 * Math.sqrt(4 / 3)) < 1e-12);
});

const ROWS = create(MeasuredRowsSchema, {
  from: [1, 2, 1, 3], to: [2, 1, 3, 1],
  fromXM: [0, 10, 0, Number.NaN], fromYM: [0, 0, 0, 5], toXM: [10, 0, 0, 0], toYM: [0, 0, 5, 0],
  residual: [-4, -2, 1, 9], residualWithEffects: [0, 0, 1, 9], noise: 2,
  covariates: [{ name: "height_m", value: [1, 1, 2, 2], explained: 0.5 }, { name: "time_s", value: [1, 2, 3, 4], explained: 0.001 }],
});

test("both directions of a link are one line, and rows without a place are left out", () => {
  const { lines, places } = residualMap(ROWS, [0, 1, 2, 3], ROWS.residual);
  assert.deepEqual(places, []);
  assert.deepEqual(lines.map(({ from, to, count, mean }) => [from, to, count, mean]), [[1, 2, 2, -3], [1, 3, 1, 1]]);
});

test("a chosen bin shows its rows alone; a bin that does not exist shows all", () => {
  const shown = new ShownRows(create(MeasurementsSchema, { rows: ROWS }));
  assert.deepEqual(shown.curves.map(({ name }) => name), ["height_m"]);
  const lines = (bin: string | null, withEffects = false): number[] => shown.map({ ...INITIAL, bin, withEffects }).lines.map(({ mean }) => mean);
  assert.deepEqual(lines(null), [-3, 1]);
  assert.deepEqual(lines("height_m:0"), [-3]);
  assert.deepEqual(lines("height_m:0", true), [0]);
  assert.deepEqual(lines("height_m:77"), [-3, 1]);
  assert.deepEqual(lines("nothing:0"), [-3, 1]);
});

test("a residual is strong beyond the noise of the model", () => {
  assert.deepEqual([-5, -1, 0.6, 1.9, 2.1].map((mean) => residualClass(mean, 2)), [0, 1, 2, 3, 4]);
});
