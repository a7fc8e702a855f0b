import { type App, currentRun, endOfRuns } from "./app.ts";
import { element, selection, setText } from "./dom.ts";
import { drawEventMark, eventStyle } from "./event-kinds.ts";
import { goTo } from "./events.ts";
import { seconds } from "./format.ts";
import type { Event } from "./gen/murmuration/view/v1/view_pb.ts";
import { MomentsBar } from "./moments.ts";
import { sizedContext } from "./sketch.ts";
import { isSoftware } from "./swarm/webgl.ts";

export const SPEEDS = [
  ["0.1", "0.1 ×"], ["0.25", "0.25 ×"], ["0.5", "0.5 ×"], ["1", "1 ×"], ["2", "2 ×"], ["5", "5 ×"], ["10", "10 ×"], ["20", "20 ×"], ["50", "50 ×"],
  ["100", "100 ×"], ["Infinity", "as fast as possible"],
] as const;
/** Marks of events closer than this to the pointer are meant (px). */
const HOVER_PX = 7;
const TIMELINE_HEIGHT = 30;

/** While playing, clock and slider are written at most so often (ms): each time the browser paints the whole bar. */
const REFRESH_MS = 100;
/** The same where the browser paints on the processor. */
const SOFTWARE_REFRESH_MS = 250;

/** What the buttons of the time bar do. */
export interface TimeActions {
  togglePlay(): void;
  step(direction: 1 | -1): void;
  jumpToEvent(direction: 1 | -1): void;
  goLive(): void;
}

/** Buttons, the scrub slider, and the timeline with the marks of events. */
export class TimeBar {
  readonly root: HTMLElement;
  readonly moments: MomentsBar;
  private readonly play: HTMLButtonElement;
  private readonly live: HTMLButtonElement;
  private readonly clock = element("output", { class: "clock", "aria-label": "Time" });
  private readonly status = element("span", { class: "status", role: "status" });
  private readonly slider: HTMLInputElement;
  private readonly timeline = element("canvas", { class: "timeline" });
  private readonly tip = element("div", { class: "tip", hidden: true });
  private readonly speed: HTMLSelectElement;
  private key = "";
  private writtenMs = 0;

  constructor(
    private readonly app: App,
    actions: TimeActions,
  ) {
    const { store } = app;
    const button = (text: string, label: string, action: () => void): HTMLButtonElement =>
      element("button", { type: "button", title: label, "aria-label": label, onclick: action }, text);
    this.play = button("▶\uFE0E", "Play or pause (space)", () => actions.togglePlay());
    this.play.classList.add("primary");
    this.live = button("● Live", "Go to the latest step of the simulation (L)", () => actions.goLive());
    this.slider = element("input", {
      type: "range", min: 0, max: 1, step: "any", "aria-label": "Time in the run", oninput: () => app.seek(Number(this.slider.value)),
    });
    const speed = selection("Speed", SPEEDS, "1", (value) => store.set({ speed: Number(value) }));
    this.speed = speed.select;
    const controls = element("div", { class: "controls" },
      button("|◀\uFE0E", "Previous event (Shift + left arrow)", () => actions.jumpToEvent(-1)),
      button("◀\uFE0E", "One step back (left arrow)", () => actions.step(-1)),
      this.play,
      button("▶\uFE0E|", "One step forward (right arrow)", () => actions.step(1)),
      button("▶\uFE0E▶\uFE0E|", "Next event (Shift + right arrow)", () => actions.jumpToEvent(1)),
      this.live, this.clock, speed.root, this.status);
    const track = element("div", { class: "track" }, this.timeline, this.slider, this.tip);
    this.moments = new MomentsBar(app);
    this.root = element("footer", { class: "time-bar" }, controls, track, this.moments.root);
    this.timeline.addEventListener("pointermove", (event) => this.hover(event));
    this.timeline.addEventListener("pointerleave", () => (this.tip.hidden = true));
    this.timeline.addEventListener("click", (event) => {
      const near = this.nearest(event.offsetX);
      if (near !== null) goTo(app, near);
      else app.seek((event.offsetX / this.timeline.clientWidth) * endOfRuns(app));
    });
  }

  render(): void {
    const { app } = this;
    const { state } = app.store;
    const { live } = app.source;
    this.moments.render();
    const now = performance.now();
    if ((state.playing || state.atLive) && now - this.writtenMs < (isSoftware() ? SOFTWARE_REFRESH_MS : REFRESH_MS)) return;
    this.writtenMs = now;
    const end = endOfRuns(app);
    const running = live !== null && currentRun(app).run.controllable ? !live.paused : state.playing || (live !== null && state.atLive);
    setText(this.play, running ? "❚❚" : "▶\uFE0E");
    const obeys = this.app.source.live !== null && currentRun(this.app).run.controllable;
    this.play.title = obeys ? "Pause or resume the simulation (space)" : "Play or pause (space)";
    this.play.setAttribute("aria-pressed", String(running));
    this.live.hidden = live === null;
    this.live.setAttribute("aria-pressed", String(state.atLive));
    const digits = Number(currentRun(app).run.stepNs) < 1e7 ? 3 : 2;
    setText(this.clock, `${seconds(state.timeNs, digits)} of ${seconds(end, 1)}${this.stepText()}`);
    const speed = live === null ? "" : `${live.speed.toFixed(1)} simulated s/s, ${live.lagS.toFixed(2)} s behind${live.paused ? ", paused" : ""}`;
    setText(this.status, [app.source.status, speed, app.problem].filter((text) => text !== "").join(" · "));
    if (this.speed.value !== String(state.speed)) this.speed.value = String(state.speed);
    if (this.slider.max !== String(end)) this.slider.max = String(end);
    if (Number(this.slider.value) !== state.timeNs) this.slider.value = String(state.timeNs);
    this.slider.setAttribute("aria-valuetext", seconds(state.timeNs));
    this.drawTimeline(end);
  }

  private stepText(): string {
    const { state } = this.app.store;
    const { frames, run } = currentRun(this.app);
    const i = frames.indexAt(state.timeNs);
    if (i < 0) return "";
    const slotNs = Number(run.slotNs);
    const slot = slotNs > 0 ? ` · ASN ${Math.floor(state.timeNs / slotNs)}` : "";
    return ` · step ${frames.step(i)}${slot}`;
  }

  private drawTimeline(end: number): void {
    const width = this.timeline.parentElement?.clientWidth ?? 0;
    const data = currentRun(this.app);
    const { selected } = this.app.store.state;
    const key = [width, end, data.overviewVersion, this.app.store.state.run, this.app.theme.dark, selected, window.devicePixelRatio].join();
    if (key === this.key || width === 0 || end === 0) return;
    this.key = key;
    const context = sizedContext(this.timeline, width, TIMELINE_HEIGHT);
    context.fillStyle = this.app.theme.dark ? "#ffffff14" : "#0000000d";
    context.fillRect(0, 0, width, TIMELINE_HEIGHT);
    // Marks on the same pixel are drawn once: a run may have tens of thousands of events.
    const taken = new Set<string>();
    for (const event of data.overview.events) {
      const style = eventStyle(event.kind);
      const x = Math.round((Number(event.timeNs) / end) * width);
      const chosen = event.agent !== undefined && event.agent === selected;
      const spot = `${x} ${event.kind} ${chosen}`;
      if (taken.has(spot)) continue;
      taken.add(spot);
      context.globalAlpha = selected === null || chosen || style.major ? 1 : 0.35;
      drawEventMark(context, style, x, style.major ? 8 : 22, chosen ? 6 : 4.5);
    }
    context.globalAlpha = 1;
    const loaded = Number(data.overview.untilNs);
    if (!data.overview.complete && data.overviewVersion > 0 && this.app.source.live === null) {
      context.fillStyle = this.app.theme.dark ? "#ffffff22" : "#00000018";
      context.fillRect((loaded / end) * width, 0, width, TIMELINE_HEIGHT);
    }
  }

  private nearest(px: number): Event | null {
    const end = endOfRuns(this.app);
    let best = HOVER_PX;
    let found: Event | null = null;
    for (const event of currentRun(this.app).overview.events) {
      const distance = Math.abs((Number(event.timeNs) / end) * this.timeline.clientWidth - px);
      if (distance < best || (distance === best && found !== null && eventStyle(event.kind).major && !eventStyle(found.kind).major)) {
        best = distance;
        found = event;
      }
    }
    return found;
  }

  private hover(event: PointerEvent): void {
    const near = this.nearest(event.offsetX);
    this.tip.hidden = near === null;
    if (near === null) return;
    this.tip.textContent = `${seconds(Number(near.timeNs))}: ${near.text}`;
    this.tip.style.left = `${Math.max(0, Math.min(event.offsetX - 60, this.timeline.clientWidth - 280))}px`;
  }
}
