// The 3D view of a scene (app/web/scene3d.py): workspace box, path, end-effector frames, objects.

import { element } from "./dom.js";
import { CONFIG, colour, layout, plotly } from "./plot.js";

const AXES = ["#d1242f", "#2da44e", "#3b82f6"]; // x, y, z
const FRAME_M = 0.06;
const OBJECT_M = 0.04;
const MARGIN_M = 0.02;
const CLOSE_MARGIN_M = 0.08;
const SAME_PLACE_M = 0.01; // labels of frames that are nearer stand beside each other
const WHOLE = "Whole workspace";
const CLOSE = "Close to the motion";

/** Draw `scene` into `place`, over what was there; the view that a person turned it to stays. */
export async function drawScene(place, scene) {
  const Plotly = await plotly();
  // New traces every time: with those it has, plotly.js does not draw new ranges.
  const traces = () => [
    box(scene.workspace),
    path(scene.path),
    ...triads("frames", scene.frames, FRAME_M),
    ...triads("objects", scene.objects.filter((item) => item.axes), OBJECT_M),
    shown(scene.shown ?? []),
    ends(scene.frames),
    objects(scene.objects),
  ];
  place.drawAgain = () => Plotly.react(place, traces(), sceneLayout(scene, place.dataset.view), CONFIG);
  if (!place.dataset.view) addViews(place);
  await place.drawAgain();
}

/** Buttons above the view that say what it shows. */
function addViews(place) {
  place.dataset.view = WHOLE;
  const buttons = [WHOLE, CLOSE].map((view) => element("button", { type: "button", className: "plain small" }, view));
  const press = () => {
    for (const button of buttons) button.ariaPressed = String(button.textContent === place.dataset.view);
  };
  for (const button of buttons) {
    button.addEventListener("click", () => {
      place.dataset.view = button.textContent;
      press();
      place.drawAgain();
    });
  }
  press();
  place.before(element("div", { className: "row views", role: "group", ariaLabel: "What the 3D view shows" }, ...buttons));
}

function sceneLayout(scene, view) {
  const axis = (title, k) => ({
    title: { text: title },
    range: span(scene, k, view),
    color: colour("muted"),
    gridcolor: colour("line"),
    zerolinecolor: colour("line"),
    showbackground: false,
  });
  return layout({
    uirevision: view,
    margin: { l: 0, r: 0, t: 0, b: 0 },
    showlegend: false,
    scene: {
      aspectmode: "data",
      xaxis: axis("x, m", 0),
      yaxis: axis("y, m", 1),
      zaxis: axis("z, m", 2),
      camera: { eye: { x: 1.5, y: -1.6, z: 0.85 }, center: { x: 0, y: 0, z: -0.15 } },
    },
  });
}

/** The range of a coordinate. Of the whole: from below the least to above the greatest, so that nothing touches the edge. */
function span(scene, k, view) {
  const places = [...scene.frames, ...scene.objects, ...(scene.shown ?? [])].map((item) => item.position);
  const close = view === CLOSE && places.length > 0;
  const points = close ? places : [scene.workspace.min, scene.workspace.max, ...scene.path, ...places];
  const margin = close ? CLOSE_MARGIN_M : MARGIN_M;
  const along = points.map((point) => point[k]);
  return [Math.min(...along) - margin, Math.max(...along) + margin];
}

/** A trace of line segments, each a list of points; nulls keep them apart. */
function lines(segments, color, width, more = {}) {
  const points = segments.flatMap((segment) => [...segment, [null, null, null]]);
  const [x, y, z] = [0, 1, 2].map((k) => points.map((point) => point[k]));
  return { type: "scatter3d", mode: "lines", x, y, z, line: { color, width }, hoverinfo: "skip", ...more };
}

function box({ min, max }) {
  const corner = (bits) => [0, 1, 2].map((k) => (bits & (1 << k) ? max : min)[k]);
  const edges = [];
  for (let bits = 0; bits < 8; bits++) {
    for (const bit of [1, 2, 4]) if (!(bits & bit)) edges.push([corner(bits), corner(bits | bit)]);
  }
  return lines(edges, colour("edge"), 2, { name: "workspace" });
}

const path = (points) => lines([points], colour("curve"), 4, { name: "path" });

function triads(name, items, length_m) {
  return AXES.map((color, k) => {
    const segments = items.map(({ position, axes }) => [position, position.map((value, i) => value + length_m * axes[k][i])]);
    return lines(segments, color, 5, { name: `${name} ${"xyz"[k]}` });
  });
}

function markers(items, more) {
  const [x, y, z] = [0, 1, 2].map((k) => items.map((item) => item.position[k]));
  const place = "%{x:.3f}, %{y:.3f}, %{z:.3f} m<extra></extra>";
  const text = items.map((item) => item.label);
  return { type: "scatter3d", x, y, z, text, hovertext: text, hovertemplate: `%{hovertext}<br>${place}`, ...more };
}

/** The labels of frames, those of one place together at the first of them. */
function labels(frames) {
  const apart = (one, other) => Math.hypot(...one.position.map((value, k) => value - other.position[k]));
  const firsts = frames.map((item) => frames.findIndex((other) => apart(item, other) < SAME_PLACE_M));
  return frames.map((_, k) => frames.filter((__, other) => firsts[other] === k).map((item) => item.label).join(", "));
}

function ends(frames) {
  return markers(frames, {
    text: labels(frames),
    name: "frames",
    mode: "markers+text",
    textposition: "top center",
    textfont: { color: colour("text") },
    marker: {
      size: 5,
      color: colour("curve"),
      symbol: frames.map((item) => (item.gripper_open ? "circle-open" : "circle")),
    },
  });
}

function objects(items) {
  return markers(items, {
    name: "objects",
    mode: "markers+text",
    textposition: "bottom center",
    textfont: { color: colour("object") },
    marker: { size: 6, color: colour("object"), symbol: "square" },
  });
}

/** Where demonstrations have the objects. */
function shown(items) {
  return markers(items, { name: "shown", mode: "markers", marker: { size: 4, color: colour("object"), symbol: "circle", opacity: 0.35 } });
}

/** The directions of x, y and z, a row each, as `frame` of app/web/scene3d.py gives them. */
export function axesOf([x, y, z, w]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
    [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
    [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
  ];
}
