import { type App, currentRun } from "./app.ts";
import type { MeasurementsView } from "./measurements/pane.ts";
import type { NetworkView } from "./network/pane.ts";
import type { Shell } from "./shell.ts";
import { NO_MOTE } from "./source/frame.ts";
import type { Ghost } from "./swarm/picture.ts";
import { ROBOT_STRIDE } from "./swarm/picture.ts";
import type { Camera } from "./store.ts";
import type { SwarmView } from "./swarm/view.ts";

/** What is drawn now, read back from the drawing buffers: for tests of the page. */
export interface Drawn {
  view: string;
  source: string;
  runs: number;
  /** The time chosen, and the end of the step that is drawn (ns). */
  cursor_ns: number;
  time_ns: number;
  step: number;
  playing: boolean;
  selected: number | null;
  /** The followed packet. */
  packet: number | null;
  /** Its frames in order, as the table and the map show them: sender, receiver (null: everyone in reach), time sent (ns), outcome. */
  way: [number, number | null, number, string][];
  /** Cells of the schedule pane in which frames were sent, and in which some of them collided. */
  schedule: { sent: number; collisions: number };
  painter: string;
  /** The middle of the picture (m) and its scale (CSS pixels per metre). */
  camera: Camera;
  nRobotsDrawn: number;
  /** By robot; null: not drawn. */
  positions: ([number, number] | null)[];
  dead: number[];
  links: [number, number][];
  missed: [number, number][];
  ghosts: Ghost[];
  /** Measured lines of the map: both ends, rows, mean residual; and the places that are drawn instead of many lines. */
  measured: [number, number, number, number][];
  measuredPlaces: number;
  framesDrawn: number;
  framesLoaded: number;
  /** Frames around the current time are still being loaded: links that were missed, ghosts and trails may be incomplete. */
  loading: boolean;
  eventsShown: number;
  packetsShown: number;
  lag_s: number;
}

function pairs(flat: number[]): [number, number][] {
  const found: [number, number][] = [];
  for (let i = 0; i < flat.length; i += 2) found.push([flat[i], flat[i + 1]]);
  return found;
}

/** Describes what is drawn. */
export function drawn(app: App, shell: Shell, swarm: SwarmView, network: NetworkView, measurements: MeasurementsView | null): Drawn {
  const { state } = app.store;
  const { picture, frame } = swarm.scene;
  const data = currentRun(app);
  const inSwarm = state.view === "swarm" || state.view === "compare" || state.view === "measurements";
  const measured = measurements?.shown.map(state);
  const index = data.frames.indexAt(state.timeNs);
  const shown = inSwarm || index < 0 ? frame : data.frames.frame(index);
  const positions: ([number, number] | null)[] = new Array(data.run.agentCount).fill(null);
  for (let i = 0; i < picture.robots.count; i++) {
    positions[picture.robots.agents[i]] = [picture.robots.data[i * ROBOT_STRIDE], picture.robots.data[i * ROBOT_STRIDE + 1]];
  }
  const dead: number[] = [];
  for (let i = 0; i < picture.dead.length; i += 3) {
    dead.push(picture.dead[i]);
    positions[picture.dead[i]] = [picture.dead[i + 1], picture.dead[i + 2]];
  }
  return {
    view: state.view,
    source: app.source.kind,
    runs: app.source.runs.length,
    cursor_ns: state.timeNs,
    time_ns: shown?.timeNs ?? -1,
    step: shown?.step ?? -1,
    playing: state.playing,
    selected: state.selected,
    packet: state.packet,
    way: (app.follower.way?.frames ?? []).map((frame) =>
      [frame.sender, frame.destination === NO_MOTE ? null : frame.destination, frame.sentNs, frame.outcome]),
    schedule: network.scheduleDrawn,
    painter: swarm.painter?.name ?? "none",
    camera: { ...swarm.camera },
    nRobotsDrawn: picture.robots.count,
    positions,
    dead,
    links: pairs(picture.links.pairs),
    missed: pairs(picture.missed.pairs),
    ghosts: picture.ghosts.map((ghost) => ({ ...ghost })),
    measured: (measured?.lines ?? []).map(({ from, to, count, mean }) => [from, to, count, mean]),
    measuredPlaces: measured?.places.length ?? 0,
    framesDrawn: app.framesDrawn,
    framesLoaded: data.frames.length,
    loading: data.loading || app.follower.loading,
    eventsShown: shell.events.eventsShown,
    packetsShown: network.packetsShown,
    lag_s: app.source.live?.lagS ?? 0,
  };
}
