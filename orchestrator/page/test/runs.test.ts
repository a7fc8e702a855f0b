import assert from "node:assert/strict";
import { test } from "node:test";
import type { About, Row } from "../src/runs/calls.ts";
import { fragmentOf, INITIAL, parseChoices } from "../src/runs/choices.ts";
import { columnsOf, shortKey, sorted, withUnit } from "../src/runs/columns.ts";
import { parseFilter } from "../src/runs/filter.ts";

const about: About = {
  folder: "runs", program: "murmuration", series: [],
  figures: [{ name: "pdr", label: "packet delivery ratio", unit: "%", better: "higher" }, { name: "latency", label: "latency", unit: "s", better: "lower" }],
};

function row(id: number, name: string, more: Partial<Row> = {}): Row {
  return {
    id, name, kind: "run", status: "complete", words: null, when_unix_s: id, seed: 1, simulated_s: 1, first: null, figures: {}, n_warnings: 0, spark: [],
    spark_words: null, has_series: true, has_recording: true, report: null, progress: null, settings: {}, ...more,
  };
}

const rows = [
  row(1, "walk-2", { figures: { pdr: 0.5 }, settings: { "netsim.phy.radius_m": 8, "a.kind": "x" } }),
  row(2, "walk-10", { figures: { pdr: 0.95 }, settings: { "netsim.phy.radius_m": 12, "b.kind": "x" } }),
  row(3, "lost one", { status: "failed", words: "no robots left", settings: { "netsim.phy.radius_m": 12 } }),
];
const { all: columns, optional } = columnsOf(about, rows);

function passing(text: string): number[] {
  return rows.filter(parseFilter(text, columns).test).map(({ id }) => id);
}

test("a filter has words and conditions, and all must hold", () => {
  assert.deepEqual(passing(""), [1, 2, 3]);
  assert.deepEqual(passing("WALK"), [1, 2]);
  assert.deepEqual(passing("radius_m=12"), [2, 3]);
  assert.deepEqual(passing("netsim.phy.radius_m=12.0 walk"), [2]);
  assert.deepEqual(passing("radius_m<12"), [1]);
  assert.deepEqual(passing("radius_m<=12"), [1, 2, 3]);
  assert.deepEqual(passing("pdr>90%"), [2]);
  assert.deepEqual(passing("pdr>=0.5"), [1, 2]);
  assert.deepEqual(passing("status!=complete"), [3]);
  assert.deepEqual(passing('name="lost one"'), [3]);
  assert.deepEqual(passing('"robots left"'), [3]);
  assert.deepEqual(passing("kind=run pdr!=0.5"), [2, 3]);
});

test("a filter that cannot be read says what is wrong", () => {
  assert.equal(parseFilter("radius=8", columns).problem, "There is no column radius (nearest: netsim.phy.radius_m).");
  assert.deepEqual(passing("radius=8"), []);
  assert.match(parseFilter("pdr<many", columns).problem, /needs a number/);
  assert.match(parseFilter("pdr=", columns).problem, /needs a value/);
  // While someone types a value, the rows stay.
  assert.deepEqual(passing("pdr="), [1, 2, 3]);
});

test("rows are sorted by a column, those without a value last", () => {
  const by = (key: string, order: "ascending" | "descending"): number[] => {
    const column = columns.find((column) => column.key === key);
    assert.ok(column !== undefined);
    return sorted(rows, column, order).map(({ id }) => id);
  };
  assert.deepEqual(by("name", "ascending"), [3, 1, 2]);
  assert.deepEqual(by("pdr", "descending"), [2, 1, 3]);
  assert.deepEqual(by("pdr", "ascending"), [1, 2, 3]);
  assert.deepEqual(by("netsim.phy.radius_m", "descending"), [3, 2, 1]);
});

test("columns are those that rows have, with the shortest names that differ", () => {
  assert.deepEqual([...optional.keys()], ["pdr", "a.kind", "b.kind", "netsim.phy.radius_m"]);
  const keys = [...optional.keys()];
  assert.equal(shortKey("netsim.phy.radius_m", keys), "radius_m");
  assert.equal(shortKey("a.kind", keys), "a.kind");
  assert.equal(withUnit(0.12345, "%"), "12.35 %");
  assert.equal(withUnit(1.5, "m/s"), "1.5 m/s");
});

test("the address restores what it captured", () => {
  const choices = {
    ...INITIAL, filter: 'radius_m=8 "a b"', sort: "pdr", order: "ascending" as const, series: "spread", selected: ["a/b", "c&d"],
    shown: { pdr: false, latency: true }, theme: "dark" as const,
  };
  assert.deepEqual(parseChoices(`#${fragmentOf(choices)}`), choices);
  assert.deepEqual(parseChoices(""), INITIAL);
  assert.equal(fragmentOf(INITIAL), "");
});
