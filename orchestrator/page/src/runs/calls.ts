/** A figure that results may have. */
export interface FigureKind {
  name: string;
  label: string;
  unit: string;
  better: "higher" | "lower" | "neither";
}

/** A series that runs may have. */
export interface SeriesKind {
  name: string;
  label: string;
  unit: string;
}

export interface About {
  folder: string;
  program: string;
  figures: FigureKind[];
  series: SeriesKind[];
}

export interface FirstFigure {
  /** What filters call it. */
  name: string;
  words: string;
  unit: string;
  is_greater_better: boolean | null;
  value: number;
}

export type Setting = string | number | boolean;

/** What the table has of a result. */
export interface Row {
  id: number;
  name: string;
  kind: string;
  status: string;
  words: string | null;
  /** A command that goes on with it. */
  command: string | null;
  /** Where it is, for commands. */
  path: string;
  when_unix_s: number | null;
  seed: number | null;
  simulated_s: number | null;
  first: FirstFigure | null;
  figures: Record<string, number>;
  n_warnings: number;
  spark: number[];
  spark_words: string | null;
  has_series: boolean;
  has_recording: boolean;
  report: string | null;
  progress: { done: number; of: number } | null;
  settings: Record<string, Setting>;
  /** What a sweep varies. */
  varied: Record<string, Setting[]>;
  /** Names and values, such as the scores of an answer. */
  details: [string, string][];
}

/** What changed after a change that the page knows. */
export interface Changes {
  change: number;
  is_all: boolean;
  rows: Row[];
  removed: number[];
  has_more: boolean;
  n_unread: number;
  is_cut: boolean;
}

/** The series of a run, at the same times. */
export interface RunSeries {
  time_s: number[];
  values: Record<string, (number | null)[]>;
  /** When the robots started (s); null: they have not. */
  robots_started_s: number | null;
  /** Mean of each series from then on. */
  means: Record<string, number | null>;
}

/** Requests to the program that serves the page. Each carries the token of the page's own address. */
export class Calls {
  readonly token = new URLSearchParams(location.search).get("token") ?? "";

  about(): Promise<About> {
    return this.ask("api/about");
  }

  changes(since: number): Promise<Changes> {
    return this.ask(`api/rows?since=${since}`);
  }

  series(id: number, points: number): Promise<RunSeries> {
    return this.ask(`api/series?id=${id}&points=${points}`);
  }

  /** The address of the page that plays a run. */
  player(row: Row): string {
    return `play/${row.id}/?token=${encodeURIComponent(this.token)}`;
  }

  private async ask<Answer>(path: string): Promise<Answer> {
    let response: Response;
    try {
      response = await fetch(path, { headers: { Authorization: `Bearer ${this.token}` }, cache: "no-store" });
    } catch {
      throw new Error("The program that serves this page does not answer. Check that it still runs.");
    }
    if (response.status === 401) throw new Error("This page needs the address that the program printed, with its token.");
    if (!response.ok) {
      const text = (await response.text()).trim();
      throw new Error(text === "" ? `The program answered with status ${response.status}. Reload the page.` : text);
    }
    return (await response.json()) as Answer;
  }
}
