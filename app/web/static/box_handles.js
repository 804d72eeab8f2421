// Handles in a 3D view that move the faces of a box, along one axis of the world each: by pointer, or by arrow keys.

import { element } from "./dom.js";

const STEP_M = 0.01; // of an arrow key
const FINE_M = 0.001; // of an arrow key with Shift, and of the pointer
const BESIDE_PX = 16; // a handle stands off its face: the faces of a thin box are close together
const RADIUS_PX = 14; // .handle in predictions.css
const FLATTEST = 0.2; // an axis that is seen shorter than this share of its length cannot be dragged along
const KEYS = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 };
const FACES = [0, 1, 2].flatMap((k) => ["min", "max"].map((side) => ({ k, side })));

/**
 * Put six handles into `place`, a 3D view; returns `show(projection)` for `drawScene`.
 * @param chosen returns the box to move, `{min, max, name}` in meters, or null
 * @param moved called with `(side, k, value_m, isHeld)` for each move; `isHeld` until the pointer lets go
 */
export function mountHandles(place, chosen, moved) {
  let seen = null;
  const handles = FACES.map((face) => handleOf(face, () => ({ box: chosen(), projection: seen }), moved));
  return (projection) => {
    seen = projection;
    if (!handles[0].node.isConnected) place.append(...handles.map(({ node }) => node)); // the view empties `place` first
    const box = chosen();
    for (const handle of handles) handle.show(box, projection, place);
  };
}

function handleOf({ k, side }, now, moved) {
  const axis = "xyz"[k];
  const node = element("span", { className: `handle axis-${axis}`, tabIndex: 0, role: "spinbutton", hidden: true }, axis);
  let held = null; // the face, and the pointer, when it was pressed
  const move = (value_m, box, isHeld) => moved(side, k, kept(value_m, box, side, k), isHeld);
  node.addEventListener("keydown", (event) => {
    const way = KEYS[event.key];
    if (!way) return;
    event.preventDefault();
    event.stopPropagation(); // else the view turns
    const { box } = now();
    move(box[side][k] + way * (event.shiftKey ? FINE_M : STEP_M), box, false);
  });
  node.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    event.preventDefault();
    event.stopPropagation();
    node.focus({ preventScroll: true });
    node.setPointerCapture(event.pointerId);
    const { box, projection } = now();
    held = { from_m: box[side][k], x: event.clientX, y: event.clientY, along: alongPx(projection, k) };
  });
  node.addEventListener("pointermove", ({ clientX, clientY }) => {
    if (!held) return;
    const [ux, uy] = held.along;
    const way_m = ((clientX - held.x) * ux + (clientY - held.y) * uy) / (ux * ux + uy * uy);
    move(held.from_m + way_m, now().box, true);
  });
  node.addEventListener("pointerup", (event) => event.stopPropagation());
  node.addEventListener("lostpointercapture", () => {
    held = null;
    const { box } = now();
    if (box) move(box[side][k], box, false);
  });
  const show = (box, projection, { clientWidth, clientHeight }) => {
    const [ux, uy] = alongPx(projection, k);
    const length = Math.hypot(ux, uy);
    node.hidden = !box || (!held && length < FLATTEST * projection.px_per_m);
    if (node.hidden) return;
    const outward = ((side === "max" ? 1 : -1) * BESIDE_PX) / Math.max(length, 1);
    const [x, y] = projection.at(box.min.map((low, i) => (i === k ? box[side][k] : (low + box.max[i]) / 2)));
    const within = (value, size) => Math.max(RADIUS_PX, Math.min(size - RADIUS_PX, value));
    node.style.left = `${within(x + outward * ux, clientWidth)}px`;
    node.style.top = `${within(y + outward * uy, clientHeight)}px`;
    node.ariaLabel = `${box.name}: ${side === "max" ? "largest" : "smallest"} ${axis}, m`;
    node.ariaValueNow = String(box[side][k]);
  };
  return { node, show };
}

/** How many pixels a meter along a world axis is seen as, to the right and down. */
function alongPx({ at }, k) {
  const [origin, end] = [at([0, 0, 0]), at([0, 1, 2].map((i) => Number(i === k)))];
  return end.map((value, i) => value - origin[i]);
}

/** In whole millimeters, and one at least from the face on the other side. */
function kept(value_m, box, side, k) {
  const bounded = side === "max" ? Math.max(value_m, box.min[k] + FINE_M) : Math.min(value_m, box.max[k] - FINE_M);
  return Number(bounded.toFixed(3));
}
