import type { Calls, RunSeries } from "./calls.ts";

/** So many requests are under way at a time. */
const MOST_REQUESTS = 2;
/** Points of the series in a row of the table. */
const FEW_POINTS = 60;
/** Points of the series in the chart. */
export const MANY_POINTS = 600;

/** A series that was asked for: what came, or why nothing did. */
export type Loaded = RunSeries | Error;

/** The series of runs. Those in sight are asked for, the latest first, and kept. */
export class SeriesStore {
  private readonly few = new Map<number, Loaded>();
  private readonly many = new Map<number, Loaded>();
  private wanted: number[] = [];
  private running = 0;

  constructor(
    private readonly calls: Calls,
    private readonly changed: () => void,
  ) {}

  /** The few points of a row, if they are there. */
  row(id: number): Loaded | undefined {
    return this.few.get(id);
  }

  /** The points of the chart, if they are there. */
  chart(id: number): Loaded | undefined {
    return this.many.get(id);
  }

  /** What rows in sight need. Requests for rows that have left are not made any more. */
  want(ids: number[]): void {
    this.wanted = ids.filter((id) => !this.few.has(id));
    this.next();
  }

  async wantChart(id: number): Promise<void> {
    if (this.many.has(id)) return;
    this.many.set(id, await this.load(id, MANY_POINTS));
    this.changed();
  }

  /** Forgets the series of a run that has changed. */
  forget(id: number): void {
    this.few.delete(id);
    this.many.delete(id);
  }

  /** Reads the series of a run that lasts again, and shows the earlier one meanwhile. */
  async renew(id: number): Promise<void> {
    const [few, many] = [this.few.has(id), this.many.has(id)];
    if (!few && !many) return;
    const loaded = await this.load(id, many ? MANY_POINTS : FEW_POINTS);
    if (many) this.many.set(id, loaded);
    if (few) this.few.set(id, many ? thinned(loaded, FEW_POINTS) : loaded);
    this.changed();
  }

  private async load(id: number, points: number): Promise<Loaded> {
    try {
      return await this.calls.series(id, points);
    } catch (error) {
      return error as Error;
    }
  }

  private next(): void {
    while (this.running < MOST_REQUESTS) {
      const id = this.wanted.shift();
      if (id === undefined) return;
      this.running++;
      void this.load(id, FEW_POINTS).then((loaded) => {
        this.few.set(id, loaded);
        this.running--;
        this.changed();
        this.next();
      });
    }
  }
}

/** At most so many points of a series. */
function thinned(loaded: Loaded, points: number): Loaded {
  if (loaded instanceof Error) return loaded;
  const every = Math.max(1, Math.ceil(loaded.time_s.length / points));
  const some = <T>(list: T[]): T[] => list.filter((_, i) => i % every === 0);
  return { ...loaded, time_s: some(loaded.time_s), values: Object.fromEntries(Object.entries(loaded.values).map(([name, values]) => [name, some(values)])) };
}
