import "./style.css";
import { type App, currentRun, endOfRuns, type ViewPanel } from "./app.ts";
import { Clock } from "./clock.ts";
import { CompareView } from "./compare.ts";
import { element } from "./dom.ts";
import { goTo } from "./events.ts";
import { type Drawn, drawn } from "./inspect.ts";
import { bindKeys } from "./keys.ts";
import { NetworkView } from "./network/pane.ts";
import { SeriesView } from "./series.ts";
import { Shell } from "./shell.ts";
import { Api } from "./source/api.ts";
import { openEmbedded } from "./source/embedded.ts";
import { openLive } from "./source/live.ts";
import { openServed } from "./source/served.ts";
import type { Source, SourceListener } from "./source/source.ts";
import { Store, type View } from "./store.ts";
import { theme } from "./swarm/colours.ts";
import { SwarmPane } from "./swarm/pane.ts";
import type { SwarmView } from "./swarm/view.ts";
import type { TimeActions } from "./time-bar.ts";
import { bindFragment, parseFragment } from "./url-state.ts";

declare global {
  interface Window {
    /** For tests of the page. */
    murmuration: { ready: Promise<void>; state(): Drawn; seek(timeNs: number): Promise<void> };
  }
}

const page = document.getElementById("page") as HTMLElement;
const systemDark = window.matchMedia("(prefers-color-scheme: dark)");

function showFailure(error: Error): void {
  page.replaceChildren(element("div", { class: "failure", role: "alert" }, element("h1", {}, "Murmuration"), element("p", {}, error.message)));
}

async function openSource(listener: SourceListener): Promise<Source> {
  const script = document.getElementById("recording");
  if (script !== null) return openEmbedded(script);
  if (location.protocol === "file:") {
    throw new Error("This page holds no recording. Open the page that the program wrote, or the address that it printed.");
  }
  const api = new Api(new URLSearchParams(location.search).get("token") ?? "");
  const runs = await api.runs();
  if (runs.length === 0) throw new Error("The program serves no run: start it with a recording.");
  return runs[0].live ? openLive(runs[0], api, listener) : openServed(runs, api, listener);
}

function timeActions(app: App): TimeActions {
  const { store } = app;
  const controllable = (): boolean => app.source.live !== null && currentRun(app).run.controllable;
  return {
    togglePlay() {
      const { live } = app.source;
      if (live !== null && controllable()) {
        void app.source.control(live.paused ? "resume" : "pause");
        if (live.paused) store.set({ atLive: true, playing: false });
      } else if (live !== null && store.state.atLive) store.set({ atLive: false, playing: false });
      else if (store.state.playing) store.set({ playing: false });
      else {
        if (store.state.timeNs >= endOfRuns(app)) store.set({ timeNs: 0 });
        store.set({ playing: true });
      }
    },
    step(direction) {
      const { frames } = currentRun(app);
      const next = frames.indexAt(store.state.timeNs) + direction;
      store.set({ playing: false });
      if (next >= 0 && next < frames.length) app.seek(frames.timeNs(next));
      else if (direction === 1 && controllable()) {
        void app.source.control("step");
        store.set({ atLive: true });
      } else if (app.source.kind === "served") {
        app.seek(Math.max(0, Math.min(endOfRuns(app), store.state.timeNs + direction * Number(currentRun(app).run.stepNs))));
      }
    },
    jumpToEvent(direction) {
      const { events } = currentRun(app).overview;
      const { timeNs } = store.state;
      const next = direction === 1 ? events.find((e) => Number(e.timeNs) > timeNs) : events.findLast((e) => Number(e.timeNs) < timeNs);
      if (next !== undefined) goTo(app, next);
    },
    goLive() {
      if (app.source.live !== null) store.set({ atLive: true, playing: false });
    },
  };
}

/** Builds the page for a source, and draws it until another source takes its place. */
function start(source: Source, store: Store): { stop(): void; drawn(): Drawn; seek(timeNs: number): Promise<void> } {
  let centreOn: number | null = null;
  const app: App = {
    store,
    source,
    theme: theme(systemDark.matches),
    framesDrawn: 0,
    select(agent, centre = false) {
      store.set({ selected: agent, peer: null, ...(agent === null ? { follow: false } : {}) });
      centreOn = centre ? agent : null;
    },
    seek(timeNs) {
      store.set({ timeNs: Math.max(0, Math.min(endOfRuns(app), timeNs)), atLive: false });
    },
  };
  const swarm = new SwarmPane(app);
  const network = new NetworkView(app);
  const views = new Map<View, ViewPanel>([["swarm", swarm], ["network", network], ["series", new SeriesView(app)]]);
  const compare = source.runs.length > 1 ? new CompareView(app) : null;
  if (compare !== null) views.set("compare", compare);
  /** The view in which the current run is drawn. */
  const shownSwarm = (): SwarmView => (store.state.view === "compare" && compare !== null ? compare.views[store.state.run] : swarm.view);
  if (!views.has(store.state.view)) store.set({ view: "swarm" });
  const actions = timeActions(app);
  const shell = new Shell(app, views, actions);
  bindKeys(app, shell, actions, { refit: () => shownSwarm().refit(), zoom: (factor) => shownSwarm().zoom(factor) });
  page.replaceChildren(shell.root);
  document.title = `${currentRun(app).run.name || "run"} – Murmuration`;
  const clock = new Clock(app);

  /** Puts a robot that was found into the middle as soon as its frame is loaded. */
  const centre = (): void => {
    const data = currentRun(app);
    const { timeNs, follow } = store.state;
    if (centreOn === null || !data.ready(timeNs)) return;
    const frame = data.frames.frame(data.frames.indexAt(timeNs));
    if (centreOn < frame.x.length && !follow) {
      store.set({ camera: { ...shownSwarm().camera, x: frame.x[centreOn], y: frame.y[centreOn] } });
    }
    centreOn = null;
  };

  let running = true;
  const draw = (nowMs: number): void => {
    if (!running) return;
    const dark = store.state.theme === "" ? systemDark.matches : store.state.theme === "dark";
    if (dark !== app.theme.dark) app.theme = theme(dark);
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    clock.tick(nowMs);
    shell.render();
    centre();
    requestAnimationFrame(draw);
  };
  requestAnimationFrame(draw);
  const settled = (timeNs: number): boolean => {
    const data = currentRun(app);
    if (!data.ready(timeNs)) return false;
    if (store.state.view !== "swarm" && store.state.view !== "compare") return true;
    return shownSwarm().scene.frame?.step === data.frames.step(data.frames.indexAt(timeNs));
  };
  return {
    stop() {
      running = false;
    },
    drawn: () => drawn(app, shell, shownSwarm(), network.packetsShown),
    async seek(timeNs) {
      store.set({ playing: false });
      app.seek(timeNs);
      do await new Promise(requestAnimationFrame);
      while (running && !settled(store.state.timeNs));
    },
  };
}

async function main(): Promise<void> {
  const store = new Store();
  store.set(parseFragment(location.hash));
  let shown: ReturnType<typeof start> | null = null;
  const listener: SourceListener = {
    changed() {},
    failed(error) {
      shown?.stop();
      showFailure(error);
    },
    ended() {
      shown?.stop();
      store.set({ atLive: false, playing: false });
      open().catch(listener.failed);
    },
  };
  const open = async (): Promise<void> => {
    const source = await openSource(listener);
    if (source.live !== null) store.set({ atLive: true });
    shown = start(source, store);
  };
  window.murmuration = {
    ready: open().then(() => window.murmuration.seek(store.state.timeNs)),
    state: () => (shown as ReturnType<typeof start>).drawn(),
    seek: (timeNs) => (shown as ReturnType<typeof start>).seek(timeNs),
  };
  bindFragment(store);
  try {
    await window.murmuration.ready;
  } catch (error) {
    listener.failed(error as Error);
  }
}

void main();
