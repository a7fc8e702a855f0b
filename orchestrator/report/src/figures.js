// Gives each figure of a page its buttons, values where the reader points, zoom, and keys that switch series off and on.
// The data of a picture stand after it, compressed; svg/data.rs says what is in them.
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const all = (within, selector) => [...within.querySelectorAll(selector)];
  const element = (name, attributes, ...inside) => {
    const made = name.includes(":") ? document.createElementNS(SVG, name.slice(4)) : document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...inside);
    return made;
  };
  const classes = (mark) => (mark.dataset.of ?? mark.getAttribute("class") ?? "").split(" ");

  const unpacked = async (script) => {
    const packed = Uint8Array.from(atob(script.textContent), (letter) => letter.charCodeAt(0));
    const bytes = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return JSON.parse(await new Response(bytes).text());
  };

  // Numbers and labels.
  const words = (label) => /^(.*?)(?: \(([^()]*)\))?$/.exec(label).slice(1);
  const exact = (axis, value) => {
    if (value === null || value === undefined) return "";
    if (axis.names.length) return axis.names[Math.round(value)] ?? "";
    return String(axis.percent ? Number((100 * value).toPrecision(15)) : value);
  };
  const plain = (axis, value) => {
    if (axis.names.length) return exact(axis, value);
    const number = Number((axis.percent ? 100 * value : value).toPrecision(5));
    const text = Math.abs(number) < 1e6 && (1e-4 <= Math.abs(number) || !number) ? String(number) : number.toExponential();
    return text.replace("-", "−");
  };
  const shown = (axis, value) => {
    const unit = axis.percent ? "%" : words(axis.label)[1];
    return plain(axis, value) + (unit && !["count", "number", "rank", "ratio"].includes(unit) ? ` ${unit}` : "");
  };

  // What the columns of a series are: x, y, low, high of either axis.
  const COLUMNS = {
    line: "x y", dots: "x y", band: "x low high", intervals: "x y low high", segments: "x y x2 y2",
    rectangles: "x y x2 y2", levels: "y", moments: "x", spans: "x x2",
  };
  const rows = (series) => {
    const names = COLUMNS[series.kind].split(" ");
    return series.columns[0].map((_, row) => {
      const cells = Object.fromEntries(names.map((name, column) => [name, series.columns[column][row]]));
      return { ...cells, name: series.names?.[row] ?? "" };
    });
  };

  class Chart {
    constructor(svg, script) {
      this.svg = svg;
      this.script = script;
      this.figure = svg.closest("figure");
      // The pictures of earlier periods are folded away, each on its own.
      this.host = svg.closest("figure details, figure");
      this.marks = svg.querySelector(".marks");
      this.panel = svg.closest(".panel")?.querySelector(".panel-name")?.textContent ?? "";
      this.id = svg.getAttribute("aria-labelledby").split("-title")[0];
      this.view = null;
    }

    async load() {
      if (this.data) return;
      this.loading ??= unpacked(this.script);
      this.data = await this.loading;
      this.plane = this.data.plane;
      for (const series of this.data.series) {
        const named = nearestKey(this.figure.keys, series.class.split(" "))?.words;
        series.words = named ?? this.data.words[series.class] ?? KINDS[series.kind] ?? series.class;
        series.rows ??= rows(series);
      }
      all(this.svg, ".interval > title").forEach((title) => title.remove());
      this.home = { marks: this.marks.cloneNode(true), axes: this.svg.querySelector(".axes")?.cloneNode(true) };
    }

    // Where a value lies, from 0 to 1, and the value there.
    share(axis, value) {
      return axis.log ? Math.log(value / axis.min) / Math.log(axis.max / axis.min) : (value - axis.min) / (axis.max - axis.min);
    }
    value(axis, share) {
      return axis.log ? axis.min * (axis.max / axis.min) ** share : axis.min + share * (axis.max - axis.min);
    }

    // A place in the unzoomed picture, and where it is drawn now.
    place(x, y) {
      const [left, top, right, bottom] = this.plane;
      const { x: ax, y: ay, transposed } = this.data;
      const along = (axis, value, from, to) => (value === undefined ? (from + to) / 2 : from + this.share(axis, value) * (to - from));
      return transposed ? [along(ay, y, left, right), along(ax, x, top, bottom)] : [along(ax, x, left, right), along(ay, y, bottom, top)];
    }
    zoomed([x, y]) {
      if (!this.view) return [x, y];
      const [left, top, right, bottom] = this.plane;
      const [x0, y0, x1, y1] = this.view;
      return [left + ((x - x0) / (x1 - x0)) * (right - left), top + ((y - y0) / (y1 - y0)) * (bottom - top)];
    }

    // Points that can be pointed at: place, series, row.
    points() {
      const pointed = this.data.series.filter((series) => !["levels", "spans"].includes(series.kind));
      return this.known ??= pointed.flatMap((series) => series.rows.flatMap((row) => {
        const middle = (a, b) => (b === undefined ? a : (a + b) / 2);
        const ys = series.kind === "band" ? [row.low, row.high] : [middle(row.y, row.y2)];
        if (row.x === null || row.y === null) return [];
        return ys.map((y) => {
          const [px, py] = this.place(middle(row.x, row.x2), y);
          return { at: this.zoomed([px + (series.shift ?? 0), py]), series, row };
        });
      }));
    }
    isOff(series) {
      return nearestKey(this.figure.keys, series.class.split(" "))?.off;
    }
    isInside([x, y]) {
      const [left, top, right, bottom] = this.plane;
      return left - 1 <= x && x <= right + 1 && top - 1 <= y && y <= bottom + 1;
    }
    nearest([x, y]) {
      let best = null;
      let least = 40 ** 2;
      for (const point of this.points()) {
        const dx = point.at[0] - x;
        let dy = point.at[1] - y;
        const { kind } = point.series;
        if (kind === "moments") dy = 0;
        // Edges of bands and moments give way to points.
        const distance = dx * dx + dy * dy + (["band", "moments"].includes(kind) ? 64 : 0);
        if (distance < least && this.isInside(point.at) && !this.isOff(point.series)) [best, least] = [point, distance];
      }
      return best;
    }

    show(point) {
      this.hide();
      if (!point) return;
      this.shownPoint = point;
      const { series, row } = point;
      const { x, y } = this.data;
      const between = (axis, low, high) => `${plain(axis, low)} to ${shown(axis, high)}`;
      const value = (axis, from, to) => [words(axis.label)[0], to === undefined ? shown(axis, from) : between(axis, from, to)];
      const list = [];
      if (row.x !== undefined) list.push(value(x, row.x, row.x2));
      if (row.y !== undefined) list.push(value(y, row.y, row.y2));
      if (row.low !== undefined && row.low !== row.high) list.push([row.y === undefined ? words(y.label)[0] : "interval", between(y, row.low, row.high)]);
      const title = (series.class === "interval" && row.name) || [series.words, series.item, row.name].filter(Boolean).join(" · ");
      const box = element("div", { class: "values", role: "status" }, element("strong", {}, title));
      for (const [name, text] of list) box.append(element("div", {}, `${name}: `, element("b", {}, text)));
      const parent = this.svg.parentElement;
      parent.classList.add("with-values");
      parent.append(box);
      const [frame, around] = [this.svg.getBoundingClientRect(), parent.getBoundingClientRect()];
      const scale = frame.width / this.svg.viewBox.baseVal.width;
      const [px, py] = [frame.left - around.left + scale * point.at[0], frame.top - around.top + scale * point.at[1]];
      const room = around.width - box.offsetWidth;
      box.style.left = `${Math.max(0, Math.min(room, px - box.offsetWidth / 2))}px`;
      box.style.top = `${py - box.offsetHeight - 14 < -around.top ? py + 14 : py - box.offsetHeight - 14}px`;
      this.svg.append(element("svg:circle", { class: "pointed", cx: point.at[0], cy: point.at[1], r: 6 }));
    }
    hide() {
      this.shownPoint = null;
      this.svg.parentElement.querySelector(":scope > .values")?.remove();
      all(this.svg, ".pointed").forEach((mark) => mark.remove());
    }

    // The next point of the series, or the same place in the next series.
    step(along, across) {
      const points = this.points().filter((point) => this.isInside(point.at) && !this.isOff(point.series));
      if (!points.length) return;
      const now = points.includes(this.shownPoint) ? this.shownPoint : null;
      if (!now) return this.show(points[0]);
      const groups = [...new Set(points.map((point) => point.series))];
      const own = (series) => points.filter((point) => point.series === series).sort((a, b) => a.at[0] - b.at[0] || a.at[1] - b.at[1]);
      if (along) {
        const list = own(now.series);
        return this.show(list[(list.indexOf(now) + along + list.length) % list.length]);
      }
      const list = own(groups[(groups.indexOf(now.series) + across + groups.length) % groups.length]);
      const away = (point) => Math.abs(point.at[0] - now.at[0]);
      this.show(list.reduce((best, point) => (away(point) < away(best) ? point : best)));
    }

    // Axes that can be stretched: numbers, not names.
    get stretches() {
      if (!this.home.axes || this.data.transposed) return [false, false];
      return [!this.data.x.names.length, !this.data.y.names.length];
    }
    zoom(window) {
      const [left, top, right, bottom] = this.plane;
      const [canX, canY] = this.stretches;
      if (!canX && !canY) return;
      let [x0, y0, x1, y1] = window ?? this.plane;
      if (this.data.map) {
        const factor = Math.max((x1 - x0) / (right - left), (y1 - y0) / (bottom - top));
        const [mx, my, w, h] = [(x0 + x1) / 2, (y0 + y1) / 2, (factor * (right - left)) / 2, (factor * (bottom - top)) / 2];
        [x0, x1, y0, y1] = [mx - w, mx + w, my - h, my + h];
      }
      if (!canX) [x0, x1] = [left, right];
      if (!canY) [y0, y1] = [top, bottom];
      const isAll = right - left <= x1 - x0 + 0.01 && bottom - top <= y1 - y0 + 0.01;
      const isTiny = x1 - x0 < (right - left) / MOST_ZOOM || y1 - y0 < (bottom - top) / MOST_ZOOM;
      if (isTiny) return;
      this.view = isAll ? null : [x0, y0, x1, y1];
      this.hide();
      this.known = null;
      this.redraw();
      this.host.resetButton.hidden = !this.figure.charts.some((chart) => chart.host === this.host && chart.view);
    }
    // Zooms by a factor about a point of the picture as it is drawn now.
    zoomAbout([x, y], factor) {
      const [left, top, right, bottom] = this.plane;
      const [x0, y0, x1, y1] = this.view ?? this.plane;
      const [u, v] = [x0 + ((x - left) / (right - left)) * (x1 - x0), y0 + ((y - top) / (bottom - top)) * (y1 - y0)];
      const clamp = (low, high, least, most) => (high - low >= most - least ? [least, most] : low < least ? [least, least + high - low] : most < high ? [most - high + low, most] : [low, high]);
      const [a, b] = clamp(u - (u - x0) / factor, u + (x1 - u) / factor, left, right);
      const [c, d] = clamp(v - (v - y0) / factor, v + (y1 - v) / factor, top, bottom);
      this.zoom([a, c, b, d]);
    }
    redraw() {
      const fresh = this.home.marks.cloneNode(true);
      const axes = this.home.axes.cloneNode(true);
      this.marks.replaceWith(fresh);
      this.marks = fresh;
      this.svg.querySelector(".axes").replaceWith(axes);
      this.figure.keys.forEach((key) => key.apply(this.marks));
      if (!this.view) return;
      const [left, top, right, bottom] = this.plane;
      const move = (x, y) => this.zoomed([x, y]);
      const fixed = (number) => number.toFixed(1);
      const lines = this.data.series.filter((series) => series.kind === "line");
      for (const path of all(fresh, "path")) {
        let at = [0, 0];
        const d = path.getAttribute("d").replace(/([MLHV])([-\d.,]+)/g, (_, command, numbers) => {
          const [a, b] = numbers.split(",").map(Number);
          at = command === "H" ? [a, at[1]] : command === "V" ? [at[0], a] : [a, b];
          const [x, y] = move(...at);
          return command + (command === "H" ? fixed(x) : command === "V" ? fixed(y) : `${fixed(x)},${fixed(y)}`);
        });
        // Lines anew, from all of their points.
        const line = path.closest("clipPath") ? -1 : lines.findIndex((series) => series.class === path.getAttribute("class"));
        const [series] = line < 0 ? [] : lines.splice(line, 1);
        path.setAttribute("d", series?.rows.map((row, place, all) => {
          if (row.x === null) return "";
          const [px, py] = this.place(row.x, row.y);
          const [x, y] = move(px + (series.shift ?? 0), py);
          return `${place && all[place - 1].x !== null ? "L" : "M"}${fixed(x)},${fixed(y)}`;
        }).join("") ?? d);
      }
      const factor = (right - left) / (this.view[2] - this.view[0]);
      for (const circle of all(fresh, "circle")) {
        const [x, y] = move(Number(circle.getAttribute("cx")), Number(circle.getAttribute("cy")));
        circle.setAttribute("cx", x);
        circle.setAttribute("cy", y);
        if (circle.hasAttribute("data-scaled")) circle.setAttribute("r", factor * Number(circle.getAttribute("r")));
      }
      for (const text of all(fresh, "text[x]")) {
        const [x, y] = [Number(text.getAttribute("x")), Number(text.getAttribute("y"))];
        // What stands beside the end of a line stays there.
        const [to, down] = move(x, y);
        text.setAttribute("x", text.dataset.of === "level" ? x : to);
        text.setAttribute("y", text.dataset.of === "moment" ? y : down);
      }
      all(fresh, "text[transform]").forEach((text) => text.remove());
      const clip = element("svg:clipPath", { id: `${this.id}-zoom` }, element("svg:rect", { x: left - 4, y: top - 4, width: right - left + 8, height: bottom - top + 8 }));
      fresh.prepend(clip);
      fresh.setAttribute("clip-path", `url(#${clip.id})`);
      this.ticks(axes, 0);
      this.ticks(axes, 1);
    }
    // Ticks of an axis as it is stretched: 0 for x, 1 for y.
    ticks(axes, of) {
      if (!this.stretches[of]) return;
      const [left, top, right, bottom] = this.plane;
      const axis = of ? this.data.y : this.data.x;
      const share = (pixel) => (of ? (bottom - pixel) / (bottom - top) : (pixel - left) / (right - left));
      const [low, high] = of ? [share(this.view[3]), share(this.view[1])] : [share(this.view[0]), share(this.view[2])];
      const [min, max] = [this.value(axis, low), this.value(axis, high)];
      all(axes, ".tick").filter((tick) => (tick.getAttribute("text-anchor") === "end") === Boolean(of)).forEach((tick) => tick.remove());
      all(axes, ".grid").filter((grid) => grid.getAttribute("d").includes("H") === Boolean(of)).forEach((grid) => grid.remove());
      const times = axis.percent ? 100 : 1;
      const rough = (times * (max - min)) / Math.max(2, of ? (bottom - top) / 45 : (right - left) / 90);
      const power = 10 ** Math.floor(Math.log10(rough));
      const step = power * [1, 2, 5, 10].find((digit) => rough <= digit * power * 1.000001);
      const decimals = Math.max(0, Math.min(15, -Math.floor(Math.log10(step) + 1e-9)));
      for (let k = Math.ceil((times * min) / step - 1e-9); k * step <= times * max + 1e-9 * step; k += 1) {
        const place = this.zoomed(of ? this.place(axis.min, (k * step) / times) : this.place((k * step) / times, axis.min))[of];
        const grid = of ? `M${left},${place}H${right}` : `M${place},${top}V${bottom}`;
        const text = (k * step).toFixed(decimals).replace("-", "−") + (axis.percent ? " %" : "");
        axes.prepend(element("svg:path", { class: "grid", d: grid }));
        const at = of ? { x: left - 7, y: place + 4, "text-anchor": "end" } : { x: place, y: bottom + 17, "text-anchor": "middle" };
        axes.append(element("svg:text", { class: "tick", ...at }, text));
      }
    }

    // Where a pointer is, in pixels of the picture.
    at(event) {
      const frame = this.svg.getBoundingClientRect();
      const scale = this.svg.viewBox.baseVal.width / frame.width;
      return [(event.clientX - frame.left) * scale, (event.clientY - frame.top) * scale];
    }
    listen() {
      const { svg } = this;
      svg.tabIndex = 0;
      svg.setAttribute("aria-description", "Arrow keys read the values; plus, minus and 0 zoom.");
      let from = null;
      let frame = null;
      const drag = (event) => {
        const [x, y] = this.at(event);
        const [left, top, right, bottom] = this.plane;
        const [canX, canY] = this.stretches;
        let [x0, x1] = [from[0], x].map((side) => Math.max(left, Math.min(right, side))).sort((a, b) => a - b);
        let [y0, y1] = [from[1], y].map((side) => Math.max(top, Math.min(bottom, side))).sort((a, b) => a - b);
        // A drag along an axis is a range of that axis.
        if (!canX || (!this.data.map && x1 - x0 < 10)) [x0, x1] = [left, right];
        if (!canY || (!this.data.map && y1 - y0 < 10)) [y0, y1] = [top, bottom];
        return [x0, y0, x1, y1];
      };
      svg.addEventListener("pointerenter", () => this.load());
      svg.addEventListener("focus", () => this.load());
      svg.addEventListener("pointerdown", async (event) => {
        await this.load();
        if (event.pointerType !== "mouse") return this.show(this.nearest(this.at(event)));
        if (event.button === 0 && this.isInside(this.at(event)) && this.stretches.some(Boolean)) from = this.at(event);
      });
      svg.addEventListener("pointermove", (event) => {
        if (!this.data || event.pointerType === "touch") return;
        const [x, y] = this.at(event);
        if (!from || Math.hypot(x - from[0], y - from[1]) < 8) return this.show(this.nearest([x, y]));
        this.hide();
        const [x0, y0, x1, y1] = drag(event);
        if (!frame) svg.setPointerCapture(event.pointerId);
        frame?.remove();
        frame = element("svg:rect", { class: "zoom-frame", x: x0, y: y0, width: x1 - x0, height: y1 - y0 });
        svg.append(frame);
      });
      svg.addEventListener("pointerup", (event) => {
        const isDrag = frame !== null;
        frame?.remove();
        const [x0, y0, x1, y1] = isDrag ? drag(event) : [];
        [from, frame] = [null, null];
        if (!isDrag) return;
        const [left, top, right, bottom] = this.plane;
        const [u0, v0, u1, v1] = this.view ?? this.plane;
        const back = (pixel, start, end, low, high) => low + ((pixel - start) / (end - start)) * (high - low);
        this.zoom([back(x0, left, right, u0, u1), back(y0, top, bottom, v0, v1), back(x1, left, right, u0, u1), back(y1, top, bottom, v0, v1)]);
      });
      svg.addEventListener("pointerleave", (event) => {
        if (event.pointerType !== "touch") this.hide();
      });
      svg.addEventListener("blur", () => this.hide());
      svg.addEventListener("dblclick", () => this.view && this.zoom(null));
      svg.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.metaKey) return;
        event.preventDefault();
        if (this.data && this.stretches.some(Boolean)) this.zoomAbout(this.at(event), event.deltaY < 0 ? 1.25 : 0.8);
      }, { passive: false });
      svg.addEventListener("keydown", async (event) => {
        const keys = {
          ArrowRight: () => this.step(1, 0), ArrowLeft: () => this.step(-1, 0), ArrowDown: () => this.step(0, 1), ArrowUp: () => this.step(0, -1),
          Escape: () => this.hide(), "+": () => this.zoomAbout(this.middle, 1.5), "=": () => this.zoomAbout(this.middle, 1.5),
          "-": () => this.zoomAbout(this.middle, 1 / 1.5), 0: () => this.zoom(null),
        };
        if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        await this.load();
        keys[event.key]();
      });
    }
    get middle() {
      const [left, top, right, bottom] = this.plane;
      return this.shownPoint?.at ?? [(left + right) / 2, (top + bottom) / 2];
    }

    // The picture with its style in it, in the colours of light ground.
    alone() {
      const copy = this.svg.cloneNode(true);
      all(copy, ".pointed, .zoom-frame").forEach((mark) => mark.remove());
      const box = element("div", { style: "position:absolute;left:-9999px;width:600px" });
      for (const [name, value] of lightColours()) box.style.setProperty(name, value);
      copy.style.font = "12px system-ui, sans-serif";
      box.append(copy);
      this.svg.parentElement.append(box);
      const style = (mark) => {
        const computed = getComputedStyle(mark);
        return Object.fromEntries(STYLED.map((name) => [name, computed.getPropertyValue(name)]));
      };
      const marks = [copy, ...all(copy, "*")];
      const styles = new Map(marks.map((mark) => [mark, style(mark)]));
      for (const [mark, own] of styles) {
        const above = styles.get(mark.parentNode) ?? {};
        for (const name of STYLED) if (own[name] !== above[name]) mark.setAttribute(name, own[name]);
        if (getComputedStyle(mark).display === "none" && !mark.closest("title, desc, clipPath")) mark.setAttribute("display", "none");
        for (const name of ["class", "data-of", "data-scaled", "tabindex", "aria-description"]) mark.removeAttribute(name);
      }
      all(copy, "[display=none]").forEach((mark) => mark.remove());
      box.remove();
      copy.removeAttribute("style");
      const { width, height } = this.svg.viewBox.baseVal;
      copy.setAttribute("width", width);
      copy.setAttribute("height", height);
      return copy;
    }
  }

  // More than this a picture is not enlarged.
  const MOST_ZOOM = 200;
  const STYLED = [
    "fill", "fill-opacity", "stroke", "stroke-width", "stroke-opacity", "stroke-dasharray", "stroke-linecap", "stroke-linejoin",
    "paint-order", "font-family", "font-size", "font-weight",
  ];
  // What marks are called that no key explains.
  const KINDS = { levels: "level", moments: "event", spans: "span", intervals: "value with interval" };
  const lightColours = () => [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules])
    .filter((rule) => rule.selectorText === ":root")
    .flatMap((rule) => [...rule.style].filter((name) => name.startsWith("--")).map((name) => [name, rule.style.getPropertyValue(name)]));

  // The entry of a key that says what a mark of these classes is: the one with most classes of those whose classes it has all.
  const nearestKey = (keys, own) => keys.filter((key) => key.classes.every((name) => own.includes(name)))
    .sort((a, b) => b.classes.length - a.classes.length)[0];

  const save = (name, kind, text) => {
    const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: kind })), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  };
  const fileName = (charts, end) => {
    const words = `${document.title} ${charts[0].id}`.toLowerCase().replace(/[^a-z0-9]+/g, "-");
    return `${words.replace(/^-|-$/g, "").slice(0, 80)}.${end}`;
  };

  // RFC 4180: a header, then a row for each number or pair of numbers that is drawn.
  const table = (charts) => {
    const { x, y } = charts[0].data;
    const label = (axis, what) => {
      const [name, unit] = words(axis.label);
      return (name || "value") + (what ? `, ${what}` : "") + (unit || axis.percent ? ` (${unit ?? "%"})` : "");
    };
    const columns = [
      ["panel", (row) => row.panel], ["series", (row) => row.series.words], ["of", (row) => row.series.item],
      [label(x), (row) => exact(x, row.x)], [label(x, "to"), (row) => exact(x, row.x2)],
      [label(y), (row) => exact(y, row.y)], [label(y, "to"), (row) => exact(y, row.y2)],
      [label(y, "low"), (row) => exact(y, row.low)], [label(y, "high"), (row) => exact(y, row.high)], ["point", (row) => row.name],
    ];
    const lines = charts.flatMap((chart) => chart.data.series.flatMap((series) => series.rows
      .filter((row) => row.x !== null && row.y !== null).map((row) => ({ ...row, series, panel: chart.panel }))));
    const kept = columns.filter(([, cell]) => lines.some((row) => cell(row)));
    const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const line = (cells) => cells.map((cell) => quoted(cell ?? "")).join(",");
    return [line(kept.map(([name]) => name)), ...lines.map((row) => line(kept.map(([, cell]) => cell(row))))].join("\r\n") + "\r\n";
  };

  // All pictures of a figure in one file, in columns as on the page.
  const picture = (charts) => {
    const [gap, head] = [16, charts.some((chart) => chart.panel) ? 22 : 0];
    const first = charts[0].svg.getBoundingClientRect().left;
    const starts = charts.map((chart, place) => (place && Math.abs(chart.svg.getBoundingClientRect().left - first) < 2 ? place : 0)).filter(Boolean);
    const columns = starts[0] ?? charts.length;
    const box = (chart) => chart.svg.viewBox.baseVal;
    const [width, height] = [Math.max(...charts.map((chart) => box(chart).width)), Math.max(...charts.map((chart) => box(chart).height))];
    const size = [columns * (width + gap) - gap, Math.ceil(charts.length / columns) * (height + head + gap) - gap];
    const whole = element("svg:svg", { xmlns: SVG, width: size[0], height: size[1], viewBox: `0 0 ${size.join(" ")}` });
    whole.append(element("svg:rect", { width: size[0], height: size[1], fill: "#fff" }));
    charts.forEach((chart, place) => {
      const [left, top] = [(place % columns) * (width + gap), Math.floor(place / columns) * (height + head + gap)];
      if (head) {
        const name = { x: left + 2, y: top + 15, fill: "#1b1f24", "font-size": 13, "font-weight": 600, "font-family": "system-ui, sans-serif" };
        whole.append(element("svg:text", name, chart.panel));
      }
      const inside = chart.alone();
      inside.setAttribute("x", left);
      inside.setAttribute("y", top + head);
      whole.append(inside);
    });
    return new XMLSerializer().serializeToString(whole);
  };

  const button = (text, title, click) => {
    const made = element("button", { type: "button", title }, text);
    made.addEventListener("click", click);
    return made;
  };

  class Key {
    constructor(entry, figure) {
      this.words = entry.textContent.trim();
      this.classes = classes(entry.querySelector("svg > *"));
      this.off = false;
      const made = button("", "Hide or show", () => {
        this.off = !this.off;
        made.setAttribute("aria-pressed", String(!this.off));
        figure.charts.forEach((chart) => {
          chart.hide();
          this.apply(chart.marks);
        });
      });
      made.setAttribute("aria-pressed", "true");
      made.append(...entry.childNodes);
      entry.append(made);
      this.figure = figure;
    }
    apply(marks) {
      for (const mark of all(marks, "path, circle, text, g.interval")) {
        const group = mark.closest("g.interval");
        if ((!group || group === mark) && nearestKey(this.figure.keys, classes(mark)) === this) mark.style.display = this.off ? "none" : "";
      }
    }
  }

  const opened = () => {
    const found = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let part = found; part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
    found?.scrollIntoView();
  };

  if (typeof DecompressionStream === "undefined") return;
  for (const script of all(document, "svg + script.figure-data")) {
    const chart = new Chart(script.previousElementSibling, script);
    const { figure, host } = chart;
    if (!figure.charts) {
      Object.assign(figure, { charts: [], keys: [] });
      all(figure, ".key > li").forEach((entry) => figure.keys.push(new Key(entry, figure)));
    }
    figure.charts.push(chart);
    chart.listen();
    if (host.resetButton) continue;
    const own = () => figure.charts.filter((other) => other.host === host);
    const loaded = async () => {
      await Promise.all(own().map((other) => other.load()));
      return own();
    };
    const reset = button("Reset zoom", "Show the whole picture", () => own().forEach((other) => other.view && other.zoom(null)));
    reset.hidden = true;
    host.resetButton = reset;
    const csv = button("CSV", "Save the numbers that are drawn here as a table", async () => {
      const charts = await loaded();
      save(fileName(charts, "csv"), "text/csv;charset=utf-8", table(charts));
    });
    csv.title += script.dataset.note ? `. ${script.dataset.note}` : "";
    const svg = button("SVG", "Save the picture as it is now, in light colours", async () => {
      const charts = await loaded();
      save(fileName(charts, "svg"), "image/svg+xml", picture(charts));
    });
    const tools = element("div", { class: "tools" }, reset, svg, csv);
    if (host === figure) (figure.querySelector("figcaption") ?? figure).prepend(tools);
    else host.querySelector("summary").after(tools);
  }
  addEventListener("hashchange", opened);
  if (location.hash) opened();
})();
