import { LINK_COLOURS, NETWORK_PANES, ROBOT_COLOURS, SIDE_PANES, type State, type Store, VIEWS } from "./store.ts";

/** The address is written at most so often (ms): browsers limit how often a page may change it. */
const WRITE_MS = 400;

function choice<T extends string>(values: readonly T[], text: string | null): T | undefined {
  return values.find((value) => value === text);
}

/** Reads the state that a fragment captures; what it does not name stays as it is. */
export function parseFragment(fragment: string): Partial<State> {
  const query = new URLSearchParams(fragment.replace(/^#/, ""));
  const found: Partial<State> = {
    view: choice(VIEWS, query.get("view")),
    networkPane: choice(NETWORK_PANES, query.get("pane")),
    sidePane: choice(SIDE_PANES, query.get("side")),
    robotColour: choice(ROBOT_COLOURS, query.get("robots")),
    linkColour: choice(LINK_COLOURS, query.get("links")),
    theme: choice(["light", "dark"] as const, query.get("theme")),
  };
  const number = (name: string): number | undefined => {
    const value = Number(query.get(name) ?? Number.NaN);
    return Number.isNaN(value) || value < 0 ? undefined : value;
  };
  const timeS = number("t");
  if (timeS !== undefined) found.timeNs = Math.round(timeS * 1e9);
  const run = choice(["0", "1"] as const, query.get("run"));
  if (run !== undefined) found.run = Number(run);
  found.selected = number("robot");
  found.packet = number("packet");
  found.speed = number("speed");
  for (const name of ["follow", "missed", "trails", "ghosts"] as const) if (query.has(name)) found[name] = query.get(name) === "1";
  if (query.has("bin")) found.bin = query.get("bin");
  if (query.has("effects")) found.withEffects = query.get("effects") === "1";
  const camera = (query.get("camera") ?? "").split(",").map(Number);
  if (camera.length === 3 && camera.every(Number.isFinite)) found.camera = { x: camera[0], y: camera[1], scale: camera[2] };
  return Object.fromEntries(Object.entries(found).filter(([, value]) => value !== undefined)) as Partial<State>;
}

/** Captures view, time, selection, camera and choices in a fragment. */
export function formatFragment(state: State): string {
  const query = new URLSearchParams({ view: state.view, t: String(Math.round(state.timeNs) / 1e9) });
  if (state.view === "network") query.set("pane", state.networkPane);
  if (state.sidePane !== "robot") query.set("side", state.sidePane);
  if (state.run !== 0) query.set("run", String(state.run));
  if (state.selected !== null) query.set("robot", String(state.selected));
  if (state.packet !== null) query.set("packet", String(state.packet));
  if (state.speed !== 1) query.set("speed", String(state.speed));
  if (state.follow) query.set("follow", "1");
  for (const name of ["missed", "trails", "ghosts"] as const) if (!state[name]) query.set(name, "0");
  query.set("robots", state.robotColour);
  query.set("links", state.linkColour);
  if (state.bin !== null) query.set("bin", state.bin);
  if (state.withEffects) query.set("effects", "1");
  if (state.theme !== "") query.set("theme", state.theme);
  if (state.camera !== null) {
    const { x, y, scale } = state.camera;
    query.set("camera", [x, y, scale].map((value) => +value.toPrecision(6)).join(","));
  }
  return `#${query.toString()}`;
}

/** Keeps the address up to date with the state, and the state with an address that the user enters. */
export function bindFragment(store: Store): void {
  // A page within another one, as the player of a report, has no address of its own: browsers let it change none.
  if (location.protocol === "about:" || location.protocol === "blob:") return;
  let timer: number | null = null;
  let written = location.hash;
  store.subscribe(() => {
    timer ??= window.setTimeout(() => {
      timer = null;
      written = formatFragment(store.state);
      history.replaceState(null, "", written);
    }, WRITE_MS);
  });
  window.addEventListener("hashchange", () => {
    if (location.hash !== written) store.set(parseFragment(location.hash));
  });
}
