const WIDTH = 120;
const HEIGHT = 26;
const NAMESPACE = "http://www.w3.org/2000/svg";

function drawing(title: string, shape: SVGElement): SVGSVGElement {
  const svg = document.createElementNS(NAMESPACE, "svg");
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.setAttribute("class", "spark");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", title);
  const words = document.createElementNS(NAMESPACE, "title");
  words.textContent = title;
  svg.append(words, shape);
  return svg;
}

function path(d: string, kind: string): SVGElement {
  const made = document.createElementNS(NAMESPACE, "path");
  made.setAttribute("d", d);
  made.setAttribute("class", kind);
  return made;
}

const round = (value: number): string => value.toFixed(1);

/** A line over time on a scale that it shares with others. */
export function sparkLine(values: (number | null)[], least: number, most: number, title: string): SVGSVGElement {
  const span = most > least ? most - least : 1;
  let d = "";
  let pen = "M";
  values.forEach((value, i) => {
    if (value === null) {
      pen = "M";
      return;
    }
    const x = 1 + ((WIDTH - 2) * i) / Math.max(1, values.length - 1);
    const y = HEIGHT - 2 - ((HEIGHT - 4) * (value - least)) / span;
    d += `${pen}${round(x)} ${round(y)}`;
    pen = "L";
  });
  return drawing(title, path(d, "line"));
}

/** Bars from zero, such as the medians of settings. */
export function sparkBars(values: number[], title: string): SVGSVGElement {
  const least = Math.min(0, ...values);
  const most = Math.max(0, ...values);
  const span = most > least ? most - least : 1;
  const step = Math.min(16, WIDTH / values.length);
  const y = (value: number): number => HEIGHT - 1 - ((HEIGHT - 2) * (value - least)) / span;
  const bars = values.map((value, i) => `M${round(i * step + step * 0.1)} ${round(y(0))}V${round(y(value))}h${round(step * 0.8)}V${round(y(0))}z`);
  return drawing(title, path(bars.join(""), "bars"));
}
