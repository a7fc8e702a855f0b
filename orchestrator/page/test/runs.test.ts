import assert from "node:assert/strict";
import { test } from "node:test";
import type { About, Row } from "../src/runs/calls.ts";
import { fragmentOf, INITIAL, parseChoices } from "../src/runs/choices.ts";
import { columnsOf, shortKey, sorted, withUnit } from "../src/runs/columns.ts";
import { parseFilter } from "../src/runs/filter.ts";
import { telling } from "../src/runs/keys.ts";
import { smoothed } from "../src/runs/overlay.ts";

const about: About = {
  folder: "runs", program: "murmuration", series: [],
  figures: [{ name: "pdr", label: "packet delivery ratio", unit: "%", better: "higher" }, { name: "latency", label: "latency", unit: "s", better: "lower" }],
};

function row(id: number, name: string, more: Partial<Row> = {}): Row {
  return {
    id, name, kind: "run", status: "complete", words: null, command: null, path: `runs/${name}`, varied: {}, details: [], when_unix_s: id, seed: 1, simulated_s: 1, first: null, figures: {}, n_warnings: 0, spark: [],
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
  assert.match(parseFilter('name="lost', columns).problem, /quotation mark is not closed/);
  assert.match(parseFilter("when>1", columns).problem, /compared with a date/);
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
  assert.deepEqual([...optional.keys()], ["pdr", "netsim.phy.radius_m", "b.kind", "a.kind"]);
  const keys = [...optional.keys()];
  assert.equal(shortKey("netsim.phy.radius_m", keys), "radius_m");
  assert.equal(shortKey("a.kind", keys), "a.kind");
  assert.equal(withUnit(0.12345, "%"), "12.35 %");
  assert.equal(withUnit(1.5, "m/s"), "1.5 m/s");
});

test("a filter finds the key that is meant, sweeps by what they vary, first figures and dates", () => {
  const first = { name: "leader_speed_ratio", words: "share of the leader's speed", unit: "%", is_greater_better: true, value: 0.94 };
  const some = [
    row(1, "flock", { first, figures: { broadcast_pdr: 0.9 }, settings: { "robotsim.controller.flock_radius_m": 5 }, when_unix_s: Date.parse("2026-05-04T12:00") / 1000 }),
    row(2, "sweep", { kind: "sweep", varied: { "netsim.sf.kind": ["msf", "orchestra"] }, when_unix_s: Date.parse("2026-05-05T12:00") / 1000 }),
    row(3, "timed", { settings: { "timeline[2].radius_m": 7 }, when_unix_s: null }),
  ];
  const figures: About["figures"] = [...about.figures, { name: "broadcast_pdr", label: "broadcasts delivered", unit: "%", better: "higher" }];
  const of = (text: string): ReturnType<typeof parseFilter> => parseFilter(text, columnsOf({ ...about, figures }, some).all);
  const found = (text: string): number[] => some.filter(of(text).test).map(({ id }) => id);
  assert.deepEqual(found("leader_speed_ratio>0.9"), [1]);
  assert.deepEqual(found("sf.kind=orchestra"), [2]);
  assert.deepEqual(found("sf.kind!=msf"), [1, 3]);
  assert.deepEqual([found("when=2026-05-04"), found("when>2026-05-04"), found("when<=2026-05-05")], [[1], [2], [1, 2]]);
  assert.match(of("pdr<98%").problem, /nearest: broadcast_pdr/);
  assert.equal(of("radius_m=5").note, "radius_m is read as timeline[2].radius_m; there is also robotsim.controller.flock_radius_m");
  assert.equal(of("flock_radius_m=5").note, "");
});

test("keys that tell runs apart come first, models before trivia, and only as many as needed", () => {
  const settings = (radius: number, propagation: string, t: number): Partial<Row> => ({
    settings: { "experiment.duration_s": t, "netsim.phy.propagation": propagation, "netsim.phy.radius_m": radius, "timeline[0].at_s": t },
  });
  const runs = [settings(5, "unit-disk", 1), settings(10, "unit-disk", 2), settings(5, "log-distance", 3), settings(10, "log-distance", 4)].map((of, i) => row(i, `r${i}`, of));
  const keys = Object.keys(runs[0].settings);
  const { keys: order, enough } = telling(runs, keys, 6);
  assert.deepEqual(order.slice(0, enough), ["netsim.phy.propagation", "netsim.phy.radius_m"]);
  assert.deepEqual([...order].sort(), [...keys].sort());
  // Runs that lack a key are told apart by another one.
  const mixed = [row(1, "a", { settings: { "robotsim.x": 1, "netsim.y": 1 } }), row(2, "b", { settings: { "netsim.y": 2 } })];
  assert.deepEqual(telling(mixed, ["robotsim.x", "netsim.y"], 6), { keys: ["netsim.y", "robotsim.x"], enough: 1 });
});

test("first figures are compared with their own kind only, and what runs stands first", () => {
  const first = (name: string, unit: string, value: number): Row["first"] => ({ name, words: name, unit, is_greater_better: true, value });
  const some = [
    row(1, "a", { first: first("share", "%", 0.5) }), row(2, "b", { first: first("error", "dB", 1.9) }), row(3, "c", { first: first("share", "%", 0.9) }),
    row(4, "d", { status: "running", when_unix_s: 0 }),
  ];
  const { all } = columnsOf(about, some);
  const by = (key: string, order: "ascending" | "descending"): number[] => sorted(some, all.find((column) => column.key === key) ?? all[0], order).map(({ id }) => id);
  assert.deepEqual(by("first", "descending"), [3, 1, 2, 4]);
  assert.deepEqual(by("first", "ascending"), [1, 3, 2, 4]);
  assert.deepEqual(by("when", "descending"), [4, 3, 2, 1]);
});

test("a moving mean keeps constants, ends and gaps", () => {
  const timeS = [0, 1, 2, 3, 4];
  assert.deepEqual(smoothed({ timeS, value: [2, 2, null, 2, 2] }, 0.4).value, [2, 2, null, 2, 2]);
  assert.deepEqual(smoothed({ timeS, value: [0, 3, 0, 3, 0] }, 0.4).value, [1.5, 1, 2, 1, 1.5]);
});

test("the address restores what it captured", () => {
  const choices = {
    ...INITIAL, filter: 'radius_m=8 "a b"', sort: "pdr", order: "ascending" as const, series: "spread", time: "robots" as const, smooth: 5, selected: ["a/b", "c&d"],
    shown: { pdr: false, latency: true }, theme: "dark" as const,
  };
  assert.deepEqual(parseChoices(`#${fragmentOf(choices)}`), choices);
  assert.deepEqual(parseChoices(""), INITIAL);
  assert.equal(fragmentOf(INITIAL), "");
});
