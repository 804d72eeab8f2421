// A gripper at a pose, and an arm as a skeleton, in the 3D view.

import { svg } from "./dom.js";
import { text } from "./view3d.js";

const [OPEN_M, CLOSED_M] = [0.04, 0.012]; // from the middle to a finger
const FINGER_M = 0.05;
const WRIST_M = 0.1;
const ARM_M = 0.05; // how thick its links are drawn

/** Two fingers that end at the pose, whose z axis points where they do; they open along its y axis. */
export function gripper({ position, axes, open }, projection, name) {
  const [, across, along] = axes;
  const point = (side_m, back_m) => position.map((value, k) => value + side_m * across[k] - back_m * along[k]);
  const wide = open ? OPEN_M : CLOSED_M;
  const fingers = [point(-wide, 0), point(-wide, FINGER_M), point(wide, FINGER_M), point(wide, 0)];
  const wrist = [point(0, FINGER_M), point(0, WRIST_M)];
  const lines = [fingers, wrist].map((points) => svg("polyline", { points: text(points, projection) }));
  return svg("g", { class: `gripper ${name}` }, ...lines);
}

/** Links from point to point, thicker the nearer the view; a dot at each joint. */
export function arm(points, projection) {
  const width = Math.max(3, ARM_M * projection.px_per_m);
  const joints = points.map((point) => {
    const [cx, cy] = projection.at(point);
    return svg("circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r: (0.32 * width).toFixed(1) });
  });
  return svg("g", { class: "arm" }, svg("polyline", { points: text(points, projection), "stroke-width": width.toFixed(1) }), ...joints);
}
