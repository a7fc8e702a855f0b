import type { MeasuredRows, Place } from "../gen/murmuration/view/v1/view_pb.ts";
import type { FrameData } from "../source/frame.ts";
import type { Camera } from "../store.ts";
import { exists } from "./links.ts";

/** Room around everything when a picture is fitted: at most so much (px), and this share of a small picture. */
const MARGIN_PX = 48;
const MARGIN_SHARE = 0.1;

/** The camera that shows all robots of a frame, walls and obstacles, and where was measured. */
export function fit(frames: FrameData[], places: (Place | undefined)[], width: number, height: number, measured?: MeasuredRows): Camera {
  let [left, right, bottom, top] = [Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY, Number.POSITIVE_INFINITY, Number.NEGATIVE_INFINITY];
  const include = (x: number, y: number, radius = 0): void => {
    left = Math.min(left, x - radius);
    right = Math.max(right, x + radius);
    bottom = Math.min(bottom, y - radius);
    top = Math.max(top, y + radius);
  };
  for (const frame of frames) {
    for (let agent = 0; agent < frame.x.length; agent++) if (exists(frame, agent)) include(frame.x[agent], frame.y[agent]);
  }
  for (const place of places) {
    for (const wall of place?.walls ?? []) {
      include(wall.fromXM, wall.fromYM);
      include(wall.toXM, wall.toYM);
    }
    for (const obstacle of place?.obstacles ?? []) include(obstacle.xM, obstacle.yM, obstacle.radiusM);
  }
  for (const [xs, ys] of measured === undefined ? [] : [[measured.fromXM, measured.fromYM], [measured.toXM, measured.toYM]]) {
    xs.forEach((x, row) => {
      if (Number.isFinite(x) && Number.isFinite(ys[row])) include(x, ys[row]);
    });
  }
  if (left > right) return { x: 0, y: 0, scale: 10 };
  const spanX = Math.max(right - left, 1);
  const spanY = Math.max(top - bottom, 1);
  const room = (size: number): number => Math.max(50, size - 2 * Math.min(MARGIN_PX, Math.max(22, MARGIN_SHARE * size)));
  const scale = Math.min(room(width) / spanX, room(height) / spanY);
  return { x: (left + right) / 2, y: (bottom + top) / 2, scale };
}

/** The camera after zooming by a factor about a point of the picture (px from its centre, y up). */
export function zoomed(camera: Camera, factor: number, px: number, py: number): Camera {
  const scale = Math.min(1e4, Math.max(1e-3, camera.scale * factor));
  return { x: camera.x + px / camera.scale - px / scale, y: camera.y + py / camera.scale - py / scale, scale };
}

/** The camera after two fingers have moved: what was between them is there still. Middles of the fingers in px from the left upper corner. */
export function pinched(camera: Camera, from: [number, number], to: [number, number], factor: number, width: number, height: number): Camera {
  const scale = Math.min(1e4, Math.max(1e-3, camera.scale * factor));
  return {
    x: camera.x + (from[0] - width / 2) / camera.scale - (to[0] - width / 2) / scale,
    y: camera.y - (from[1] - height / 2) / camera.scale + (to[1] - height / 2) / scale,
    scale,
  };
}

/** Up to so many robots all of them must be in the picture, of more almost all. */
const ALL_ROBOTS = 50;

/** Whether the robots of a frame are within the picture. */
export function mostlyVisible(frame: FrameData, camera: Camera, width: number, height: number): boolean {
  let alive = 0;
  let visible = 0;
  for (let agent = 0; agent < frame.x.length; agent++) {
    if (!exists(frame, agent)) continue;
    alive++;
    const dx = Math.abs(frame.x[agent] - camera.x) * camera.scale;
    const dy = Math.abs(frame.y[agent] - camera.y) * camera.scale;
    if (2 * dx <= width && 2 * dy <= height) visible++;
  }
  return visible >= (alive <= ALL_ROBOTS ? 1 : 0.85) * alive;
}
