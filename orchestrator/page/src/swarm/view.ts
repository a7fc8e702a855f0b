import type { App, Exported } from "../app.ts";
import { element } from "../dom.ts";
import { paintShapes, type Shape, shapesToSvg, sizedContext, svgDocument } from "../sketch.ts";
import type { RunData } from "../source/source.ts";
import type { Camera } from "../store.ts";
import { annotations, drawGrid } from "./axes.ts";
import { fit, mostlyVisible, pinched, zoomed } from "./camera.ts";
import { CanvasPainter } from "./canvas.ts";
import type { ShownRows } from "../measurements/shown.ts";
import { Legend } from "./legend.ts";
import { ROBOT_STRIDE } from "./picture.ts";
import { RasterPainter } from "./raster.ts";
import { Scene } from "./scene.ts";
import { pictureToSvg } from "./svg.ts";
import { wayShapes } from "./way-shapes.ts";
import { isSoftware, type Painter, webGlPainter } from "./webgl.ts";

/** A robot is picked within this distance of the pointer (px). */
const PICK_PX = 14;
/** The same of a finger. */
const TOUCH_PICK_PX = 24;
/** A swarm travels far if all of its way is this many times as large as the swarm. */
const FAR = 3;

/** Pictures with more robots or lines than this are drawn without a graphics library where WebGL runs on the processor. */
const MANY = 2000;

/** One run's robots from above. */
export class SwarmView {
  readonly root: HTMLElement;
  readonly scene: Scene;
  /** The camera of the latest picture. */
  camera: Camera = { x: 0, y: 0, scale: 10 };
  /** What drew the latest picture. */
  painter: Painter | null = null;
  private usual: Painter | null = null;
  private canvas: HTMLCanvasElement;
  /** For pictures of many lines and robots; null: not needed until now. */
  private many: { canvas: HTMLCanvasElement; painter: RasterPainter } | null = null;
  private drawsMany = false;
  /** The painter draws the overlay, too. */
  private stamped = false;
  private readonly map: HTMLElement;
  private readonly overlay: HTMLCanvasElement;
  private readonly tip: HTMLElement;
  private readonly empty: HTMLElement;
  private readonly legend: Legend;
  private fitted: { camera: Camera; key: string } | null = null;
  private width = 0;
  private height = 0;
  private ratio = 0;
  private key = "";
  private overlayKey = "";
  private wayVersion = -1;

  constructor(
    private readonly app: App,
    readonly data: RunData,
    title: string,
    measured: ShownRows | null = null,
  ) {
    this.scene = new Scene(data, measured);
    this.canvas = element("canvas", { class: "layer", hidden: true });
    this.overlay = element("canvas", { class: "layer overlay", tabindex: 0, role: "img", "aria-label": `Robots of ${title} seen from above` });
    this.tip = element("div", { class: "tip", hidden: true });
    this.empty = element("div", { class: "empty" }, "Loading frames …");
    this.legend = new Legend(app);
    this.map = element("div", { class: "map" }, this.canvas, this.overlay, this.tip, this.empty);
    this.root = element("div", { class: "swarm" }, this.map, this.legend.root);
    if (title !== "") this.map.append(element("div", { class: "swarm-title" }, title));
    this.painter = this.usual = this.openPainter();
    this.listen();
    // A canvas of a new size is empty: it is drawn before the browser shows it.
    new ResizeObserver(() => {
      if (this.measure()) this.render();
    }).observe(this.map);
  }

  /** Draws if the frame, the camera or a choice has changed. */
  render(): void {
    const { state } = this.app.store;
    if (this.width === 0) this.measure();
    if (this.width === 0) return;
    const changed = this.scene.update(state, this.app.theme);
    const { frame } = this.scene;
    this.empty.hidden = frame !== null && this.data.ready(state.timeNs);
    if (frame === null) return;
    this.camera = this.chooseCamera();
    const { x, y, scale } = this.camera;
    const cameraKey = [x, y, scale, this.width, this.height, this.ratio, this.app.theme.dark].join();
    const wayVersion = this.app.follower.version;
    if (!changed && cameraKey === this.key) {
      if (wayVersion !== this.wayVersion) {
        this.drawOverlay(cameraKey);
        if (this.stamped) this.painter?.paint(this.scene.picture, this.camera, this.width, this.height, this.pictureRatio);
        this.app.framesDrawn++;
        this.legend.update(this.scene);
      }
      return;
    }
    const moved = cameraKey !== this.key;
    this.key = cameraKey;
    if (moved) {
      drawGrid(this.scene.picture, this.camera, this.width, this.height, this.app.theme);
      const spacing = scale * Math.sqrt(this.area() / Math.max(1, this.scene.picture.robots.count));
      this.scene.picture.robotRadiusPx = Math.max(2.5, Math.min(8, 0.22 * spacing));
    }
    this.legend.root.hidden = false;
    const painter = this.choosePainter();
    this.drawOverlay(cameraKey);
    painter?.paint(this.scene.picture, this.camera, this.width, this.height, this.pictureRatio);
    this.app.framesDrawn++;
    this.legend.update(this.scene);
  }

  /** Fits everything into the picture again. */
  refit(): void {
    this.fitted = null;
    this.app.store.set({ camera: null, follow: false });
  }

  /** Zooms about the middle. */
  zoom(factor: number): void {
    this.app.store.set({ camera: zoomed(this.camera, factor, 0, 0) });
  }

  exported(): Exported {
    const { picture } = this.scene;
    const shapes = () => this.annotations();
    return {
      width: this.width,
      height: this.height,
      svg: () => pictureToSvgDocument(this, shapesToSvg(shapes())),
      paint: (context, ratio) => {
        new CanvasPainter(context).paint(picture, this.camera, this.width, this.height, ratio);
        context.setTransform(ratio, 0, 0, ratio, 0, 0);
        paintShapes(context, shapes());
      },
    };
  }

  /** Whether a place is in the picture. */
  shows(x: number, y: number): boolean {
    return 2 * Math.abs(x - this.camera.x) * this.camera.scale < this.width && 2 * Math.abs(y - this.camera.y) * this.camera.scale < this.height;
  }

  /** Size of the picture (px). */
  get size(): { width: number; height: number } {
    return { width: this.width, height: this.height };
  }

  private area(): number {
    const [w, h] = [this.width / this.camera.scale, this.height / this.camera.scale];
    return w * h;
  }

  private openPainter(): Painter {
    const painter = webGlPainter(this.canvas);
    if (painter !== null) {
      this.canvas.addEventListener("webglcontextlost", (event) => {
        event.preventDefault();
        this.usual = null;
      });
      this.canvas.addEventListener("webglcontextrestored", () => {
        this.usual = webGlPainter(this.canvas);
        this.key = "";
      });
      return painter;
    }
    return new CanvasPainter(this.canvas.getContext("2d", { alpha: false }) as CanvasRenderingContext2D);
  }

  /** Pixels of the picture per CSS pixel. */
  private get pictureRatio(): number {
    return this.drawsMany ? 1 : this.ratio;
  }

  /** The painter for the picture, whose canvas is then the one that is shown. */
  private choosePainter(): Painter | null {
    const { robots, links, missed, trails } = this.scene.picture;
    const most = Math.max(robots.count, (links.count + missed.count + trails.count) / 2);
    // Numbers about the limit do not make the picture change its look all the time.
    if (most > MANY) this.drawsMany = isSoftware();
    else if (most < 0.7 * MANY) this.drawsMany = false;
    if (this.drawsMany && this.many === null) {
      const canvas = element("canvas", { class: "layer" });
      const context = canvas.getContext("2d", { alpha: false }) as CanvasRenderingContext2D;
      this.many = { canvas, painter: new RasterPainter(context) };
      this.canvas.after(canvas);
    }
    if (this.many !== null) this.many.canvas.hidden = !this.drawsMany;
    this.canvas.hidden = this.drawsMany;
    if (this.many !== null && this.drawsMany) {
      const { canvas, painter } = this.many;
      if (canvas.width !== this.width || canvas.height !== this.height) {
        canvas.width = this.width;
        canvas.height = this.height;
      }
      this.painter = painter;
    } else this.painter = this.usual;
    return this.painter;
  }

  /** Takes the size of the map; whether the canvas has changed with it. */
  private measure(): boolean {
    const { clientWidth, clientHeight } = this.map;
    this.ratio = window.devicePixelRatio || 1;
    this.width = clientWidth;
    this.height = clientHeight;
    const [w, h] = [Math.round(clientWidth * this.ratio), Math.round(clientHeight * this.ratio)];
    if (w === 0 || h === 0 || (this.canvas.width === w && this.canvas.height === h)) return false;
    this.canvas.width = w;
    this.canvas.height = h;
    this.key = "";
    return true;
  }

  private chooseCamera(): Camera {
    const { state } = this.app.store;
    const { frame } = this.scene;
    let camera = state.camera ?? this.fit();
    if (state.follow && state.selected !== null && frame !== null && state.selected < frame.x.length) {
      const { x, y } = this.scene.motion;
      camera = { ...camera, x: x[state.selected], y: y[state.selected] };
    }
    return camera;
  }

  /**
   * Fits the robots of some frames spread over what is loaded, so that the camera need not move while they do. A swarm that travels far
   * would be tiny then: it is fitted where it is, and again when some of it has left the picture.
   */
  private fit(): Camera {
    // What is fitted stays beside the legend, if that lies over the picture.
    const covered = this.legend.coveredPx;
    const width = this.width - covered;
    const measured = this.scene.measured?.rows;
    // Where measurements are shown, they are what is fitted, wherever robots go.
    const isMeasured = measured?.fromXM.some(Number.isFinite) === true;
    const key = `${this.width} ${this.height} ${covered} ${isMeasured}`;
    const shown = this.app.source.runs.flatMap(({ frames }) => {
      const index = frames.indexAt(this.app.store.state.timeNs);
      return index < 0 ? [] : [frames.frame(index)];
    });
    if (this.fitted?.key === key && (isMeasured || shown.every((frame) => mostlyVisible(frame, (this.fitted as { camera: Camera }).camera, this.width, this.height)))) {
      return this.fitted.camera;
    }
    const frames = isMeasured ? [] : this.app.source.runs.flatMap((run) => {
      const count = Math.min(12, run.frames.length);
      return Array.from({ length: count }, (_, i) => run.frames.frame(Math.floor((i * (run.frames.length - 1)) / Math.max(1, count - 1))));
    });
    const places = this.app.source.runs.map((run) => run.run.place);
    const everything = fit(frames, places, width, this.height, measured);
    const now = isMeasured ? everything : fit(shown, places, width, this.height, measured);
    const chosen = everything.scale * FAR < now.scale ? { ...now, scale: now.scale * 0.7 } : everything;
    const camera = { ...chosen, x: chosen.x + covered / 2 / chosen.scale };
    this.fitted = { camera, key };
    return camera;
  }

  /** Text costs more than triangles: it is drawn again only if it has moved. */
  private drawOverlay(cameraKey: string): void {
    const { picture } = this.scene;
    const { selected } = this.app.store.state;
    const moving = picture.robots.count + picture.dead.length / 3 <= 300 || selected !== null;
    // Where the browser draws on the processor, another canvas over the picture costs as much as the picture.
    this.stamped = this.drawsMany && !moving && this.ratio === 1;
    const key = moving ? "" : `${this.stamped} ` + `${cameraKey} ${picture.siteLabels.map((l) => `${l.text}${l.x},${l.y}`).join()} ${this.app.follower.version}`;
    this.wayVersion = this.app.follower.version;
    if (key !== "" && key === this.overlayKey) return;
    this.overlayKey = key;
    const context = sizedContext(this.overlay, this.width, this.height);
    const shapes = this.annotations();
    this.overlay.style.opacity = this.stamped ? "0" : "1";
    if (!this.stamped) paintShapes(context, shapes);
    this.many?.painter.setStamp(this.stamped ? shapes : null, this.width, this.height);
  }

  /** Axes, labels and the way of the followed packet. */
  private annotations(): Shape[] {
    const { follower, store, theme } = this.app;
    const way = follower.data === this.data ? follower.way : null;
    const shapes = annotations(this.scene.picture, this.camera, this.width, this.height, store.state.selected, theme);
    return way === null ? shapes : [...wayShapes(way, this.camera, this.width, this.height, theme), ...shapes];
  }

  /** The robot nearest to a place in the picture (px from its left upper corner), if any is close. */
  private pick(px: number, py: number, reach = PICK_PX): number | null {
    const { robots, dead } = this.scene.picture;
    let best = reach;
    let agent: number | null = null;
    const consider = (candidate: number, x: number, y: number): void => {
      const dx = this.width / 2 + (x - this.camera.x) * this.camera.scale - px;
      const dy = this.height / 2 - (y - this.camera.y) * this.camera.scale - py;
      const distance = Math.hypot(dx, dy);
      if (distance < best) {
        best = distance;
        agent = candidate;
      }
    };
    for (let i = 0; i < robots.count; i++) consider(robots.agents[i], robots.data[i * ROBOT_STRIDE], robots.data[i * ROBOT_STRIDE + 1]);
    for (let i = 0; i < dead.length; i += 3) consider(dead[i], dead[i + 1], dead[i + 2]);
    return agent;
  }

  private listen(): void {
    let drag: { x: number; y: number; camera: Camera; moved: boolean } | null = null;
    const fingers = new Map<number, [number, number]>();
    let pinch: { middle: [number, number]; distance: number; camera: Camera } | null = null;
    /** Middle and distance of two fingers (px). */
    const spread = (): { middle: [number, number]; distance: number } => {
      const [[ax, ay], [bx, by]] = [...fingers.values()];
      return { middle: [(ax + bx) / 2, (ay + by) / 2], distance: Math.max(1, Math.hypot(ax - bx, ay - by)) };
    };
    const lift = (event: PointerEvent): void => {
      fingers.delete(event.pointerId);
      if (fingers.size < 2) pinch = null;
    };
    const { overlay } = this;
    const { store } = this.app;
    overlay.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      overlay.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
      if (fingers.size === 2) {
        pinch = { ...spread(), camera: this.camera };
        drag = null;
        return;
      }
      drag = { x: event.offsetX, y: event.offsetY, camera: this.camera, moved: false };
    });
    overlay.addEventListener("pointermove", (event) => {
      if (fingers.has(event.pointerId)) fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
      if (pinch !== null) {
        const { middle, distance } = spread();
        store.set({ camera: pinched(pinch.camera, pinch.middle, middle, distance / pinch.distance, this.width, this.height), follow: false });
        return;
      }
      if (drag === null) {
        if (event.pointerType !== "touch") this.showTip(event.offsetX, event.offsetY);
        return;
      }
      const [dx, dy] = [event.offsetX - drag.x, event.offsetY - drag.y];
      if (!drag.moved && Math.hypot(dx, dy) < 4) return;
      drag.moved = true;
      const { x, y, scale } = drag.camera;
      store.set({ camera: { x: x - dx / scale, y: y + dy / scale, scale }, follow: false });
    });
    overlay.addEventListener("pointerup", (event) => {
      lift(event);
      const reach = event.pointerType === "touch" ? TOUCH_PICK_PX : PICK_PX;
      if (drag !== null && !drag.moved) this.app.select(this.pick(event.offsetX, event.offsetY, reach));
      drag = null;
    });
    overlay.addEventListener("pointercancel", (event) => {
      lift(event);
      drag = null;
    });
    overlay.addEventListener("pointerleave", () => {
      this.tip.hidden = true;
    });
    overlay.addEventListener("dblclick", () => this.refit());
    overlay.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 20 : 1;
        const factor = Math.exp(-event.deltaY * lines * 0.0015);
        const [px, py] = [event.offsetX - this.width / 2, this.height / 2 - event.offsetY];
        store.set({ camera: store.state.follow ? zoomed(this.camera, factor, 0, 0) : zoomed(this.camera, factor, px, py) });
      },
      { passive: false },
    );
  }

  private showTip(px: number, py: number): void {
    const agent = this.pick(px, py);
    const { frame } = this.scene;
    this.tip.hidden = agent === null || frame === null;
    if (agent === null || frame === null) return;
    let heard = 0;
    for (const receiver of frame.links.receiver) if (receiver === agent) heard++;
    this.tip.textContent = `robot ${agent}: (${frame.x[agent].toFixed(2)}, ${frame.y[agent].toFixed(2)}) m, hears ${heard}`;
    this.tip.style.left = `${Math.min(px + 14, this.width - 220)}px`;
    this.tip.style.top = `${Math.max(4, py - 28)}px`;
  }
}

function pictureToSvgDocument(view: SwarmView, shapes: string): string {
  const { width, height } = view.size;
  const { picture } = view.scene;
  return svgDocument(width, height, picture.background, `${pictureToSvg(picture, view.camera, width, height)}\n${shapes}`);
}
