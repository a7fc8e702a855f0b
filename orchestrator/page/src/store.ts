/** The views that the bar at the top chooses from. */
export const VIEWS = ["swarm", "network", "series", "compare", "measurements"] as const;
export type View = (typeof VIEWS)[number];
export const NETWORK_PANES = ["tree", "schedule", "packets", "join", "energy"] as const;
export type NetworkPane = (typeof NETWORK_PANES)[number];
export const ROBOT_COLOURS = ["group", "heard", "queue", "rank"] as const;
export type RobotColour = (typeof ROBOT_COLOURS)[number];
export const LINK_COLOURS = ["delivery", "rssi", "age", "none"] as const;
export type LinkColour = (typeof LINK_COLOURS)[number];
export const SIDE_PANES = ["robot", "events"] as const;
export type SidePane = (typeof SIDE_PANES)[number];

/** Centre of the picture (m) and its scale (CSS pixels per metre). */
export interface Camera {
  x: number;
  y: number;
  scale: number;
}

/** What the user has chosen. Views draw from it and change it by `Store.set` only. */
export interface State {
  view: View;
  networkPane: NetworkPane;
  sidePane: SidePane;
  /** Which run the swarm and network views show. */
  run: number;
  timeNs: number;
  playing: boolean;
  /** Simulated seconds per second; Infinity: a frame in every picture. */
  speed: number;
  /** A simulation is watched at its latest frame. */
  atLive: boolean;
  selected: number | null;
  /** The other end of the packet that was chosen last. */
  peer: number | null;
  /** Number of the packet whose way is shown. */
  packet: number | null;
  follow: boolean;
  /** null: fit everything. */
  camera: Camera | null;
  robotColour: RobotColour;
  linkColour: LinkColour;
  missed: boolean;
  trails: boolean;
  ghosts: boolean;
  /** The bin of a covariate whose measured rows are shown, as `name:number`; null: all rows. */
  bin: string | null;
  /** Residuals of the model with all accepted effects are shown. */
  withEffects: boolean;
  /** "" follows the system. */
  theme: "" | "light" | "dark";
}

export const INITIAL: State = {
  view: "swarm",
  networkPane: "tree",
  sidePane: "robot",
  run: 0,
  timeNs: 0,
  playing: false,
  speed: 1,
  atLive: false,
  selected: null,
  peer: null,
  packet: null,
  follow: false,
  camera: null,
  robotColour: "group",
  linkColour: "delivery",
  missed: true,
  trails: true,
  ghosts: true,
  bin: null,
  withEffects: false,
  theme: "",
};

type Listener = (changed: ReadonlySet<keyof State>) => void;

/** Holds the state and reports which of its fields have changed. */
export class Store {
  readonly state: State = { ...INITIAL };
  private readonly listeners: Listener[] = [];

  set(changes: Partial<State>): void {
    const changed = new Set<keyof State>();
    for (const key of Object.keys(changes) as (keyof State)[]) {
      if (this.state[key] !== changes[key]) changed.add(key);
    }
    if (changed.size === 0) return;
    Object.assign(this.state, changes);
    for (const listener of this.listeners) listener(changed);
  }

  subscribe(listener: Listener): void {
    this.listeners.push(listener);
  }
}
