// Joint speed over time, with the threshold, the gripper's state and the keyframes.

import { CONFIG, color, layout, plotly } from "./plot.js";

const HEADROOM = 1.12;
const looksAtRest = ({ rule }) => !["uniform", "waypoints"].includes(rule);

/**
 * Draw into `place`.
 * @param motion what /ui/episodes/ID/motion answers
 * @param preview what /ui/episodes/ID/keyframes answers
 * @param rule {rule, delta_rad_s}: `authors` looks at the fastest joint, the others at the norm of all
 */
export async function drawMotion(place, motion, preview, rule) {
  const Plotly = await plotly();
  const { name, unit, speeds } = speedOf(motion, rule);
  const top = Math.max(...speeds, 1e-6) * HEADROOM;
  const threshold = looksAtRest(rule) && motion.has_joints ? [thresholdLine(rule.delta_rad_s)] : [];
  const shapes = [...threshold, ...gripperBand(motion.gripper), ...keyframeLines(preview)];
  const curve = {
    type: motion.times_s.length > 5000 ? "scattergl" : "scatter",
    x: motion.times_s,
    y: speeds,
    mode: "lines",
    line: { color: color("curve"), width: 1.8 },
    hovertemplate: `%{x:.2f} s: %{y:.3f} ${unit}<extra></extra>`,
  };
  await Plotly.react(place, [curve], figure(motion, name, top, shapes, annotations(motion, preview, rule, top)), CONFIG);
}

/** What the rule looks at; the hand's speed where no joints were recorded. */
function speedOf(motion, rule) {
  if (!motion.has_joints) return { name: "speed of the hand, m/s", unit: "m/s", speeds: motion.hand_m_s };
  if (rule.rule === "authors") return { name: "fastest joint, rad/s", unit: "rad/s", speeds: motion.fastest_joint_rad_s };
  return { name: "joint speed ‖q̇‖, rad/s", unit: "rad/s", speeds: motion.speed_rad_s };
}

function figure(motion, name, top, shapes, words) {
  const grid = { gridcolor: color("line"), zerolinecolor: color("line"), color: color("muted") };
  return layout({
    uirevision: "kept",
    showlegend: false,
    height: 340,
    shapes,
    annotations: words,
    xaxis: { ...grid, title: { text: "time, s" }, range: [0, motion.times_s.at(-1)], anchor: "y2" },
    yaxis: { ...grid, title: { text: name }, range: [0, top], domain: [0.16, 1], fixedrange: true },
    yaxis2: { domain: [0, 0.1], range: [0, 1], visible: false, fixedrange: true },
  });
}

const along = (y) => ({ type: "line", xref: "paper", x0: 0, x1: 1, yref: "y", y0: y, y1: y });

const thresholdLine = (delta) => ({ ...along(delta), line: { color: color("threshold"), width: 1.5, dash: "dash" } });

function gripperBand(stretches) {
  return stretches.map(([start, end, isOpen]) => ({
    type: "rect",
    xref: "x",
    x0: start,
    x1: end,
    yref: "y2",
    y0: 0,
    y1: 1,
    line: { width: 0 },
    fillcolor: color(isOpen ? "open" : "closed"),
    opacity: 0.45,
  }));
}

function keyframeLines({ keyframes, dropped_s }) {
  const upright = (x, line) => ({ type: "line", xref: "x", x0: x, x1: x, yref: "paper", y0: 0, y1: 1, line });
  return [
    ...dropped_s.map((x) => upright(x, { color: color("bad"), width: 1, dash: "dot" })),
    ...keyframes.map((item) => upright(item.time_s, { color: color(item.new ? "good" : "text"), width: item.new ? 2 : 1.2 })),
  ];
}

function annotations(motion, { keyframes }, rule, top) {
  const small = { showarrow: false, font: { size: 12, color: color("text") } };
  const numbers = keyframes.map((item) => ({
    ...small,
    text: String(item.number),
    xref: "x",
    x: item.time_s,
    yref: "paper",
    y: 1.02,
    yanchor: "bottom",
    font: { size: 12, color: color(item.new ? "good" : "text") },
  }));
  const total = motion.times_s.at(-1) || 1;
  const words = motion.gripper
    .filter(([start, end]) => (end - start) / total > 0.07)
    .map(([start, end, isOpen]) => ({ ...small, text: isOpen ? "open" : "closed", x: (start + end) / 2, yref: "y2", y: 0.5 }));
  if (!motion.has_joints || !looksAtRest(rule) || rule.delta_rad_s > top) return [...numbers, ...words];
  const rest = { ...small, text: `at rest below ${rule.delta_rad_s}`, xref: "paper", x: 1, xanchor: "right", y: rule.delta_rad_s, yanchor: "bottom" };
  return [...numbers, ...words, { ...rest, bgcolor: color("card"), font: { size: 12, color: color("threshold") } }];
}
