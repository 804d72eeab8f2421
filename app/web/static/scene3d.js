// The 3D view of a scene (app/web/scene.py): workspace box, path, end-effector frames, objects.

import { CONFIG, colour, layout, plotly } from "./plot.js";

const AXES = ["#d1242f", "#2da44e", "#3b82f6"]; // x, y, z
const FRAME_M = 0.06;
const OBJECT_M = 0.04;
const MARGIN_M = 0.02;

/** Draw `scene` into `place`, over what was there; the view that a person turned it to stays. */
export async function drawScene(place, scene) {
  const Plotly = await plotly();
  const traces = [
    box(scene.workspace),
    path(scene.path),
    ...triads("frames", scene.frames, FRAME_M),
    ...triads("objects", scene.objects.filter((item) => item.axes), OBJECT_M),
    ends(scene.frames),
    objects(scene.objects),
  ];
  await Plotly.react(place, traces, sceneLayout(scene), CONFIG);
}

function sceneLayout(scene) {
  const axis = (title, k) => ({
    title: { text: title },
    range: span(scene, k),
    color: colour("muted"),
    gridcolor: colour("line"),
    zerolinecolor: colour("line"),
    showbackground: false,
  });
  return layout({
    uirevision: "kept",
    margin: { l: 0, r: 0, t: 0, b: 0 },
    showlegend: false,
    scene: {
      aspectmode: "data",
      xaxis: axis("x, m", 0),
      yaxis: axis("y, m", 1),
      zaxis: axis("z, m", 2),
      camera: { eye: { x: 1.15, y: -1.25, z: 0.7 }, center: { x: 0, y: 0, z: -0.12 } },
    },
  });
}

/** From below the least to above the greatest coordinate of workspace, path and objects: nothing touches the edge. */
function span(scene, k) {
  const values = [scene.workspace.min, scene.workspace.max, ...scene.path, ...scene.objects.map((item) => item.position)];
  const along = values.map((point) => point[k]);
  return [Math.min(...along) - MARGIN_M, Math.max(...along) + MARGIN_M];
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
  return { type: "scatter3d", x, y, z, text: items.map((item) => item.label), hovertemplate: `%{text}<br>${place}`, ...more };
}

function ends(frames) {
  return markers(frames, {
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
