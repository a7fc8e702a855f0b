import type { App } from "../app.ts";
import { element } from "../dom.ts";
import { figure } from "../format.ts";
import { CLASSES, classColours } from "../measurements/map.ts";
import { css } from "./colours.ts";
import type { Scene } from "./scene.ts";
import { groundRange } from "./site.ts";
import { wayColour } from "./way-shapes.ts";

/** Views up to this width have their legend below the picture (px). */
const NARROW_PX = 900;
/** Greatest width of the legend, and room beside it (px). */
const COVERED_PX = 262;

/** What the colours of a swarm view mean. */
export class Legend {
  readonly root = element("details", { class: "legend", open: true, hidden: true });
  private key = "";
  private placed = false;

  constructor(private readonly app: App) {}

  update(scene: Scene): void {
    this.place();
    const { robotColour, ghosts, selected } = this.app.store.state;
    const measured = scene.measured?.rows ?? null;
    const linkColour = measured === null ? this.app.store.state.linkColour : "none";
    const missed = this.app.store.state.missed && scene.measured === null;
    const { picture, robotRange, linkRange } = scene;
    const ghost = ghosts && selected !== null && picture.ghosts.length > 0;
    const dead = picture.dead.length > 0;
    const { theme, follower } = this.app;
    const packet = follower.way !== null && follower.data === scene.data ? follower.way.packet.id : null;
    const key = [packet, robotColour, linkColour, missed, ghost, dead, robotRange.most, linkRange.least, linkRange.most, theme.dark, scene.frame?.motes === null, scene.frame?.links.rssiDbm.length === 0].join();
    if (key === this.key) return;
    this.key = key;
    const rows: HTMLElement[] = [];
    const { groups, place, stepNs } = scene.data.run;
    if (robotColour === "group") {
      const names = groups.length > 0 ? groups.map((group) => `${group.name} (${group.count})`) : ["robots"];
      names.slice(0, 8).forEach((name, i) => rows.push(row("dart", css(theme.categories[i % theme.categories.length]), name)));
    } else {
      const labels = { heard: "neighbours heard in the period", queue: "packets in queue", rank: "RPL rank" };
      rows.push(gradient(labels[robotColour], theme.scale, "0", figure(robotRange.most)));
    }
    const { motes = null, links } = scene.frame ?? {};
    const missing = robotColour === "queue" ? !motes?.queueLength.length : robotColour === "rank" && !motes?.rank.length;
    if (missing) rows.push(element("div", { class: "note" }, "This network does not report it: robots are grey."));
    if (measured !== null) {
      const colours = classColours(theme);
      CLASSES.forEach((name, i) => rows.push(row("way", css(colours[i]), `measured: ${name}`)));
      rows.push(element("div", { class: "note" }, `“much”: by more than the noise of the model, ${figure(measured.noise)} ${scene.measured?.measurements.unit}`));
    }
    if (linkColour === "delivery") rows.push(gradient("link: received of sent", theme.linkScale, "0 %", "100 %"));
    if (linkColour === "rssi") rows.push(gradient("link: RSSI", theme.linkScale, `${linkRange.least}`, `${linkRange.most} dBm`));
    if (linkColour === "rssi" && links?.rssiDbm.length === 0 && links.sender.length > 0) {
      rows.push(element("div", { class: "note" }, "This recording has no RSSI: links are grey."));
    }
    if (linkColour === "age") {
      const age = (linkRange.most * Number(stepNs)) / 1e9;
      rows.push(gradient("link: age of the position", theme.linkScale, "0", `${figure(age)} s`));
    }
    if (linkColour !== "none") rows.push(element("div", { class: "note" }, "An end shows what the robot there sent."));
    if (missed) rows.push(row("dashed", css(theme.missed), "missed: heard within 5 s, not now"));
    if (packet !== null) rows.push(row("way", wayColour(theme), `way of packet ${packet}, hop by hop; dashed: not received`));
    if (ghost) rows.push(row("ring", css(theme.ghost), "where the selected robot last heard it"));
    if (dead) rows.push(row("ring", css(theme.dead), "lost, at its last position"));
    if (place?.ground !== undefined) {
      const { least, most } = groundRange(place.ground);
      rows.push(element("div", {}, `ground: ${figure(least)} to ${figure(most)} m`));
    }
    this.root.replaceChildren(element("summary", {}, "Colours"), ...rows);
  }

  /** Width of the picture that the open legend lies over (px); in narrow views it is below the picture, as in style.css. */
  get coveredPx(): number {
    const room = this.root.parentElement?.clientWidth ?? 0;
    return this.root.open && !this.root.hidden && room > NARROW_PX ? COVERED_PX : 0;
  }

  /** Narrow views begin with the legend closed. */
  private place(): void {
    const room = this.root.parentElement?.clientWidth ?? 0;
    if (this.placed || room === 0) return;
    this.placed = true;
    this.root.open = room > NARROW_PX;
  }
}

function row(shape: string, colour: string, text: string): HTMLElement {
  const swatch = element("span", { class: `swatch ${shape}`, "aria-hidden": "true" });
  swatch.style.color = colour;
  return element("div", { class: "legend-row" }, swatch, text);
}

function gradient(label: string, table: Uint32Array, from: string, to: string): HTMLElement {
  const bar = element("span", { class: "gradient", "aria-hidden": "true" });
  const stops = [0, 51, 102, 153, 204, 255].map((i) => css((table[i] | 0xff000000) >>> 0));
  bar.style.background = `linear-gradient(to right, ${stops.join(",")})`;
  return element("div", { class: "legend-scale" }, element("div", {}, label), element("div", { class: "legend-row" }, from, bar, to));
}
