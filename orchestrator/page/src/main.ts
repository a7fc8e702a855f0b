import "./style.css";
import { type App, currentRun, endOfRuns, type ViewPanel } from "./app.ts";
import { Clock } from "./clock.ts";
import { CompareView } from "./compare.ts";
import { element } from "./dom.ts";
import { goTo } from "./events.ts";
import { type Drawn, drawn } from "./inspect.ts";
import type { Runs } from "./gen/murmuration/view/v1/view_pb.ts";
import { bindKeys } from "./keys.ts";
import { MeasurementsView } from "./measurements/pane.ts";
import { Follower } from "./network/follower.ts";
import { NetworkView } from "./network/pane.ts";
import { SeriesView } from "./series.ts";
import { Shell } from "./shell.ts";
import { Api } from "./source/api.ts";
import { openEmbedded } from "./source/embedded.ts";
import { openLive } from "./source/live.ts";
import { openServed } from "./source/served.ts";
import type { LiveOrder, Source, SourceListener } from "./source/source.ts";
import { Store, type View } from "./store.ts";
import { theme } from "./swarm/colours.ts";
import { SwarmPane } from "./swarm/pane.ts";
import type { SwarmView } from "./swarm/view.ts";
import { Opening } from "./opening.ts";
import type { TimeActions } from "./time-bar.ts";
import { bindFragment, parseFragment } from "./url-state.ts";

declare global {
  interface Window {
    /** For tests of the page. */
    murmuration: { ready: Promise<void>; state(): Drawn; seek(timeNs: number): Promise<void> };
  }
}

/** After a live run has ended, the program is asked again after this time whether it can be replayed (ms). */
const REOPEN_MS = 300;

const page = document.getElementById("page") as HTMLElement;
const systemDark = window.matchMedia("(prefers-color-scheme: dark)");

function showFailure(error: Error): void {
  page.replaceChildren(element("div", { class: "failure", role: "alert" }, element("h1", {}, "Murmuration"), element("p", {}, error.message)));
}

/** The runs that the program serves; after a live run, once it can be replayed. */
async function servedRuns(api: Api, afterLive: boolean): Promise<Runs> {
  const served = await api.runs();
  if (!afterLive || !served.runs[0]?.live) return served;
  await new Promise((resolve) => setTimeout(resolve, REOPEN_MS));
  return servedRuns(api, afterLive);
}

async function openSource(listener: SourceListener, afterLive: boolean): Promise<Source> {
  const script = document.getElementById("recording");
  if (script !== null) return openEmbedded(script);
  if (location.protocol === "file:") {
    throw new Error("This page holds no recording. Open the page that the program wrote, or the address that it printed.");
  }
  const api = new Api(new URLSearchParams(location.search).get("token") ?? "");
  const served = await servedRuns(api, afterLive);
  const [first] = served.runs;
  if (first === undefined) throw new Error("The program serves no run: start it with a recording.");
  return first.live ? openLive(first, api, listener) : openServed(served, api, listener);
}

function timeActions(app: App): TimeActions {
  const { store } = app;
  const controllable = (): boolean => app.source.live !== null && currentRun(app).run.controllable;
  const order = (what: LiveOrder): void => {
    app.problem = "";
    app.source.control(what).catch((error: Error) => {
      app.problem = `The simulation did not obey: ${error.message}`;
    });
  };
  return {
    togglePlay() {
      const { live } = app.source;
      if (live !== null && controllable()) {
        order(live.paused ? "resume" : "pause");
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
        order("step");
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

/** A page that draws a source. */
interface Started {
  stop(): void;
  drawn(): Drawn;
  /** Resolves when the frame at the current time is drawn. */
  settled(): Promise<void>;
  seek(timeNs: number): Promise<void>;
  /** Goes to the next moment of a kind. */
  jump(name: string): void;
}

/** Builds the page for a source, and draws it until another source takes its place. */
function start(source: Source, store: Store, open: { wanted: boolean; keepSpeed: boolean }): Started {
  let centreOn: { agent: number; always: boolean } | null = null;
  const app: App = {
    store,
    source,
    get follower() {
      return follower;
    },
    theme: theme(systemDark.matches),
    framesDrawn: 0,
    problem: "",
    select(agent, camera = "stay") {
      store.set({ selected: agent, peer: null, ...(agent === null ? { follow: false } : {}) });
      centreOn = camera === "stay" || agent === null ? null : { agent, always: camera === "centre" };
    },
    seek(timeNs) {
      store.set({ timeNs: Math.max(0, Math.min(endOfRuns(app), timeNs)), atLive: false });
    },
  };
  const follower = new Follower(app);
  const swarm = new SwarmPane(app);
  const network = new NetworkView(app);
  const views = new Map<View, ViewPanel>([["swarm", swarm], ["network", network], ["series", new SeriesView(app)]]);
  const compare = source.runs.length > 1 ? new CompareView(app) : null;
  if (compare !== null) views.set("compare", compare);
  const measurements = source.measurements === undefined ? null : new MeasurementsView(app, source.measurements);
  if (measurements !== null) views.set("measurements", measurements);
  /** The view in which the current run is drawn. */
  const shownSwarm = (): SwarmView => {
    if (store.state.view === "compare" && compare !== null) return compare.views[store.state.run];
    return store.state.view === "measurements" && measurements !== null ? measurements.view : swarm.view;
  };
  if (!views.has(store.state.view)) store.set({ view: "swarm" });
  const actions = timeActions(app);
  const shell = new Shell(app, views, actions);
  const ended = new AbortController();
  bindKeys(app, shell, actions, { refit: () => shownSwarm().refit(), zoom: (factor) => shownSwarm().zoom(factor) }, ended.signal);
  page.replaceChildren(shell.root);
  document.title = `${currentRun(app).run.name || "run"} – Murmuration`;
  const clock = new Clock(app);
  const opening = new Opening(app, open.wanted, open.keepSpeed);

  /** Puts a robot that was found into the middle as soon as its frame is loaded. */
  const centre = (): void => {
    const data = currentRun(app);
    const { timeNs, follow } = store.state;
    if (centreOn === null || !data.ready(timeNs)) return;
    const frame = data.frames.frame(data.frames.indexAt(timeNs));
    const { agent, always } = centreOn;
    if (agent < frame.x.length && !follow) {
      const [x, y] = [frame.x[agent], frame.y[agent]];
      if (always || !shownSwarm().shows(x, y)) store.set({ camera: { ...shownSwarm().camera, x, y } });
    }
    centreOn = null;
  };

  const draw = (nowMs: number): void => {
    if (ended.signal.aborted) return;
    const dark = store.state.theme === "" ? systemDark.matches : store.state.theme === "dark";
    if (dark !== app.theme.dark) app.theme = theme(dark);
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    opening.update(nowMs);
    clock.tick(nowMs);
    follower.update();
    shell.render();
    centre();
    requestAnimationFrame(draw);
  };
  requestAnimationFrame(draw);
  const isDrawn = (): boolean => {
    const data = currentRun(app);
    const { timeNs, view } = store.state;
    if (opening.pending || !data.ready(timeNs) || follower.loading) return false;
    // The network view shows what the overview holds until this time.
    if (view === "network") return source.kind !== "served" || data.overview.complete || Number(data.overview.untilNs) >= timeNs;
    if (view !== "swarm" && view !== "compare" && view !== "measurements") return true;
    const shown = view === "compare" ? source.runs : [data];
    return shown.every((run) => !run.loading) && shownSwarm().scene.frame?.step === data.frames.step(data.frames.indexAt(timeNs));
  };
  const settled = async (): Promise<void> => {
    // What arrived since the latest picture is drawn with the next one.
    for (let drawnTimes = 0; drawnTimes < 2 && !ended.signal.aborted; ) {
      await new Promise(requestAnimationFrame);
      drawnTimes = isDrawn() ? drawnTimes + 1 : 0;
    }
  };
  return {
    stop: () => ended.abort(),
    drawn: () => drawn(app, shell, shownSwarm(), network, measurements),
    settled,
    seek(timeNs) {
      opening.cancel();
      store.set({ playing: false });
      app.seek(timeNs);
      return settled();
    },
    jump(name) {
      opening.cancel();
      shell.moments.jump(name);
    },
  };
}

async function main(): Promise<void> {
  const store = new Store();
  const address = parseFragment(location.hash);
  store.set(address);
  let shown: Started | null = null;
  const listener: SourceListener = {
    changed() {},
    failed(error) {
      shown?.stop();
      showFailure(error);
    },
    ended() {
      shown?.stop();
      store.set({ atLive: false, playing: false });
      open(true).catch(listener.failed);
    },
  };
  const open = async (afterLive: boolean): Promise<void> => {
    const source = await openSource(listener, afterLive);
    if (source.live !== null) store.set({ atLive: true });
    // What follows a run that was watched begins where that has ended.
    shown = start(source, store, { wanted: !afterLive && address.timeNs === undefined, keepSpeed: address.speed !== undefined });
  };
  window.murmuration = {
    ready: open(false).then(() => shown?.settled()),
    state: () => (shown as Started).drawn(),
    seek: (timeNs) => (shown as Started).seek(timeNs),
  };
  bindFragment(store);
  try {
    await window.murmuration.ready;
    // The player of a report: numbers on the page around it lead to their moments.
    if (location.protocol === "about:") {
      window.addEventListener("message", ({ source, data }) => {
        if (source === window.parent && typeof data?.jump === "string") shown?.jump(data.jump);
      });
      window.parent.postMessage({ murmuration: "ready" }, "*");
    }
  } catch (error) {
    listener.failed(error as Error);
  }
}

void main();
