// Joints, height and speed of the hand and its gripper over time, with keyframes and the moment that is shown.

import { element, svg } from "./dom.js";

const [WIDTH, LANE, GAP, BAND] = [1000, 54, 8, 16]; // units of the drawing, which is stretched to the page
const COLORS = ["#1f6feb", "#bc4c00", "#1a7f37", "#8250df", "#cf222e", "#9a6700", "#6e7781"]; // of joints, from the base on
const DEGREES = 180 / Math.PI;

/** `{place, at, read}`: the drawing, functions that mark a time and write the values of moment k; `seek` is called where it is pressed. */
export function drawTimeline(motion, marks_s, seek) {
  const { times_s, joints } = motion;
  const end_s = times_s.at(-1);
  const x = (time_s) => (WIDTH * time_s) / end_s;
  const heights = motion.positions.map((position) => position[2]);
  const curves = [["height", heights, "m", 3], ["speed", motion.speeds_m_s, "m/s", 2]];
  const height = (curves.length + (joints ? 1 : 0)) * (LANE + GAP) + BAND;
  const all = joints && [Math.min(...joints.flat()), Math.max(...joints.flat())];
  const now = element("div", { className: "now" });
  const drawing = svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${height}`, preserveAspectRatio: "none", "aria-hidden": "true" },
    ...gripperBand(motion, x, height - BAND, BAND),
    ...curves.map(([name, values], lane) => curve(motion, values, x, lane * (LANE + GAP), { class: name })),
    ...(joints ?? []).map((angles, k) => curve(motion, angles, x, curves.length * (LANE + GAP), { stroke: COLORS[k % COLORS.length] }, all)),
    ...marks_s.map((time_s) => svg("line", { class: "mark", x1: x(time_s), x2: x(time_s), y1: 0, y2: height })),
  );
  drawing.style.height = `${height / 18}rem`;
  const to = (event) => {
    const { left, width } = drawing.getBoundingClientRect();
    seek((end_s * (event.clientX - left)) / width);
  };
  drawing.addEventListener("pointerdown", (event) => {
    drawing.setPointerCapture(event.pointerId);
    to(event);
  });
  drawing.addEventListener("pointermove", (event) => event.buttons && to(event));

  const readings = curves.map(([name, values, unit, digits]) => [{ className: name }, (k) => `${name} ${values[k].toFixed(digits)} ${unit}`]);
  readings.push([{ className: "band" }, (k) => `gripper ${motion.open[k] ? "open" : "closed"}`]);
  for (const [joint, angles] of (joints ?? []).entries())
    readings.push([{ style: `border-color: ${COLORS[joint % COLORS.length]}` }, (k) => `${joint ? "" : "joint "}${joint + 1}: ${String(Math.round(DEGREES * angles[k]) + 0).padStart(4)}°`]);
  const written = readings.map(([look, read]) => [element("span", look), read]);
  const legend = element("p", { className: "note row mono" }, ...written.map(([place]) => place));
  const place = element("div", { className: "timeline" }, element("div", { className: "lanes" }, drawing, now), legend);
  return {
    place,
    at: (time_s) => (now.style.transform = `translateX(${(100 * time_s) / end_s}%)`),
    read: (k) => written.forEach(([span, words]) => (span.textContent = words(k))),
  };
}

function curve({ times_s }, values, x, top, attributes, range) {
  const [low, high] = range ?? [Math.min(...values), Math.max(...values)];
  const y = (value) => top + LANE - (LANE * (value - low)) / Math.max(high - low, 1e-6);
  const points = times_s.slice(0, values.length).map((time_s, k) => `${x(time_s).toFixed(1)},${y(values[k]).toFixed(1)}`);
  return svg("polyline", { ...attributes, points: points.join(" ") });
}

/** [start, end, is open] in seconds of each time that the gripper stays as it is. */
export function gripperStates({ times_s, open }) {
  const starts = times_s.flatMap((time_s, k) => (k === 0 || open[k] !== open[k - 1] ? [k] : []));
  return starts.map((first, k) => [times_s[first], times_s[starts[k + 1] ?? times_s.length - 1], open[first]]);
}

/** A bar below curves that says so by its color. */
export const gripperBand = (motion, x, y, height) =>
  gripperStates(motion).map(([start, end, isOpen]) =>
    svg("rect", { class: isOpen ? "open" : "closed", x: x(start), y, width: Math.max(0, x(end) - x(start)), height }),
  );
