import type { Row, Setting } from "./calls.ts";

/** Runs that are looked at to choose keys, at most. */
const MOST_RUNS = 400;

/** A pair of runs of which one lacks a key tells less of it than a pair with two values. */
const LACKING = 0.2;

/** How much a key says about an experiment: models and swarms before durations, and lists of events last. */
function weight(key: string): number {
  if (key.includes("[") || key.startsWith("timeline") || key.startsWith("output")) return 0.3;
  if (!/^(netsim|robotsim)\./.test(key)) return key === "experiment.agents" ? 1.5 : 1;
  return /(^|[._])(kind|mode|propagation)$/.test(key) ? 3 : 2.5;
}

/** The value of a key: of a run its own, of a sweep those that it tries. */
export function settingOf(row: Row, key: string): Setting | undefined {
  return row.settings[key] ?? row.varied[key]?.map(String).join(", ");
}

/** How many pairs of runs a key tells apart that are in the same class. */
function pairs(values: (Setting | undefined)[], classes: number[]): number {
  const counts = new Map<number, Map<Setting | undefined, number>>();
  values.forEach((value, i) => {
    const own = counts.get(classes[i]) ?? new Map<Setting | undefined, number>();
    own.set(value, (own.get(value) ?? 0) + 1);
    counts.set(classes[i], own);
  });
  let told = 0;
  for (const own of counts.values()) {
    const lacking = own.get(undefined) ?? 0;
    let [n, same] = [0, 0];
    for (const [value, count] of own) {
      if (value === undefined) continue;
      n += count;
      same += count * count;
    }
    told += (n * n - same) / 2 + LACKING * n * lacking;
  }
  return told;
}

/**
 * The keys in the order of how much they tell, and how many of the first ones suffice to tell the rows apart. Each key is the one
 * that tells the most pairs apart that those before it leave alike.
 */
export function telling(rows: readonly Row[], keys: readonly string[], most: number): { keys: string[]; enough: number } {
  const every = Math.max(1, Math.ceil(rows.length / MOST_RUNS));
  const some = rows.filter((row, i) => i % every === 0 && (Object.keys(row.settings).length > 0 || Object.keys(row.varied).length > 0));
  const values = new Map(keys.map((key) => [key, some.map((row) => settingOf(row, key))]));
  const depth = (key: string): number => key.split(".").length;
  const best = (left: readonly string[], classes: number[]): [string, number][] => {
    const scores = left.map((key): [string, number] => [key, weight(key) * pairs(values.get(key) ?? [], classes)]);
    return scores.sort((a, b) => b[1] - a[1] || depth(a[0]) - depth(b[0]) || a[0].localeCompare(b[0]));
  };
  const chosen: string[] = [];
  let classes = some.map(() => 0);
  while (chosen.length < most) {
    const [first] = best(keys.filter((key) => !chosen.includes(key)), classes);
    if (first === undefined || first[1] === 0) break;
    chosen.push(first[0]);
    const numbers = new Map<string, number>();
    classes = (values.get(first[0]) ?? []).map((value, i) => {
      const name = `${classes[i]} ${typeof value} ${value}`;
      const number = numbers.get(name) ?? numbers.size;
      numbers.set(name, number);
      return number;
    });
  }
  const rest = best(keys.filter((key) => !chosen.includes(key)), some.map(() => 0));
  return { keys: [...chosen, ...rest.map(([key]) => key)], enough: chosen.length };
}
