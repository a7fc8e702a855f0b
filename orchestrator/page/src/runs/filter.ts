import type { Row } from "./calls.ts";
import type { Column, Value } from "./columns.ts";

type Test = (row: Row) => boolean;

/** A filter that was read: rows pass if all of its tests hold. */
export interface Filter {
  test: Test;
  /** What is wrong with it; "" if nothing. */
  problem: string;
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

/**
 * Reads a filter: words that a name, kind, status or sentence holds, and conditions on columns such as `radius_m=8`, `pdr<90%` or
 * `status!=complete`.
 */
export function parseFilter(text: string, columns: readonly Column[]): Filter {
  const tests: Test[] = [];
  let problem = "";
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
    if (found.length === 0) {
      const keys = ["kind", ...extra.map((column) => column.key)];
      const last = (path: string): string => path.slice(path.lastIndexOf(".") + 1);
      const nearest = keys.reduce((a, b) => (distance(key, last(b)) < distance(key, last(a)) ? b : a), keys[0]);
      problem = `There is no column ${key} (nearest: ${nearest}).`;
      tests.push(() => false);
      continue;
    }
    if (wanted === "") {
      problem = `${key}${operator} needs a value, such as ${key}${operator}8.`;
      continue;
    }
    if (operator.startsWith("<") || operator.startsWith(">")) {
      if (numberOf(wanted) === null) problem = `${word}: ${operator} needs a number, such as ${key}${operator}8.`;
    }
    tests.push((row) =>
      operator === "!=" ? found.every((column) => holds(column.value(row), operator, wanted)) : found.some((column) => holds(column.value(row), operator, wanted)),
    );
  }
  return { test: (row) => tests.every((test) => test(row)), problem };
}
