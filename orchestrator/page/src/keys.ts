import { type App, currentRun, endOfRuns } from "./app.ts";
import type { Shell } from "./shell.ts";
import { wayActions } from "./network/way-panel.ts";
import type { View } from "./store.ts";
import type { TimeActions } from "./time-bar.ts";

/** What keys do to the picture that is shown. */
export interface PictureActions {
  refit(): void;
  zoom(factor: number): void;
}

/** Listens to the keys that the dialog "Keys" lists. */
export function bindKeys(app: App, shell: Shell, time: TimeActions, picture: PictureActions, ended: AbortSignal): void {
  const { store } = app;
  const way = wayActions(app);
  const slot = (direction: 1 | -1): void => {
    const slotNs = Number(currentRun(app).run.slotNs);
    if (slotNs > 0) app.seek(Math.max(0, Math.min(endOfRuns(app), (Math.floor(store.state.timeNs / slotNs) + direction) * slotNs)));
  };
  const arrow = (event: KeyboardEvent, direction: 1 | -1): void => (event.shiftKey ? time.jumpToEvent(direction) : time.step(direction));
  const keys: Record<string, (event: KeyboardEvent) => unknown> = {
    " ": () => time.togglePlay(),
    ArrowLeft: (event) => arrow(event, -1),
    ArrowRight: (event) => arrow(event, 1),
    ".": () => slot(1),
    ",": () => slot(-1),
    Home: () => app.seek(0),
    End: () => app.seek(endOfRuns(app)),
    "+": () => picture.zoom(1.25),
    "=": () => picture.zoom(1.25),
    "-": () => picture.zoom(0.8),
    f: () => picture.refit(),
    o: () => store.set({ follow: !store.state.follow }),
    l: () => time.goLive(),
    "/": () => shell.find.focus(),
    "?": () => shell.help.showModal(),
    "[": () => way.hop(-1),
    "]": () => way.hop(1),
    Escape: () => {
      if (store.state.view === "measurements" && store.state.bin !== null) store.set({ bin: null });
      else if (!way.clear()) app.select(null);
    },
  };
  [...shell.views.keys()].forEach((view: View, i) => {
    keys[String(i + 1)] = () => store.set({ view });
  });
  document.addEventListener("keydown", (event) => {
    const target = event.target as HTMLElement;
    const typing = target instanceof HTMLSelectElement || (target instanceof HTMLInputElement && target.type !== "checkbox" && target.type !== "range");
    if (typing || shell.help.open || event.ctrlKey || event.altKey || event.metaKey) return;
    // The space bar presses what the keyboard has reached; what was only clicked has the focus, too, but is not meant.
    const pressable = target instanceof HTMLButtonElement || (target instanceof HTMLInputElement && target.type === "checkbox");
    if (event.key === " " && pressable && target.matches(":focus-visible")) return;
    const action = keys[event.key];
    if (action === undefined) return;
    event.preventDefault();
    action(event);
  }, { signal: ended });
}
