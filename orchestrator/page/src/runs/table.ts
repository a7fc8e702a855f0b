import { element } from "../dom.ts";
import { figure } from "../format.ts";
import type { Calls, Row, SeriesKind } from "./calls.ts";
import { agoText, type Column, countText, firstText, isSortable, type Order, withUnit } from "./columns.ts";
import { labelWithUnit } from "./overlay.ts";
import type { Loaded, SeriesStore } from "./series.ts";
import { sparkBars, sparkLine } from "./spark.ts";

/** Height of a row of the table (px). */
const ROW_PX = 44;
/** Height of a card: of its fixed parts, of the line of its figure and series, of each line of two values, and of its links (px). */
const CARD_PX = 82;
const CARD_FIGURE_PX = 44;
const CARD_LINE_PX = 21;
const CARD_LINKS_PX = 30;
const CARD_PROGRESS_PX = 22;
/** A name with a value of more letters has a line of a card to itself. */
const CARD_LETTERS = 20;
/** Rows beyond the part in sight that are drawn, too. */
const BEYOND = 4;

/** What the table shows. */
export interface Shown {
  columns: Column[];
  rows: Row[];
  sort: string;
  order: Order;
  /** The series of runs; null: no row has any. */
  series: SeriesKind | null;
  /** Colour of each selected run. */
  colours: Map<number, string>;
  isCards: boolean;
  nowS: number;
}

interface Actions {
  sort(column: Column): void;
  /** Returns whether the row is selected then. */
  select(row: Row, selected: boolean): boolean;
  details(row: Row): void;
}

/** The table. Only rows in sight are in the document. */
export class ResultsTable {
  readonly root: HTMLElement;
  private readonly head = element("tr");
  private readonly columns = element("colgroup");
  private readonly body = element("tbody");
  private readonly before = element("tr", { class: "spacer", "aria-hidden": "true" });
  private readonly after = element("tr", { class: "spacer", "aria-hidden": "true" });
  private readonly table: HTMLTableElement;
  private readonly drawn = new Map<number, { row: HTMLTableRowElement; version: string }>();
  private shown: Shown | null = null;
  private headVersion = "";
  /** Where each card begins, and the last one ends (px); empty for rows of the same height. */
  private cardTops: number[] = [];

  constructor(
    private readonly calls: Calls,
    private readonly series: SeriesStore,
    private readonly actions: Actions,
  ) {
    this.table = element("table", { class: "results" }, this.columns, element("thead", {}, this.head), this.body);
    this.root = element("div", { class: "scroller", tabindex: 0, role: "region", "aria-label": "Results", onscroll: () => this.render() }, this.table);
    this.body.addEventListener("keydown", (event) => this.move(event));
    new ResizeObserver(() => this.render()).observe(this.root);
  }

  show(shown: Shown): void {
    this.shown = shown;
    this.cardTops = [];
    if (shown.isCards) {
      const heights = shown.rows.map((row) => cardPx(row, shown.columns));
      this.cardTops = [0];
      for (const height of heights) this.cardTops.push(this.cardTops[this.cardTops.length - 1] + height);
    }
    this.drawHead(shown);
    this.render();
  }

  private drawHead({ columns, sort, order, series }: Shown): void {
    const version = JSON.stringify([columns.map((column) => [column.key, column.label]), sort, order, series?.name]);
    if (version === this.headVersion) return;
    this.headVersion = version;
    const focused = document.activeElement instanceof HTMLElement ? document.activeElement.dataset["sort"] : undefined;
    this.columns.replaceChildren(element("col", { width: 36 }), ...columns.map((column) => element("col", { width: column.width })));
    this.table.style.setProperty("--least-width", `${36 + columns.reduce((sum, column) => sum + column.width, 0)}px`);
    const cells = columns.map((column) => {
      const label = column.kind === "series" ? (series === null ? "values" : labelWithUnit(series)) : column.label;
      const kind = `${column.kind}${column.isNumeric ? " number" : ""}`;
      if (!isSortable(column)) return element("th", { scope: "col", class: kind, title: column.title }, label);
      const direction = column.key === sort ? order : "none";
      const arrow = direction === "none" ? "" : direction === "ascending" ? "▲" : "▼";
      const button = element("button", { type: "button", "data-sort": column.key, onclick: () => this.actions.sort(column) }, element("span", {}, label), element("span", { class: "arrow", "aria-hidden": "true" }, arrow));
      return element("th", { scope: "col", class: kind, title: column.title, "aria-sort": direction }, button);
    });
    this.head.replaceChildren(element("th", { scope: "col", class: "pick" }, element("span", { class: "hidden" }, "selected")), ...cells);
    if (focused !== undefined) this.head.querySelector<HTMLElement>(`[data-sort="${CSS.escape(focused)}"]`)?.focus();
  }

  /** Where a row begins (px). */
  private topOf(index: number): number {
    return this.cardTops[index] ?? index * ROW_PX;
  }

  /** The row at a height (px). */
  private rowAt(px: number): number {
    if (this.cardTops.length === 0) return Math.max(0, Math.floor(px / ROW_PX));
    let low = 0;
    let high = this.cardTops.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.cardTops[middle] <= px) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  private render(): void {
    const { shown } = this;
    if (shown === null) return;
    const top = this.root.scrollTop;
    const n = shown.rows.length;
    const first = Math.min(n, Math.max(0, this.rowAt(top) - BEYOND));
    const last = Math.min(n, this.rowAt(top + this.root.clientHeight) + 1 + BEYOND);
    const inSight = shown.rows.slice(first, last);
    this.series.want(inSight.filter((row) => row.has_series).map((row) => row.id));
    const scale = this.scale(shown);
    const focused = document.activeElement?.closest("tr")?.dataset["id"];
    const rows = inSight.map((row) => this.row(row, shown, scale));
    const kept = new Set(inSight.map((row) => row.id));
    for (const id of this.drawn.keys()) if (!kept.has(id)) this.drawn.delete(id);
    this.before.style.height = `${this.topOf(first)}px`;
    this.after.style.height = `${this.topOf(n) - this.topOf(last)}px`;
    this.table.setAttribute("aria-rowcount", String(shown.rows.length + 1));
    rows.forEach((row, i) => {
      row.setAttribute("aria-rowindex", String(first + i + 2));
      row.style.height = `${this.topOf(first + i + 1) - this.topOf(first + i)}px`;
    });
    const wanted = [this.before, ...rows, this.after];
    const same = wanted.length === this.body.children.length && wanted.every((row, i) => this.body.children[i] === row);
    if (!same) {
      this.body.replaceChildren(...wanted);
      if (focused !== undefined && !this.body.contains(document.activeElement)) {
        this.body.querySelector<HTMLElement>(`tr[data-id="${focused}"] input`)?.focus({ preventScroll: true });
      }
    }
  }

  /** The scale of the lines of all runs that are loaded. */
  private scale({ rows, series }: Shown): [number, number] {
    let [least, most] = [0, Number.NEGATIVE_INFINITY];
    for (const row of rows) {
      const loaded = this.series.row(row.id);
      if (loaded === undefined || loaded instanceof Error) continue;
      for (const value of series === null ? [] : (loaded.values[series.name] ?? [])) {
        if (value === null) continue;
        least = Math.min(least, value);
        most = Math.max(most, value);
      }
    }
    return most > least ? [least, most] : [least, least + 1];
  }

  private row(row: Row, shown: Shown, scale: [number, number]): HTMLTableRowElement {
    const loaded = this.series.row(row.id);
    const colour = shown.colours.get(row.id);
    const when = row.when_unix_s === null ? "" : agoText(row.when_unix_s, shown.nowS);
    const version = JSON.stringify([
      row, colour, when, shown.isCards, shown.series?.name, shown.columns.map((column) => column.key), loaded === undefined, loaded instanceof Error, row.has_series && scale,
    ]);
    const before = this.drawn.get(row.id);
    if (before?.version === version) {
      // What the user has ticked is undone if it was refused.
      const box = before.row.querySelector("input");
      if (box !== null && box.checked !== (colour !== undefined)) box.checked = colour !== undefined;
      return before.row;
    }
    const made = before?.row ?? element("tr", { "data-id": row.id });
    const hadFocus = made.contains(document.activeElement);
    made.setAttribute("aria-selected", String(colour !== undefined));
    made.className = `status-${row.status}`;
    made.replaceChildren(this.pick(row, colour), ...shown.columns.map((column) => this.cell(row, column, shown, loaded, scale, when)));
    if (hadFocus) made.querySelector<HTMLElement>("input")?.focus({ preventScroll: true });
    this.drawn.set(row.id, { row: made, version });
    return made;
  }

  private pick(row: Row, colour: string | undefined): HTMLElement {
    const name = row.has_series ? `Select ${row.name} for the chart` : `${row.name} has no series for the chart`;
    const box = element("input", { type: "checkbox", "aria-label": name, title: name, disabled: !row.has_series });
    box.checked = colour !== undefined;
    if (colour !== undefined) box.style.accentColor = colour;
    box.addEventListener("change", () => {
      box.checked = this.actions.select(row, box.checked);
    });
    return element("td", { class: "pick" }, box);
  }

  private cell(row: Row, column: Column, shown: Shown, loaded: Loaded | undefined, scale: [number, number], when: string): HTMLElement {
    const cell = element("td", { class: `${column.kind}${isChip(column) ? " chip" : ""}` });
    switch (column.kind) {
      case "name":
        cell.title = row.words === null ? row.name : `${row.name}\n${row.words}`;
        cell.append(
          element("div", { class: "strong" }, this.name(row)),
          element("button", { type: "button", class: "faint more", "aria-label": `Details of ${row.name}`, onclick: () => this.actions.details(row) }, `${row.kind}${row.words === null ? "" : ` · ${row.words}`}`),
        );
        break;
      case "status":
        cell.append(element("span", { class: "badge" }, row.status));
        if (row.progress !== null) cell.append(element("div", { class: "faint" }, countText(row)), progressOf(row.progress));
        break;
      case "when":
        if (row.when_unix_s !== null) cell.title = new Date(row.when_unix_s * 1000).toLocaleString();
        cell.append(when);
        break;
      case "first":
        if (row.first !== null) {
          cell.title = `${row.first.words}: ${row.first.value}`;
          cell.append(element("div", { class: "strong" }, firstText(row.first)), element("div", { class: "faint" }, row.first.words));
        }
        break;
      case "series":
        cell.append(...seriesOf(row, shown.series, loaded, scale));
        break;
      case "links":
        if (row.report !== null) cell.append(pageLink(row.report, "report", `Report of ${row.name}`));
        if (row.has_recording) cell.append(pageLink(this.calls.player(row), "play", `Play ${row.name}`));
        if (row.command !== null) cell.append(element("button", { type: "button", class: "plain", "aria-label": `Recover ${row.name}`, onclick: () => this.actions.details(row) }, "recover…"));
        break;
      default: {
        const text = column.text(row);
        if (isChip(column)) {
          cell.dataset["label"] = column.label;
          cell.classList.toggle("wide", isWide(column, row));
        }
        cell.title = `${column.title}${text === "" ? ": none" : `: ${String(column.value(row))}`}`;
        cell.append(shown.isCards ? element("span", {}, text) : text);
        if (shown.isCards && text === "") cell.replaceChildren();
        if (column.isNumeric) cell.classList.add("number");
      }
    }
    return cell;
  }

  /** The name, which leads to the page of the result. */
  private name(row: Row): Node | string {
    const href = row.report ?? (row.has_recording ? this.calls.player(row) : null);
    if (href !== null) return element("a", { href, target: "_blank", rel: "noopener" }, row.name);
    return element("button", { type: "button", class: "more", onclick: () => this.actions.details(row) }, row.name);
  }

  /** Arrow keys go from row to row. */
  private move(event: KeyboardEvent): void {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    const id = Number((event.target as Element).closest("tr")?.dataset["id"]);
    if (step === 0 || this.shown === null || Number.isNaN(id)) return;
    const next = this.shown.rows.findIndex((row) => row.id === id) + step;
    const row = this.shown.rows[next];
    if (row === undefined) return;
    event.preventDefault();
    const [top, bottom] = [this.topOf(next), this.topOf(next + 1) + (this.shown.isCards ? 0 : this.head.offsetHeight)];
    if (top < this.root.scrollTop) this.root.scrollTop = top;
    else if (bottom > this.root.scrollTop + this.root.clientHeight) this.root.scrollTop = bottom - this.root.clientHeight;
    this.render();
    const target = this.body.querySelector<HTMLElement>(`tr[data-id="${row.id}"] input:enabled, tr[data-id="${row.id}"] a`);
    target?.focus({ preventScroll: true });
  }
}

/** Height of the card of a row (px). */
function cardPx(row: Row, columns: Column[]): number {
  const chips = columns.filter((column) => isChip(column) && column.text(row) !== "");
  const wide = chips.filter((column) => isWide(column, row)).length;
  const lines = wide + Math.ceil((chips.length - wide) / 2);
  const figure = row.first !== null || row.has_series || row.spark.length > 0;
  const links = row.report !== null || row.has_recording || row.command !== null;
  return CARD_PX + (row.progress === null ? 0 : CARD_PROGRESS_PX) + (figure ? CARD_FIGURE_PX : 0) + lines * CARD_LINE_PX + (links ? CARD_LINKS_PX : 0);
}

/** Whether a card shows a column as a name with a value. */
function isChip({ kind }: Column): boolean {
  return kind === "figure" || kind === "setting" || kind === "count";
}

/** Whether a card shows a name with a value on a line of their own. */
function isWide(column: Column, row: Row): boolean {
  return column.label.length + column.text(row).length > CARD_LETTERS;
}

function pageLink(href: string, text: string, label: string): HTMLElement {
  return element("a", { href, target: "_blank", rel: "noopener", "aria-label": label }, text);
}

function progressOf({ done, of }: { done: number; of: number }): HTMLElement {
  const share = of > 0 ? Math.min(1, done / of) : 0;
  const bar = element("span", { class: "progress", role: "progressbar", "aria-valuemin": 0, "aria-valuemax": of, "aria-valuenow": done, title: `${done} of ${of}` });
  const filled = element("span");
  filled.style.width = `${(100 * share).toFixed(1)}%`;
  bar.append(filled);
  return bar;
}

/** Numbers beside a line or bars, and what they are. */
function beside(numbers: string, words: string): HTMLElement {
  return element("span", { class: "last" }, element("span", {}, numbers), element("span", {}, words));
}

function seriesOf(row: Row, series: SeriesKind | null, loaded: Loaded | undefined, [least, most]: [number, number]): Node[] {
  if (row.spark.length > 0) {
    const title = `${row.spark_words ?? "values"}: ${row.spark.slice(0, 8).map(figure).join(", ")}${row.spark.length > 8 ? ", …" : ""}`;
    const unit = row.first?.unit ?? "";
    const [from, to] = row.kind === "sweep" ? [Math.min(...row.spark), Math.max(...row.spark)] : [row.spark[0], row.spark[row.spark.length - 1]];
    const bare = (value: number): string => withUnit(value, unit).replace(/ .*/, "");
    const numbers = row.spark.length === 1 ? withUnit(to, unit) : `${bare(from)} ${row.kind === "sweep" ? "to" : "→"} ${withUnit(to, unit)}`;
    return [sparkBars(row.spark, title), beside(numbers, row.kind === "sweep" ? `${row.spark.length} settings, medians` : "error, by effect")];
  }
  if (!row.has_series || series === null) return [];
  if (loaded === undefined) return [element("span", { class: "faint" }, "…")];
  if (loaded instanceof Error) return [element("span", { class: "faint", title: loaded.message }, "cannot be read")];
  // While a network forms, robots wait.
  const start = loaded.robots_started_s ?? 0;
  const from = Math.max(0, loaded.time_s.findIndex((timeS) => timeS > start));
  const values = (loaded.values[series.name] ?? []).slice(from);
  const known = values.filter((value) => value !== null);
  if (known.length === 0) return [element("span", { class: "faint" }, "none")];
  const scaled = (value: number): string => (series.unit === "%" ? `${figure(+(100 * value).toPrecision(4))} %` : `${figure(value)}${series.unit === "" ? "" : ` ${series.unit}`}`);
  const last = known[known.length - 1];
  const title = `${series.label} from ${scaled(known[0])} to ${scaled(last)}, at least ${scaled(Math.min(...known))}, at most ${scaled(Math.max(...known))}`;
  const mean = loaded.means[series.name] ?? null;
  return [sparkLine(values, least, most, title), beside(mean === null ? "–" : scaled(+mean.toPrecision(3)), "mean")];
}
