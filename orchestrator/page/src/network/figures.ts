import type { MoteStatistics } from "../gen/cosim/v1/netsim_pb.ts";
import { bit } from "../source/wire.ts";

/** A figure of every mote; NaN: not known. */
export interface MoteFigure {
  name: string;
  label: string;
  unit: string;
  values: number[];
}

/** Microcoulombs in a milliampere-hour. */
const UC_PER_MAH = 3.6e6;

function column(statistics: MoteStatistics, name: string): number[] | null {
  const found = statistics.columns.find((candidate) => candidate.name === name);
  if (found === undefined) return null;
  return found.values.map((value, i) => (found.known.length === 0 || bit(found.known, i) ? value : Number.NaN));
}

/** Figures that follow from statistics, and then the statistics themselves. */
export function moteFigures(statistics: MoteStatistics): MoteFigure[] {
  const figures: MoteFigure[] = [];
  const charge = column(statistics, "charge_uc");
  const up = column(statistics, "up_ns");
  const battery = column(statistics, "battery_mah");
  const radio = column(statistics, "radio_on_ns");
  if (charge !== null && up !== null) {
    figures.push({ name: "mean_current", label: "Mean current", unit: "µA", values: charge.map((uc, i) => uc / (up[i] / 1e9)) });
  }
  if (charge !== null && battery !== null) {
    figures.push({ name: "battery_used", label: "Battery used", unit: "%", values: charge.map((uc, i) => (100 * uc) / (battery[i] * UC_PER_MAH)) });
  }
  if (radio !== null && up !== null) {
    figures.push({ name: "duty_cycle", label: "Radio duty cycle", unit: "%", values: radio.map((on, i) => (100 * on) / up[i]) });
  }
  for (const { name, unit } of statistics.columns) figures.push({ name, label: name, unit, values: column(statistics, name) ?? [] });
  return figures;
}
