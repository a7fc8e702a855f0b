import { figure } from "../format.ts";
import type { About, FigureKind, FirstFigure, Row } from "./calls.ts";

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
  text(row: Row): string;
}

export type Order = "ascending" | "descending";

/** Figures that have a column at first, if any result has them. */
const FIRST_FIGURES = ["pdr", "broadcast_pdr", "latency", "neighbours", "age", "collisions"];
/** So many keys of the configuration have a column at first. */
const FIRST_SETTINGS = 12;

/** A number with its unit; a share as per cent. */
export function withUnit(value: number, unit: string): string {
  if (unit === "%") return `${figure(+(100 * value).toPrecision(4))} %`;
  return unit === "" || unit === "1" ? figure(value) : `${figure(value)} ${unit}`;
}

export function firstText(first: FirstFigure | null): string {
  return first === null ? "" : withUnit(first.value, first.unit);
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
  const value = (row: Row): Value => {
    const setting = row.settings[key];
    return setting === undefined ? null : typeof setting === "boolean" ? String(setting) : setting;
  };
  const isNumeric = rows.every((row) => typeof (row.settings[key] ?? 0) === "number");
  return { key, label, title: `${key} of the configuration`, width: widthOf(label), isNumeric, kind: "setting", firstOrder: "ascending", value, text: (row) => text(value(row)) };
}

/** All columns that the rows give, and which of them are shown unless the user chooses others. */
export function columnsOf(about: About, rows: Row[]): { all: Column[]; optional: Map<string, boolean> } {
  const figures = new Set<string>();
  const settings = new Set<string>();
  for (const row of rows) {
    for (const name in row.figures) figures.add(name);
    for (const key in row.settings) settings.add(key);
  }
  const keys = [...settings].sort();
  const optional = new Map<string, boolean>();
  const ofFigures = about.figures.filter(({ name }) => figures.has(name));
  for (const { name } of ofFigures) optional.set(name, FIRST_FIGURES.includes(name));
  keys.forEach((key, i) => optional.set(key, i < FIRST_SETTINGS));
  const all: Column[] = [
    fixed("name", "name", "name", 230, "ascending", (row) => row.name),
    fixed("status", "status", "status", 116, "ascending", (row) => row.status),
    fixed("when", "when", "when", 92, "descending", (row) => row.when_unix_s),
    fixed("first", "first figure", "first", 190, "descending", (row) => row.first?.value ?? null, (row) => firstText(row.first)),
    { ...fixed("series", "series", "series", 176, "descending", () => null), title: "A series over simulated time" },
    { ...fixed("links", "pages", "links", 112, "ascending", () => null), title: "Pages of the result" },
    ...ofFigures.map(figureColumn),
    ...keys.map((key) => settingColumn(key, keys, rows)),
    fixed("seed", "seed", "count", 74, "ascending", (row) => row.seed),
    fixed("warnings", "warnings", "count", 100, "descending", (row) => row.n_warnings, (row) => (row.n_warnings === 0 ? "" : String(row.n_warnings))),
  ];
  return { all, optional };
}

/** Whether rows can be sorted by a column. */
export function isSortable(column: Column): boolean {
  return column.kind !== "series" && column.kind !== "links";
}

/** Rows in the order of a column; those without a value last, and equal ones by name. */
export function sorted(rows: readonly Row[], column: Column, order: Order): Row[] {
  const sign = order === "ascending" ? 1 : -1;
  const byName = (a: Row, b: Row): number => a.name.localeCompare(b.name, "en", { numeric: true }) || a.id - b.id;
  return [...rows].sort((a, b) => {
    const [p, q] = [column.value(a), column.value(b)];
    if (p === null || q === null) return p === q ? byName(a, b) : p === null ? 1 : -1;
    if (typeof p === "number" && typeof q === "number") return p === q ? byName(a, b) : sign * (p - q);
    if (typeof p === typeof q) return sign * String(p).localeCompare(String(q), "en", { numeric: true }) || byName(a, b);
    // Numbers before texts.
    return typeof p === "number" ? -sign : sign;
  });
}
