import type { Row } from "./calls.ts";
import type { Column, Value } from "./columns.ts";

type Test = (row: Row) => boolean;

/** A filter that was read: rows pass if all of its tests hold. */
export interface Filter {
  test: Test;
  /** What is wrong with it; "" if nothing. */
  problem: string;
  /** How it was understood, where a key may mean another one; "" if it is plain. */
  note: string;
}

const OPERATORS = ["!=", "<=", ">=", "=", "<", ">"] as const;
type Operator = (typeof OPERATORS)[number];

/** The words of a text: parts in quotation marks hold blanks. */
function wordsOf(text: string): string[] {
  return (text.match(/(?:[^\s"]|"[^"]*"?)+/g) ?? []).map((word) => word.replaceAll('"', ""));
}

/** The smallest number of letters to add, leave out or change that make one word of another. */
function distance(a: string, b: string): number {
  let row = Array.from({ length: b.length + 1 }, (_, i) => i);
  for (let i = 1; i <= a.length; i++) {
    const next = [i];
    for (let j = 1; j <= b.length; j++) {
      next[j] = Math.min(row[j] + 1, next[j - 1] + 1, row[j - 1] + (a[i - 1] === b[j - 1] ? 0 : 1));
    }
    row = next;
  }
  return row[b.length];
}

/** The number that a text is; per cent of a share. */
function numberOf(text: string): number | null {
  const share = text.endsWith("%");
  const value = Number(share ? text.slice(0, -1) : text);
  return text.trim() === "" || !Number.isFinite(value) ? null : share ? value / 100 : value;
}

/** The time that a date is (Unix time, s). */
function dateOf(text: string): number | null {
  const ms = /^\d{4}-\d{2}-\d{2}/.test(text) ? Date.parse(text.length === 10 ? `${text}T00:00` : text) : Number.NaN;
  return Number.isNaN(ms) ? null : ms / 1000;
}

function holds(value: Value, operator: Operator, wanted: string): boolean {
  if (value === null) return operator === "!=";
  const [a, b] = [typeof value === "number" ? value : numberOf(value), numberOf(wanted)];
  if (a !== null && b !== null) {
    const same = Math.abs(a - b) <= 1e-9 * Math.max(Math.abs(a), Math.abs(b));
    switch (operator) {
      case "=": return same;
      case "!=": return !same;
      case "<": return a < b && !same;
      case ">": return a > b && !same;
      case "<=": return a < b || same;
      case ">=": return a > b || same;
    }
  }
  const same = String(value).toLowerCase() === wanted.toLowerCase();
  return operator === "=" ? same : operator === "!=" && !same;
}

/** The columns that a key names: one, or those whose paths end with it. */
function named(key: string, columns: readonly Column[]): Column[] {
  const lower = key.toLowerCase();
  const exact = columns.filter((column) => column.key.toLowerCase() === lower);
  return exact.length > 0 ? exact : columns.filter((column) => column.key.toLowerCase().endsWith(`.${lower}`));
}

const lastOf = (path: string): string => path.slice(path.lastIndexOf(".") + 1);

/** Keys with a longer name that has this one as its first or last words, such as `flock_radius_m` of `radius_m`. */
function longer(key: string, keys: readonly string[]): string[] {
  const lower = key.toLowerCase();
  return keys.filter((path) => lastOf(path).toLowerCase().endsWith(`_${lower}`) || lastOf(path).toLowerCase().startsWith(`${lower}_`));
}

/** The key that is most likely meant by one that is none. */
function nearest(key: string, keys: readonly string[]): string {
  const [long] = longer(key, keys);
  return long ?? keys.reduce((a, b) => (distance(key, lastOf(b)) < distance(key, lastOf(a)) ? b : a), keys[0]);
}

/** A condition on the time of a result: before or after a date. */
function whenTest(operator: Operator, wanted: string): Test | null {
  const date = dateOf(wanted);
  if (date === null) return null;
  const until = wanted.length === 10 ? date + 86_400 : date;
  return ({ when_unix_s: when }) => {
    if (when === null) return operator === "!=";
    switch (operator) {
      case "<": return when < date;
      case ">=": return when >= date;
      case ">": return when >= until && when !== date;
      case "<=": return when < until || when === date;
      case "=": return when >= date && (when < until || when === date);
      case "!=": return when < date || (when >= until && when !== date);
    }
  };
}

/**
 * Reads a filter: words that a name, kind, status or sentence holds, and conditions on columns such as `radius_m=8`, `pdr<90%` or
 * `status!=complete`.
 */
export function parseFilter(text: string, columns: readonly Column[]): Filter {
  const tests: Test[] = [];
  const notes: string[] = [];
  let problem = text.split('"').length % 2 === 0 ? "A quotation mark is not closed." : "";
  const extra: Column[] = columns.filter((column) => column.kind !== "series" && column.kind !== "links");
  for (const word of wordsOf(text)) {
    const at = word.search(/[!<>=]/);
    const operator = at > 0 ? OPERATORS.find((operator) => word.startsWith(operator, at)) : undefined;
    if (operator === undefined) {
      const wanted = word.toLowerCase();
      tests.push((row) => [row.name, row.kind, row.status, row.words ?? ""].some((own) => own.toLowerCase().includes(wanted)));
      continue;
    }
    const key = word.slice(0, at);
    const wanted = word.slice(at + operator.length);
    if (key === "kind") {
      tests.push((row) => holds(row.kind, operator, wanted));
      continue;
    }
    const found = named(key, extra);
    const keys = ["kind", ...extra.map((column) => column.key)];
    if (found.length === 0) {
      problem = `There is no column ${key} (nearest: ${nearest(key, keys)}).`;
      tests.push(() => false);
      continue;
    }
    const others = longer(key, keys);
    const read = found.map((column) => column.key).slice(0, 3).join(" or ");
    if (read !== key && others.length > 0) notes.push(`${key} is read as ${read}; there is also ${others.slice(0, 3).join(", ")}`);
    if (wanted === "") {
      problem = `${key}${operator} needs a value, such as ${key}${operator}8.`;
      continue;
    }
    if (operator.startsWith("<") || operator.startsWith(">")) {
      if (numberOf(wanted) === null) problem = `${word}: ${operator} needs a number, such as ${key}${operator}8.`;
    }
    if (found[0].kind === "when") {
      const test = whenTest(operator, wanted);
      if (test === null) problem = `${word}: when is compared with a date, such as when${operator}${new Date().toISOString().slice(0, 10)}.`;
      else tests.push(test);
      continue;
    }
    const valuesOf = (column: Column, row: Row): Value[] => column.values?.(row) ?? [column.value(row)];
    tests.push((row) =>
      operator === "!="
        ? found.every((column) => valuesOf(column, row).every((value) => holds(value, operator, wanted)))
        : found.some((column) => valuesOf(column, row).some((value) => holds(value, operator, wanted))),
    );
  }
  return { test: (row) => tests.every((test) => test(row)), problem, note: notes.join(" · ") };
}
