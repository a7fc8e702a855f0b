import "./style.css";
import { checkbox, element, isTouch, selection, setText } from "../dom.ts";
import { OKABE_ITO } from "../swarm/colours.ts";
import { type About, Calls, type Row, type SeriesKind } from "./calls.ts";
import { type Choices, fragmentOf, INITIAL, parseChoices } from "./choices.ts";
import { type Column, columnsOf, isSortable, sorted } from "./columns.ts";
import { Details } from "./details.ts";
import { type Filter, parseFilter } from "./filter.ts";
import { Overlay } from "./overlay.ts";
import { SeriesStore } from "./series.ts";
import { ResultsTable } from "./table.ts";

/** The program is asked for what is new after this time (ms). */
const POLL_MS = 3000;
/** Runs in the chart. */
const MOST_SELECTED = 8;
/** A flock that is slower stands still (m/s). */
const STILL_MPS = 0.01;
/** Below this width (px), rows are cards. */
const CARDS_PX = 760;

/** Colours of the runs in the chart, in the order in which they are handed out. */
const { blue, orange, green, purple, sky, vermilion } = OKABE_ITO;
const LIGHT = [blue, orange, green, purple, sky, vermilion, "#6b4fa0", "#1b1f24"];
const DARK = ["#4aa3e0", orange, "#2fc39a", purple, OKABE_ITO.yellow, "#f0764a", "#b39ddb", "#e6e8eb"];

/** What tests see of the page. */
interface State {
  total: number;
  rows: string[];
  statuses: Record<string, string>;
  columns: string[];
  sort: string;
  order: string;
  filterProblem: string;
  selected: string[];
  curves: ReturnType<Overlay["state"]>;
}

declare global {
  interface Window {
    murmurationRuns: { ready: Promise<void>; state(): State };
  }
}

const page = document.getElementById("page") as HTMLElement;
const systemDark = window.matchMedia("(prefers-color-scheme: dark)");

class Page {
  private readonly rows = new Map<number, Row>();
  private readonly choices: Choices;
  private readonly series: SeriesStore;
  private readonly table: ResultsTable;
  private readonly overlay: Overlay;
  private readonly search = element("input", {
    type: "search", placeholder: "Filter", "aria-label": "Filter", spellcheck: "false", autocomplete: "off", "aria-describedby": "filter-words",
  });
  private readonly words = element("p", { class: "note", id: "filter-words", role: "status" });
  private readonly trouble = element("p", { class: "trouble", role: "alert", hidden: true });
  private readonly details: Details;
  private readonly nothing = element("div", { class: "nothing", hidden: true });
  private readonly menu = element("div");
  private readonly menuSearch = element("input", { type: "search", placeholder: "Find a column", "aria-label": "Find a column", spellcheck: "false", autocomplete: "off", oninput: () => this.filterMenu() });
  private readonly sortChoice: HTMLSelectElement;
  private readonly sortOrder = element("button", { type: "button", class: "order", onclick: () => this.turn() });
  private change = 0;
  private unread = 0;
  private isCut = false;
  private isComplete = false;
  /** The program did not answer the latest request. */
  private isCutOff = false;
  private columns: Column[] = [];
  private optional = new Map<string, boolean>();
  private filter: Filter = { test: () => true, problem: "", note: "" };
  private shownRows: Row[] = [];
  private menuVersion = "";

  constructor(
    private readonly about: About,
    private readonly calls: Calls,
  ) {
    this.choices = parseChoices(location.hash);
    if (!about.series.some(({ name }) => name === this.choices.series)) this.choices.series = "";
    this.details = new Details(calls);
    this.series = new SeriesStore(calls, () => this.show());
    this.table = new ResultsTable(calls, this.series, { sort: (column) => this.sortBy(column), select: (row, selected) => this.select(row, selected), details: (row) => this.details.show(row) });
    this.overlay = new Overlay(about.series, {
      choose: (changes) => this.choose(changes),
      drop: (row) => void this.select(row, false),
      clear: () => this.choose({ selected: [] }),
    });
    this.search.value = this.choices.filter;
    this.search.addEventListener("input", () => this.choose({ filter: this.search.value }));
    const sort = selection("Sort by", [], "", (key) => {
      const column = this.columns.find((column) => column.key === key);
      if (column !== undefined) this.choose({ sort: key, order: column.firstOrder });
    });
    sort.root.classList.add("sort");
    this.sortChoice = sort.select;
    const theme = element("button", { type: "button", title: "Dark or light", "aria-label": "Dark or light", onclick: () => this.choose({ theme: this.dark ? "light" : "dark" }) }, "◐");
    const menu = element("details", { class: "menu" }, element("summary", {}, "Columns"), element("div", { class: "menu-body" }, this.menuSearch, this.menu));
    menu.addEventListener("toggle", () => {
      if (menu.open && !isTouch()) this.menuSearch.focus();
    });
    document.addEventListener("click", (event) => {
      if (!menu.contains(event.target as Node)) menu.open = false;
    });
    const head = element("header", {}, element("h1", {}, "Results"), element("span", { class: "folder", title: about.folder }, about.folder), element("span", { class: "spring" }), theme);
    const bar = element("div", { class: "bar" }, this.search, sort.root, this.sortOrder, menu);
    page.replaceChildren(element("div", { class: "shell" }, head, bar, this.words, element("main", {}, this.table.root, this.nothing, this.trouble), this.overlay.root), this.details.root);
    systemDark.addEventListener("change", () => this.show());
    window.addEventListener("resize", () => this.show());
    window.addEventListener("hashchange", () => this.choose(parseChoices(location.hash)));
    window.addEventListener("keydown", (event) => {
      if (event.key === "/" && !(event.target instanceof HTMLInputElement)) {
        event.preventDefault();
        this.search.focus();
      }
    });
    this.words.textContent = "Reading the results…";
  }

  get dark(): boolean {
    return this.choices.theme === "" ? systemDark.matches : this.choices.theme === "dark";
  }

  /** Asks for what is new until nothing is left to ask for. */
  async update(): Promise<void> {
    for (;;) {
      const { change, is_all, rows, removed, has_more, n_unread, is_cut } = await this.calls.changes(this.change);
      if (is_all) this.rows.clear();
      for (const row of rows) {
        const before = this.rows.get(row.id);
        const isOther = before !== undefined && (before.when_unix_s !== row.when_unix_s || before.status !== row.status);
        if (isOther) this.series.forget(row.id);
        else if (row.status === "running" && row.has_series) void this.series.renew(row.id);
        this.rows.set(row.id, row);
      }
      for (const id of removed) this.rows.delete(id);
      this.change = change;
      this.unread = n_unread;
      this.isCut = is_cut;
      this.isComplete = !has_more && n_unread === 0;
      if (is_all || rows.length > 0 || removed.length > 0) this.rebuild();
      this.show();
      if (this.isComplete) return;
    }
  }

  /** Asks again and again. */
  async follow(): Promise<void> {
    for (;;) {
      await new Promise((resolve) => setTimeout(resolve, POLL_MS));
      if (document.hidden) continue;
      try {
        await this.update();
        if (this.isCutOff) this.trouble.hidden = true;
        this.isCutOff = false;
      } catch (error) {
        setText(this.trouble, (error as Error).message);
        this.trouble.hidden = false;
        this.isCutOff = true;
      }
    }
  }

  state(): State {
    return {
      total: this.rows.size,
      rows: this.shownRows.map((row) => row.name),
      statuses: Object.fromEntries([...this.rows.values()].map((row) => [row.name, row.status])),
      columns: this.visible().map((column) => column.key),
      sort: this.choices.sort,
      order: this.choices.order,
      filterProblem: this.filter.problem,
      selected: this.choices.selected,
      curves: this.overlay.state(),
    };
  }

  private choose(changes: Partial<Choices>): void {
    Object.assign(this.choices, changes);
    const fragment = fragmentOf(this.choices);
    history.replaceState(null, "", `${location.pathname}${location.search}${fragment === "" ? "" : `#${fragment}`}`);
    if (this.search.value !== this.choices.filter) this.search.value = this.choices.filter;
    this.show();
  }

  private sortBy(column: Column): void {
    const turned = this.choices.order === "ascending" ? "descending" : "ascending";
    this.choose({ sort: column.key, order: this.choices.sort === column.key ? turned : column.firstOrder });
  }

  private turn(): void {
    this.choose({ order: this.choices.order === "ascending" ? "descending" : "ascending" });
  }

  private select(row: Row, selected: boolean): boolean {
    const others = this.choices.selected.filter((name) => name !== row.name);
    if (selected && others.length >= MOST_SELECTED) {
      setText(this.trouble, `The chart has at most ${MOST_SELECTED} runs: take one out first.`);
      this.trouble.hidden = false;
      return false;
    }
    this.trouble.hidden = true;
    this.choose({ selected: selected ? [...others, row.name] : others });
    return selected;
  }

  /** Finds the columns anew after rows have changed. */
  private rebuild(): void {
    const { all, optional } = columnsOf(this.about, [...this.rows.values()]);
    this.columns = all;
    this.optional = optional;
    this.search.placeholder = this.placeholder();
    if (!all.some((column) => column.key === this.choices.sort && isSortable(column))) this.choices.sort = INITIAL.sort;
  }

  /** A filter for example, of columns that are there. */
  private placeholder(): string {
    const rows = [...this.rows.values()];
    const columns = this.visible();
    const conditions = columns.flatMap((column) => {
      if (column.kind !== "setting") return [];
      const values = rows.flatMap((row) => column.values?.(row) ?? []).filter((value) => value !== null && /^[\w.-]{1,12}$/.test(String(value)));
      return values.length === 0 ? [] : [`${column.label}=${values[0]}`];
    });
    const condition = conditions[0] ?? "kind=run";
    if (window.innerWidth < CARDS_PX) return `Filter: ${condition}`;
    const share = this.about.figures.find(({ name, unit }) => unit === "%" && columns.some(({ key }) => key === name));
    const shares = rows.flatMap((row) => (share === undefined ? [] : (row.figures[share.name] ?? []))).sort((a, b) => a - b);
    const less = share === undefined || shares.length === 0 ? [] : [`${share.name}<${Math.ceil(100 * shares[shares.length >> 1])}%`];
    return `Filter: a word, ${[condition, ...less, "status!=complete"].join(", ")}`;
  }

  /** The series that the user has chosen, or one that the runs have; null: no row has any. */
  private shownSeries(): SeriesKind | null {
    const rows = [...this.rows.values()].filter((row) => row.has_series);
    if (rows.length === 0) return null;
    const move = rows.some((row) => row.status === "running" || (row.figures["flock_speed"] ?? 0) > STILL_MPS);
    const name = this.choices.series !== "" ? this.choices.series : move ? "flock_speed" : "neighbours";
    return this.about.series.find((kind) => kind.name === name) ?? this.about.series[0];
  }

  private visible(): Column[] {
    return this.columns.filter(({ key }) => !this.optional.has(key) || (this.choices.shown[key] ?? this.optional.get(key)));
  }

  private show(): void {
    document.documentElement.dataset["theme"] = this.dark ? "dark" : "light";
    const { choices } = this;
    this.filter = parseFilter(choices.filter, this.columns);
    const column = this.columns.find(({ key }) => key === choices.sort);
    const passing = [...this.rows.values()].filter(this.filter.test);
    this.shownRows = column === undefined ? passing : sorted(passing, column, choices.order);
    const drawn = this.drawn();
    const series = this.shownSeries();
    const isCards = window.innerWidth < CARDS_PX;
    this.table.root.classList.toggle("cards", isCards);
    this.table.show({
      columns: this.visible(), rows: this.shownRows, sort: choices.sort, order: choices.order, series,
      colours: new Map(drawn.map(({ row, colour }) => [row.id, colour])), isCards, nowS: Date.now() / 1000,
    });
    this.overlay.root.hidden = series === null;
    this.overlay.show(series ?? this.about.series[0], drawn, choices, this.dark);
    this.showWords();
    this.showMenu();
  }

  /** The selected runs with their colours. What is not loaded yet is asked for. */
  private drawn(): Parameters<Overlay["show"]>[1] {
    const byName = new Map([...this.rows.values()].filter((row) => row.has_series).map((row) => [row.name, row]));
    const colours = this.dark ? DARK : LIGHT;
    return this.choices.selected.flatMap((name, i) => {
      const row = byName.get(name);
      if (row === undefined) return [];
      const loaded = this.series.chart(row.id);
      if (loaded === undefined) void this.series.wantChart(row.id);
      return [{ row, colour: colours[i % colours.length], loaded }];
    });
  }

  private showWords(): void {
    const [n, all] = [this.shownRows.length, this.rows.size];
    const counted = n === all ? `${all} ${all === 1 ? "result" : "results"}` : `${n} of ${all} results`;
    const running = this.shownRows.filter((row) => row.status === "running").length;
    const parts = [this.filter.problem, this.filter.note, counted];
    if (running > 0) parts.push(`${running} running`);
    if (this.unread > 0) parts.push(`reading ${this.unread} more`);
    if (this.isCut) parts.push("the folder holds more than is listed: open a folder within it");
    setText(this.words, parts.filter((part) => part !== "").join(" · "));
    this.words.classList.toggle("problem", this.filter.problem !== "");
    const isEmpty = n === 0 && this.isComplete;
    this.nothing.hidden = !isEmpty;
    if (isEmpty) {
      const clear = element("button", { type: "button", onclick: () => this.choose({ filter: "" }) }, "Clear the filter");
      const empty = element("p", {}, `The folder holds no result any more. \`${this.about.program} run experiment.toml\` makes one.`);
      this.nothing.replaceChildren(...(all === 0 ? [empty] : [element("p", {}, "No result passes the filter."), ...(this.filter.note === "" ? [] : [element("p", {}, `${this.filter.note}.`)]), clear]));
    }
  }

  private showMenu(): void {
    const sortable = this.visible().filter(isSortable);
    const version = JSON.stringify([this.columns.map(({ key }) => key), this.choices.shown, this.choices.sort, this.choices.order]);
    if (version === this.menuVersion) return;
    this.menuVersion = version;
    this.sortChoice.replaceChildren(...sortable.map((column) => element("option", { value: column.key }, column.label)));
    this.sortChoice.value = this.choices.sort;
    setText(this.sortOrder, this.choices.order === "ascending" ? "▲" : "▼");
    this.sortOrder.setAttribute("aria-label", `Sorted ${this.choices.order}; turn round`);
    const boxes = (kind: Column["kind"]): HTMLElement[] =>
      this.columns.filter((column) => column.kind === kind && this.optional.has(column.key)).map((column) => {
        const box = checkbox(kind === "setting" ? column.key : column.label, column.title, (shown) => this.choose({ shown: { ...this.choices.shown, [column.key]: shown } }));
        box.input.checked = this.choices.shown[column.key] ?? this.optional.get(column.key) ?? false;
        return box.root;
      });
    const [figures, settings] = [boxes("figure"), boxes("setting")];
    const none = (text: string): HTMLElement => element("p", { class: "note" }, text);
    this.menu.replaceChildren(
      element("h3", {}, "Figures"), ...(figures.length > 0 ? figures : [none("No result has any of the figures.")]),
      element("h3", {}, "Configuration: keys that differ"), ...(settings.length > 0 ? settings : [none("The configurations of all runs are the same.")]),
    );
    this.filterMenu();
  }

  /** Hides what the search box of the menu does not name. */
  private filterMenu(): void {
    const wanted = this.menuSearch.value.trim().toLowerCase();
    for (const label of this.menu.querySelectorAll<HTMLElement>("label")) {
      label.hidden = !`${label.textContent} ${label.title}`.toLowerCase().includes(wanted);
    }
  }
}

function showFailure(error: Error): void {
  page.replaceChildren(element("div", { class: "failure", role: "alert" }, element("h1", {}, "Results"), element("p", {}, error.message)));
}

async function start(): Promise<Page> {
  const calls = new Calls();
  const shown = new Page(await calls.about(), calls);
  await shown.update();
  void shown.follow();
  return shown;
}

let shown: Page | null = null;
window.murmurationRuns = {
  ready: start().then((started) => {
    shown = started;
  }),
  state: () => (shown as Page).state(),
};
window.murmurationRuns.ready.catch(showFailure);
