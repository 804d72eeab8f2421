// The 3D view of a scene (app/web/scene.py): workspace box, path, end-effector frames, objects. It is SVG and a little
// arithmetic, because WebGL stands still for seconds where a browser draws it in software, as over a remote desktop.

import { element, svg } from "./dom.js";
import { gripper, links } from "./hand3d.js";
import { View, steer, text } from "./view3d.js";

const FRAME_M = 0.05;
const BOX_M = 0.04;
const MARGIN_M = 0.05;
const GRID_M = 0.1;
const LETTER_PX = 7; // about, of the labels
const LINE_PX = 16;
const SAME_PLACE_M = 0.01; // frames that are nearer have one label
const CLOSE = "Close to the motion";
const ARM = "With the arm";
const WHOLE = "Whole workspace";
const CORNERS = Array.from({ length: 8 }, (_, bits) => [0, 1, 2].map((k) => (bits & (1 << k) ? 1 : -1)));
const EDGES = CORNERS.flatMap((_, bits) => [1, 2, 4].filter((bit) => !(bits & bit)).map((bit) => [bits, bits | bit]));
const STANDING = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const states = new WeakMap();

const plus = (point, along, length) => point.map((value, k) => value + length * along[k]);
const meters = (point) => `${point.map((value) => value.toFixed(3)).join(", ")} m`;

/** Draw `scene` into `place`, over what was there; the view that a person turned it to stays. */
export function drawScene(place, scene) {
  if (!states.has(place)) prepare(place);
  const state = states.get(place);
  state.scene = scene;
  if (!state.isChosen) state.show(scene.whole ? WHOLE : scene.play?.arm ? ARM : CLOSE);
  state.armButton.hidden = !scene.play?.arm;
  state.redraw();
}

/**
 * Show the hand of one moment `{position, axes, open, arm, objects}`, and arm and objects where they are known; the scene
 * must be drawn, and the objects are in its order.
 * @param beside another moment, of which the hand is shown faintly
 */
export function showMoment(place, moment, beside = null) {
  const state = states.get(place);
  Object.assign(state, { moment, beside });
  if (state.moving) paintMoment(state);
}

/** In a layer of its own, so that a browser paints no more than that while a motion plays. */
function paintMoment({ moving, projection, moment, beside, scene }) {
  const hands = [[beside, "beside"], [moment, "hand"]].filter(([shown]) => shown);
  const objects = (moment?.objects ?? []).map((item, k) => ({ ...scene.objects[k], ...item }));
  const bodies = inOrder([...objects, ...links(moment?.arm ?? [], projection)], projection);
  moving.replaceChildren(
    ...bodies.flatMap((item) => item.node ?? solid(item, projection)),
    ...hands.map(([shown, name]) => gripper(shown, projection, name)),
  );
}

function prepare(place) {
  const state = { view: new View(), scene: null, moment: null, beside: null, isChosen: false };
  state.redraw = () => paint(place, state);
  states.set(place, state);
  state.drawing = element("div", { className: "drawing" });
  place.replaceChildren(state.drawing);
  place.tabIndex = 0;
  steer(place, state.view, state.redraw);
  new ResizeObserver(state.redraw).observe(place);
  addButtons(place, state);
}

/** Buttons above the view that say what it shows. */
function addButtons(place, state) {
  const button = (text, press, more = {}) => {
    const made = element("button", { type: "button", className: "plain small", ...more }, text);
    made.addEventListener("click", () => {
      press();
      state.redraw();
    });
    return made;
  };
  const choose = (text) => {
    state.isChosen = true;
    state.view.reset();
    state.show(text);
  };
  const views = [CLOSE, ARM, WHOLE].map((text) => button(text, () => choose(text)));
  state.show = (text) => {
    state.shows = text;
    for (const each of views) each.ariaPressed = String(each.textContent === text);
  };
  state.armButton = views[1];
  const zooms = [
    button("From above", () => state.view.rise()),
    button("+", () => state.view.scale(1.3), { ariaLabel: "Zoom in" }),
    button("−", () => state.view.scale(1 / 1.3), { ariaLabel: "Zoom out" }),
  ];
  place.before(element("div", { className: "row views", role: "group", ariaLabel: "What the 3D view shows" }, ...views, ...zooms));
}

const titled = (node, text) => (node.append(svg("title", {}, text)), node);

function paint(place, state) {
  const { view, shows, scene } = state;
  const [width, height] = [place.clientWidth, place.clientHeight];
  if (!scene || !width || !height) return;
  const room = bounds(scene, shows);
  const corners = CORNERS.map((corner) => corner.map((side, k) => (side > 0 ? room.max : room.min)[k]));
  const projection = view.projection(corners, width, height);
  const write = writer(width, height);
  state.projection = projection;
  state.moving = svg("svg", { class: "moving", viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
  state.drawing.replaceChildren(
    svg(
      "svg",
      { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" },
      ...floor(room, scene.objects, projection),
      ...(shows !== WHOLE ? [] : [box(scene.workspace, projection, "workspace")]),
      ...(scene.boxes ?? []).map((item) => box(item, projection, "keep-out")),
      ...(scene.shown ?? []).map((item) => demonstrated(item, projection)),
      svg("g", { class: scene.play?.objects ? "shown" : "" }, ...inOrder(scene.objects, projection).flatMap((item) => solid(item, projection))),
      ...(scene.asked ?? []).map((item) => asked(item, projection)),
      ...(scene.ways ?? []).map((way) => line(way, projection, "way")),
      line(scene.path, projection, "path"),
      ...scene.frames.map((item) => gripper({ ...item, open: item.gripper_open }, projection, "ghost")),
      ...scene.frames.flatMap((item) => pose(item, projection)),
      ...frameLabels(scene.frames).map(([item, text]) => write(text, projection.at(item.position), "number", 12)),
      ...scene.objects.map((item) => write(item.label, projection.at(item.position), "named", 4 + 0.8 * BOX_M * projection.px_per_m)),
      ...compass(projection, height),
    ),
    state.moving,
  );
  paintMoment(state);
}

/** What the view has room for: the whole workspace, or where something is done. */
function bounds(scene, shows) {
  const places = [...scene.frames, ...scene.objects, ...(scene.shown ?? []), ...(scene.asked ?? [])].map((item) => item.position);
  const withArm = [...places, ...scene.path, ...(scene.play?.arm ?? []).flat()];
  const boxes = (scene.boxes ?? []).flatMap((item) => [item.min, item.max]);
  const whole = [scene.workspace.min, scene.workspace.max, ...withArm, ...boxes];
  // The arm's way from its ready pose is long; without an arm the hand is what one looks at, wherever it is.
  const near = { [CLOSE]: scene.play?.arm ? places : [...places, ...scene.path], [ARM]: withArm, [WHOLE]: [] }[shows];
  const points = near.length ? near : whole;
  const along = [0, 1, 2].map((k) => points.map((point) => point[k]));
  return { min: along.map((values) => Math.min(...values) - MARGIN_M), max: along.map((values) => Math.max(...values) + MARGIN_M) };
}

const inOrder = (items, { depth }) => [...items].sort((one, other) => depth(one.position) - depth(other.position));

const line = (points, projection, name) => svg("polyline", { class: name, points: text(points, projection) });

/** A grid that the lowest object stands on, a line every 10 cm. */
function floor({ min, max }, objects, projection) {
  const steps = (k) => {
    const first = Math.ceil(min[k] / GRID_M);
    return Array.from({ length: Math.max(0, Math.floor(max[k] / GRID_M) - first + 1) }, (_, n) => (first + n) * GRID_M);
  };
  const z = Math.min(...objects.map((item) => item.position[2] - BOX_M / 2), objects.length ? Infinity : min[2]);
  const across = [
    ...steps(0).map((x) => [[x, min[1], z], [x, max[1], z]]),
    ...steps(1).map((y) => [[min[0], y, z], [max[0], y, z]]),
  ];
  const plane = [[min[0], min[1], z], [max[0], min[1], z], [max[0], max[1], z], [min[0], max[1], z]];
  return [svg("polygon", { class: "floor", points: text(plane, projection) }), ...across.map((ends) => line(ends, projection, "grid"))];
}

function box({ min, max }, { at }, name) {
  const corners = CORNERS.map((corner) => at(corner.map((side, k) => (side > 0 ? max : min)[k])));
  const drawn = EDGES.map(([one, other]) => `M${corners[one].map(Math.round)}L${corners[other].map(Math.round)}`);
  return titled(svg("path", { class: name, d: drawn.join("") }), name);
}

/** An object as a small box, the sides that are seen; its axes if its rotation is known. */
function solid(item, projection) {
  const axes = item.axes ?? STANDING;
  const corner = (signs) => signs.reduce((point, sign, k) => plus(point, axes[k], (sign * BOX_M) / 2), item.position);
  const sides = [0, 1, 2].flatMap((k) => [-1, 1].map((sign) => ({ k, sign, normal: axes[k].map((value) => sign * value) })));
  const seen = sides.filter(({ normal }) => projection.faces(normal));
  const faces = seen.map(({ k, sign, normal }) => {
    const [a, b] = [0, 1, 2].filter((other) => other !== k);
    const around = [[-1, -1], [-1, 1], [1, 1], [1, -1]].map(([u, v]) => {
      const signs = [0, 0, 0];
      [signs[k], signs[a], signs[b]] = [sign, u, v];
      return corner(signs);
    });
    const shade = normal[2] > 0.7 ? 0 : normal[0] * projection.towards[1] - normal[1] * projection.towards[0] < 0 ? 1 : 2;
    return svg("polygon", { class: `shade-${shade}`, points: text(around, projection), fill: item.color });
  });
  const group = titled(svg("g", { class: "solid", "data-label": item.label }, ...faces), `${item.label}\n${meters(item.position)}`);
  return item.axes ? [group, ...triad(item, projection)] : [group];
}

const triad = ({ position, axes }, projection) =>
  axes.map((axis, k) => line([position, plus(position, axis, FRAME_M)], projection, `axis axis-${"xyz"[k]}`));

/** Where a demonstration has an object. */
function demonstrated(item, { at }) {
  const [cx, cy] = at(item.position);
  return titled(svg("circle", { class: "shown", cx, cy, r: 5, fill: item.color }), `${item.label} in a demonstration\n${meters(item.position)}`);
}

/** Where an object stood when it was asked about, and how it went. */
function asked({ label, position, fate, id }, { at }) {
  const [cx, cy] = at(position);
  return titled(svg("circle", { class: `asked ${fate}`, cx, cy, r: 7, "data-id": id }), `${label}, ${fate}\n${meters(position)}`);
}

function pose(item, projection) {
  const [cx, cy] = projection.at(item.position);
  const ring = svg("circle", { class: item.gripper_open ? "frame open" : "frame", cx, cy, r: 5 });
  const words = `${item.label}: gripper ${item.gripper_open ? "open" : "closed"}\n${meters(item.position)}`;
  return [...triad(item, projection), titled(ring, words)];
}

/** [frame, text]: those of one place share a label at the first of them. */
function frameLabels(frames) {
  const apart = (one, other) => Math.hypot(...one.position.map((value, k) => value - other.position[k]));
  const firsts = frames.map((item) => frames.findIndex((other) => apart(item, other) < SAME_PLACE_M));
  const together = (k) => frames.filter((_, other) => firsts[other] === k).map((item) => item.label);
  return frames.flatMap((item, k) => (firsts[k] === k ? [[item, together(k).join(", ")]] : []));
}

/** A function that writes words so many pixels beside a point, in the first place where no others stand; else nothing. */
function writer(width, height) {
  const taken = [];
  const apart = (one, other) => one.x + one.w < other.x || other.x + other.w < one.x || Math.abs(one.y - other.y) > LINE_PX;
  return (words, [x, y], name, nearest) => {
    const w = words.length * LETTER_PX;
    const within = (left) => Math.max(0, Math.min(width - w, left));
    const at = (d) => ({
      above: { x: within(x - w / 2), y: y - d - LINE_PX, w },
      below: { x: within(x - w / 2), y: y + d, w },
      right: { x: x + d, y: y - LINE_PX / 2, w },
      left: { x: x - d - w, y: y - LINE_PX / 2, w },
    });
    const rings = [0, 1, 2, 3].map((further) => at(nearest + further * LINE_PX));
    // Names go below their objects or above, where other objects are less likely than beside them.
    const sides = name === "number" ? rings.flatMap((ring) => [ring.above, ring.right, ring.left, ring.below]) : null;
    const places = sides ?? ["below", "above", "right", "left"].flatMap((side) => rings.map((ring) => ring[side]));
    const inside = (one) => one.x >= 0 && one.x + w <= width && one.y >= 0 && one.y + LINE_PX <= height;
    const chosen = places.find((one) => inside(one) && taken.every((other) => apart(one, other)));
    if (!chosen) return "";
    taken.push(chosen);
    return svg("text", { class: name, x: (chosen.x + w / 2).toFixed(1), y: (chosen.y + 12).toFixed(1) }, words);
  };
}

/** Which way the world's axes point, in a corner. */
function compass({ at }, height) {
  const [origin, corner] = [at([0, 0, 0]), [40, height - 40]];
  return STANDING.flatMap((axis, k) => {
    const along = at(axis).map((value, i) => value - origin[i]);
    const unit = Math.hypot(...STANDING.flatMap((each) => at(each).map((value, i) => value - origin[i]))) / Math.SQRT2;
    const [x, y] = along.map((value, i) => corner[i] + (26 * value) / unit);
    const name = `axis axis-${"xyz"[k]}`;
    const letter = along.map((value, i) => corner[i] + (36 * value) / unit);
    return [
      svg("polyline", { class: name, points: `${corner} ${x.toFixed(1)},${y.toFixed(1)}` }),
      svg("text", { class: `letter axis-${"xyz"[k]}`, x: letter[0].toFixed(1), y: (letter[1] + 4).toFixed(1) }, "xyz"[k]),
    ];
  });
}

/** The directions of x, y and z, a row each, as `frame` of app/web/scene.py gives them. */
export function axesOf([x, y, z, w]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
    [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
    [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
  ];
}
