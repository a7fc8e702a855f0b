import type { MeasuredRows, Measurements } from "../gen/murmuration/view/v1/view_pb.ts";
import type { State } from "../store.ts";
import { type Bin, bins } from "./bins.ts";
import { type MeasuredLine, type MeasuredPlace, residualMap } from "./map.ts";

/** Covariates that explain less of the variance than this are not drawn. */
const LEAST_EXPLAINED = 0.005;
/** Curves that are drawn. */
const MOST_CURVES = 8;

/** A covariate with its bins. */
export interface Curve {
  name: string;
  explained: number;
  bins: Bin[];
}

/** Which measured rows are shown: all, or those in the chosen bin of a covariate. */
export class ShownRows {
  readonly rows: MeasuredRows | undefined;
  /** The covariates that explain most, with the residuals of the model as configured in bins. */
  readonly curves: Curve[];
  private key = "";
  private latest: { lines: MeasuredLine[]; places: MeasuredPlace[] } = { lines: [], places: [] };

  constructor(readonly measurements: Measurements) {
    this.rows = measurements.rows;
    const covariates = [...(this.rows?.covariates ?? [])].filter(({ explained }) => explained >= LEAST_EXPLAINED);
    covariates.sort((a, b) => b.explained - a.explained);
    this.curves = covariates.slice(0, MOST_CURVES)
      .map(({ name, explained, value }) => ({ name, explained, bins: bins(value, this.rows?.residual ?? []) }))
      .filter((curve) => curve.bins.length > 1);
  }

  get hasEffects(): boolean {
    return (this.rows?.residualWithEffects.length ?? 0) > 0;
  }

  /** Residuals of the model that is chosen. */
  residual(state: State): number[] {
    if (this.rows === undefined) return [];
    return state.withEffects && this.hasEffects ? this.rows.residualWithEffects : this.rows.residual;
  }

  /** The chosen bin; null: none, or one that these measurements do not have. */
  bin(state: State): { curve: Curve; bin: Bin } | null {
    const [, name, number] = /^(.*):(\d+)$/.exec(state.bin ?? "") ?? [];
    const curve = this.curves.find((candidate) => candidate.name === name);
    const bin = curve?.bins[Number(number)];
    return curve === undefined || bin === undefined ? null : { curve, bin };
  }

  /** What changes the map. */
  mapKey(state: State): string {
    return `${state.bin} ${state.withEffects}`;
  }

  map(state: State): { lines: MeasuredLine[]; places: MeasuredPlace[] } {
    const key = this.mapKey(state);
    if (key !== this.key && this.rows !== undefined) {
      this.key = key;
      const rows = this.bin(state)?.bin.rows ?? this.rows.residual.keys();
      this.latest = residualMap(this.rows, rows, this.residual(state));
    }
    return this.latest;
  }
}
