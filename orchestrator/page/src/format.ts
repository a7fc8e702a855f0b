/** Time of the run for people: seconds with as many digits as a step of 1 ms needs. */
export function seconds(timeNs: number, digits = 2): string {
  return `${(timeNs / 1e9).toFixed(digits)} s`;
}

/** Duration from one time to another, for "3.2 s ago". */
export function ago(fromNs: number, untilNs: number): string {
  const s = (untilNs - fromNs) / 1e9;
  if (s < 10) return `${s.toFixed(2)} s`;
  if (s < 100) return `${s.toFixed(1)} s`;
  return `${s.toFixed(0)} s`;
}

/** A number with about four significant digits. */
export function figure(value: number): string {
  if (!Number.isFinite(value)) return "–";
  if (value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e6)) return value.toExponential(2);
  if (Number.isInteger(value)) return String(value);
  const magnitude = Math.abs(value);
  return String(+value.toFixed(magnitude >= 100 ? 1 : magnitude >= 10 ? 2 : 3));
}

/** Step of a scale that is 1, 2 or 5 times a power of ten and at least `least`. */
export function niceStep(least: number): number {
  const power = 10 ** Math.floor(Math.log10(least));
  for (const factor of [1, 2, 5]) if (power * factor >= least) return power * factor;
  return power * 10;
}

/** A text in which a line never ends between a number and its unit. */
export function unbroken(text: string): string {
  return text.replace(/(\d) (?=[a-zA-Zµ%°])/g, "$1\u00A0");
}
