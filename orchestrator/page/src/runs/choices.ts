import type { Order } from "./columns.ts";

/** What the user has chosen. */
export interface Choices {
  filter: string;
  sort: string;
  order: Order;
  /** The series of the table and of the chart. */
  series: string;
  /** Names of the selected runs. */
  selected: string[];
  /** Columns that are shown or hidden against what the page does by itself. */
  shown: Record<string, boolean>;
  /** "" follows the system. */
  theme: "" | "light" | "dark";
}

export const INITIAL: Choices = { filter: "", sort: "when", order: "descending", series: "flock_speed", selected: [], shown: {}, theme: "" };

/** The choices of the part of the address after #. */
export function parseChoices(fragment: string): Choices {
  const query = new URLSearchParams(fragment.replace(/^#/, ""));
  const sort = query.get("sort") ?? INITIAL.sort;
  const theme = query.get("theme");
  const list = (key: string): string[] => query.getAll(key).filter((value) => value !== "");
  return {
    filter: query.get("filter") ?? "",
    sort: sort.replace(/^-/, ""),
    order: query.has("sort") ? (sort.startsWith("-") ? "descending" : "ascending") : INITIAL.order,
    series: query.get("series") ?? INITIAL.series,
    selected: list("run"),
    shown: Object.fromEntries([...list("show").map((key) => [key, true]), ...list("hide").map((key) => [key, false])]),
    theme: theme === "light" || theme === "dark" ? theme : "",
  };
}

/** The part of the address after # that has the choices. */
export function fragmentOf(choices: Choices): string {
  const query = new URLSearchParams();
  if (choices.filter !== "") query.set("filter", choices.filter);
  if (choices.sort !== INITIAL.sort || choices.order !== INITIAL.order) query.set("sort", (choices.order === "descending" ? "-" : "") + choices.sort);
  if (choices.series !== INITIAL.series) query.set("series", choices.series);
  for (const name of choices.selected) query.append("run", name);
  for (const [key, shown] of Object.entries(choices.shown)) query.append(shown ? "show" : "hide", key);
  if (choices.theme !== "") query.set("theme", choices.theme);
  return query.toString();
}
