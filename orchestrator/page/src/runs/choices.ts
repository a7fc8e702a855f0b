import type { Order } from "./columns.ts";

/** What the user has chosen. */
export interface Choices {
  filter: string;
  sort: string;
  order: Order;
  /** The series of the table and of the chart; "": one that the runs have. */
  series: string;
  /** What the time of the chart begins with; "": depends on the runs. */
  time: "" | Alignment;
  /** Width of the moving mean of the curves (% of each one's points); 0: none. */
  smooth: number;
  /** Names of the selected runs. */
  selected: string[];
  /** Columns that are shown or hidden against what the page does by itself. */
  shown: Record<string, boolean>;
  /** "" follows the system. */
  theme: "" | "light" | "dark";
}

/** The time of the chart: from the beginning of the run, from the start of the robots, or as a share of the latter. */
export type Alignment = "run" | "robots" | "share";
export const SMOOTHINGS: readonly number[] = [0, 2, 5, 10, 20];

export const INITIAL: Choices = { filter: "", sort: "when", order: "descending", series: "", time: "", smooth: 0, selected: [], shown: {}, theme: "" };

/** The choices of the part of the address after #. */
export function parseChoices(fragment: string): Choices {
  const query = new URLSearchParams(fragment.replace(/^#/, ""));
  const sort = query.get("sort") ?? INITIAL.sort;
  const theme = query.get("theme");
  const time = query.get("time");
  const smooth = Number(query.get("smooth"));
  const list = (key: string): string[] => query.getAll(key).filter((value) => value !== "");
  return {
    filter: query.get("filter") ?? "",
    sort: sort.replace(/^-/, ""),
    order: query.has("sort") ? (sort.startsWith("-") ? "descending" : "ascending") : INITIAL.order,
    series: query.get("series") ?? INITIAL.series,
    time: time === "run" || time === "robots" || time === "share" ? time : "",
    smooth: SMOOTHINGS.includes(smooth) ? smooth : 0,
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
  if (choices.time !== "") query.set("time", choices.time);
  if (choices.smooth !== 0) query.set("smooth", String(choices.smooth));
  for (const name of choices.selected) query.append("run", name);
  for (const [key, shown] of Object.entries(choices.shown)) query.append(shown ? "show" : "hide", key);
  if (choices.theme !== "") query.set("theme", choices.theme);
  return query.toString();
}
