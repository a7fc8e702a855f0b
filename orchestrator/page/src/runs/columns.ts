import { figure } from "../format.ts";
import type { About, FigureKind, FirstFigure, Row, Setting } from "./calls.ts";
import { settingOf, telling } from "./keys.ts";

export type Value = string | number | null;

/** A column of the table. */
export interface Column {
  /** What the state of the page and the filter call it. */
  key: string;
  label: string;
  /** What it is, in full. */
  title: string;
  width: number;
  /** It has numbers, or nothing. */
  isNumeric: boolean;
  kind: "name" | "status" | "when" | "first" | "series" | "figure" | "setting" | "count" | "links";
  /** Which values come first at the first click on its heading. */
  firstOrder: Order;
  value(row: Row): Value;
  /** What a condition of a filter may match, if that is more than the value. */
  values?(row: Row): Value[];
  text(row: Row): string;
}

export type Order = "ascending" | "descending";

/** Figures that have a column at first, if any result has them. */
const FIRST_FIGURES = ["pdr", "broadcast_pdr", "latency", "neighbours", "age", "collisions"];
/** So many keys of the configuration have a column at first, at most; fewer tell nearly all runs apart. */
const MOST_SETTINGS = 6;
/** If no more keys differ than these, all have a column. */
const FEW_SETTINGS = 3;
/** In the order of times, what runs stands before all that has ended (s). */
const RUNNING_S = 1e12;

/** A number with its unit; a share as per cent. */
export function withUnit(value: number, unit: string): string {
  if (unit === "%") return `${figure(+(100 * value).toPrecision(4))} %`;
  return unit === "" || unit === "1" ? figure(value) : `${figure(value)} ${unit}`;
}

export function firstText(first: FirstFigure | null): string {
  return first === null ? "" : withUnit(first.value, first.unit);
}

/** How far one is that is not finished. */
export function countText({ kind, progress }: Row): string {
  return progress === null ? "" : `${progress.done} of ${progress.of} ${kind === "sweep" ? "trials" : "steps"}`;
}

/** How long ago a time is. */
export function agoText(unixS: number, nowS: number): string {
  const s = Math.max(0, nowS - unixS);
  if (s < 60) return "now";
  if (s < 3600) return `${Math.floor(s / 60)} min ago`;
  if (s < 86_400) return `${Math.floor(s / 3600)} h ago`;
  if (s < 30 * 86_400) return `${Math.floor(s / 86_400)} d ago`;
  return new Date(unixS * 1000).toISOString().slice(0, 10);
}

/** The last parts of the path of a key that tell it from others. */
export function shortKey(key: string, all: readonly string[]): string {
  const parts = key.split(".");
  for (let n = 1; n < parts.length; n++) {
    const short = parts.slice(-n).join(".");
    if (all.filter((other) => other === short || other.endsWith(`.${short}`)).length === 1) return short;
  }
  return key;
}

const text = (value: Value | boolean): string => (value === null ? "" : typeof value === "number" ? figure(value) : String(value));

function fixed(
  key: string,
  label: string,
  kind: Column["kind"],
  width: number,
  firstOrder: Order,
  value: (row: Row) => Value,
  shown: (row: Row) => string = (row) => text(value(row)),
): Column {
  return { key, label, title: label, kind, width, isNumeric: kind === "count", firstOrder, value, text: shown };
}

/** The width of a column of short values under a heading (px). */
function widthOf(label: string): number {
  return Math.min(190, Math.max(84, 42 + 7.6 * label.length));
}

function figureColumn({ name, label, unit, better }: FigureKind): Column {
  const value = (row: Row): Value => row.figures[name] ?? null;
  const shown = (row: Row): string => (row.figures[name] === undefined ? "" : withUnit(row.figures[name], unit === "%" ? "%" : ""));
  const head = unit === "" || unit === "%" ? name : `${name} (${unit})`;
  const title = `${label}${better === "neither" ? "" : `: ${better} is better`}`;
  return { key: name, label: head, title, width: widthOf(head), isNumeric: true, kind: "figure", firstOrder: better === "lower" ? "ascending" : "descending", value, text: shown };
}

function settingColumn(key: string, all: readonly string[], rows: Row[]): Column {
  const label = shortKey(key, all);
  const plain = (setting: Setting | undefined): Value => (setting === undefined ? null : typeof setting === "boolean" ? String(setting) : setting);
  const value = (row: Row): Value => plain(settingOf(row, key));
  const values = (row: Row): Value[] => row.varied[key]?.map(plain) ?? [value(row)];
  const longest = Math.max(0, ...rows.map((row) => text(value(row)).length));
  const isNumeric = rows.every((row) => typeof (row.settings[key] ?? 0) === "number");
  return { key, label, title: `${key} of the configuration`, width: Math.max(widthOf(label), Math.min(170, 24 + 7 * longest)), isNumeric, kind: "setting", firstOrder: "ascending", value, values, text: (row) => text(value(row)) };
}

/** Columns of first figures that have none by a short name of their own. */
function firstColumns(about: About, rows: Row[]): Column[] {
  const kinds = new Map<string, FigureKind>();
  for (const { kind, first } of rows) {
    if (first === null || kinds.has(first.name) || about.figures.some(({ name }) => name === first.name)) continue;
    const better = first.is_greater_better === null ? "neither" : first.is_greater_better ? "higher" : "lower";
    kinds.set(first.name, { name: first.name, label: kind === "sweep" ? first.name : first.words, unit: first.unit === "1" ? "" : first.unit, better });
  }
  return [...kinds.values()].map((kind) => ({ ...figureColumn(kind), value: (row) => (row.first?.name === kind.name ? row.first.value : null), text: (row) => (row.first?.name === kind.name ? firstText(row.first) : "") }));
}

/** All columns that the rows give, and which of them are shown unless the user chooses others. */
export function columnsOf(about: About, rows: Row[]): { all: Column[]; optional: Map<string, boolean> } {
  const figures = new Set<string>();
  const settings = new Set<string>();
  for (const row of rows) {
    for (const name in row.figures) figures.add(name);
    for (const key in row.settings) settings.add(key);
    for (const key in row.varied) settings.add(key);
  }
  const { keys, enough } = telling(rows, [...settings].sort(), MOST_SETTINGS);
  const nShown = keys.length <= FEW_SETTINGS ? keys.length : enough;
  const optional = new Map<string, boolean>();
  const ofFigures = about.figures.filter(({ name }) => figures.has(name));
  const ofFirst = firstColumns(about, rows);
  for (const { name } of ofFigures) optional.set(name, FIRST_FIGURES.includes(name));
  for (const { key } of ofFirst) optional.set(key, false);
  keys.forEach((key, i) => optional.set(key, i < nShown));
  const all: Column[] = [
    fixed("name", "name", "name", 220, "ascending", (row) => row.name),
    fixed("status", "status", "status", 124, "ascending", (row) => row.status),
    fixed("when", "when", "when", 104, "descending", (row) => (row.when_unix_s === null ? null : row.when_unix_s + (row.status === "running" ? RUNNING_S : 0))),
    fixed("first", "first figure", "first", 190, "descending", (row) => row.first?.value ?? null, (row) => firstText(row.first)),
    ...keys.map((key) => settingColumn(key, keys, rows)),
    { ...fixed("series", "series", "series", 240, "descending", () => null), title: "A series over simulated time" },
    { ...fixed("links", "pages", "links", 112, "ascending", () => null), title: "Pages of the result" },
    ...ofFigures.map(figureColumn),
    ...ofFirst,
    fixed("seed", "seed", "count", 74, "ascending", (row) => row.seed),
    fixed("warnings", "warnings", "count", 100, "descending", (row) => row.n_warnings, (row) => (row.n_warnings === 0 ? "" : String(row.n_warnings))),
  ];
  return { all, optional };
}

/** First figures of different kinds are not compared: each kind has its place, the most frequent one first. */
function firstGroups(rows: readonly Row[]): Map<string, number> {
  const counts = new Map<string, number>();
  for (const { first } of rows) if (first !== null) counts.set(first.name, (counts.get(first.name) ?? 0) + 1);
  const names = [...counts].sort(([a, n], [b, m]) => m - n || a.localeCompare(b));
  return new Map(names.map(([name], i) => [name, i]));
}

/** Whether rows can be sorted by a column. */
export function isSortable(column: Column): boolean {
  return column.kind !== "series" && column.kind !== "links";
}

/** Rows in the order of a column; those without a value last, and equal ones by name. */
export function sorted(rows: readonly Row[], column: Column, order: Order): Row[] {
  const sign = order === "ascending" ? 1 : -1;
  const groups = column.kind === "first" ? firstGroups(rows) : null;
  const byName = (a: Row, b: Row): number => a.name.localeCompare(b.name, "en", { numeric: true }) || a.id - b.id;
  return [...rows].sort((a, b) => {
    const [p, q] = [column.value(a), column.value(b)];
    if (p === null || q === null) return p === q ? byName(a, b) : p === null ? 1 : -1;
    const group = groups === null ? 0 : (groups.get(a.first?.name ?? "") ?? 0) - (groups.get(b.first?.name ?? "") ?? 0);
    if (group !== 0) return group;
    if (typeof p === "number" && typeof q === "number") return p === q ? byName(a, b) : sign * (p - q);
    if (typeof p === typeof q) return sign * String(p).localeCompare(String(q), "en", { numeric: true }) || byName(a, b);
    // Numbers before texts, such as the values that a sweep tries.
    return typeof p === "number" ? -1 : 1;
  });
}
