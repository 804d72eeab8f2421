// A gripper at a pose, and an arm along its joints, in the 3D view.

import { svg } from "./dom.js";
import { text } from "./view3d.js";

const [OPEN_M, CLOSED_M] = [0.04, 0.012]; // from the middle to a finger
const FINGER_M = 0.05;
const WRIST_M = 0.1;
const [BASE_M, WRIST_LINK_M] = [0.06, 0.035]; // radii of an arm's first and last link: shapes are not known
const JOINT = 0.45; // a joint's radius relative to its link's
const NEARLY = 0.99; // as far as a cosine goes where one end of a link hides the other
const [SHIFT, LIT] = [0.25, 0.5]; // where light falls on a link, relative to its radius

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

/** The arm's links `{position, node}` from point to point, as solids: tapered capsules, lit from above, and its joints. */
export function links(points, projection) {
  const radius = (k) => projection.px_per_m * (BASE_M + ((WRIST_LINK_M - BASE_M) * k) / Math.max(1, points.length - 1));
  const ends = points.map((point, k) => ({ at: projection.at(point), r: radius(k) }));
  return points.slice(1).map((point, k) => {
    const joints = k === points.length - 2 ? [ends[k], ends[k + 1]] : [ends[k]];
    return {
      position: point.map((value, axis) => (value + points[k][axis]) / 2),
      node: svg("g", { class: "arm" }, ...capsule(ends[k], ends[k + 1]), ...joints.map(joint)),
    };
  });
}

const joint = ({ at: [cx, cy], r }) => svg("circle", { cx: cx.toFixed(1), cy: cy.toFixed(1), r: (JOINT * r).toFixed(1) });

/** A link seen from the side, and the light on it. */
const capsule = (from, to) => [
  svg("path", { class: "link", d: around(from, to) }),
  svg("path", { class: "light", d: around(...[from, to].map(({ at: [x, y], r }) => ({ at: [x - SHIFT * r, y - SHIFT * r], r: LIT * r }))) }),
];

/** The outline of two circles and what is between them. */
function around({ at: [ax, ay], r: ra }, { at: [bx, by], r: rb }) {
  const length = Math.hypot(bx - ax, by - ay);
  const along = Math.atan2(by - ay, bx - ax);
  // Where one circle hides the other, an arc of almost a whole turn: a whole one, from a point to itself, is not drawn.
  const aside = Math.acos(Math.min(NEARLY, Math.max(-NEARLY, (ra - rb) / Math.max(length, 1e-6))));
  const on = (x, y, r, angle) => `${(x + r * Math.cos(angle)).toFixed(1)} ${(y + r * Math.sin(angle)).toFixed(1)}`;
  const arc = (r, isLarge, end) => `A${r.toFixed(1)} ${r.toFixed(1)} 0 ${Number(isLarge)} 0 ${end}`;
  return [
    `M${on(ax, ay, ra, along + aside)}L${on(bx, by, rb, along + aside)}`,
    arc(rb, aside > Math.PI / 2, on(bx, by, rb, along - aside)),
    `L${on(ax, ay, ra, along - aside)}`,
    arc(ra, aside < Math.PI / 2, on(ax, ay, ra, along + aside)),
    "Z",
  ].join("");
}
