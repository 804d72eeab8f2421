// Height and speed of the hand and its gripper over time, with keyframes and the moment that is shown.

import { element, svg } from "./dom.js";

const [WIDTH, LANE, GAP, BAND] = [1000, 54, 8, 16]; // units of the drawing, which is stretched to the page
const HEIGHT = 2 * (LANE + GAP) + BAND;

/** `{place, at}`: the drawing, and a function that moves its mark to a time; `seek` is called where it is pressed. */
export function drawTimeline(motion, marks_s, seek) {
  const end_s = motion.times_s.at(-1);
  const x = (time_s) => (WIDTH * time_s) / end_s;
  const heights = motion.positions.map((position) => position[2]);
  const now = svg("line", { class: "now", y1: 0, y2: HEIGHT });
  const upright = marks_s.map((time_s) => svg("line", { class: "mark", x1: x(time_s), x2: x(time_s), y1: 0, y2: HEIGHT }));
  const drawing = svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", "aria-hidden": "true" },
    ...gripperBand(motion, x),
    curve(motion.times_s, heights, x, 0, "height"),
    curve(motion.times_s, motion.speeds_m_s, x, LANE + GAP, "speed"),
    ...upright,
    now,
  );
  const to = (event) => {
    const { left, width } = drawing.getBoundingClientRect();
    seek((end_s * (event.clientX - left)) / width);
  };
  drawing.addEventListener("pointerdown", (event) => {
    drawing.setPointerCapture(event.pointerId);
    to(event);
  });
  drawing.addEventListener("pointermove", (event) => event.buttons && to(event));
  const range = (values, digits) => `${Math.min(...values).toFixed(digits)} to ${Math.max(...values).toFixed(digits)}`;
  const names = {
    height: `height ${range(heights, 2)} m`,
    speed: `speed of the hand, at most ${Math.max(...motion.speeds_m_s).toFixed(2)} m/s`,
    band: "gripper: green open, gray closed",
  };
  const labels = Object.entries(names).map(([className, words]) => element("span", { className }, words));
  const place = element("div", { className: "timeline" }, drawing, element("p", { className: "note row" }, ...labels));
  return { place, at: (time_s) => ["x1", "x2"].forEach((end) => now.setAttribute(end, x(time_s))) };
}

function curve(times_s, values, x, top, name) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const y = (value) => top + LANE - (LANE * (value - low)) / Math.max(high - low, 1e-6);
  const points = times_s.map((time_s, k) => `${x(time_s).toFixed(1)},${y(values[k]).toFixed(1)}`);
  return svg("polyline", { class: name, points: points.join(" ") });
}

function gripperBand({ times_s, open }, x) {
  const starts = times_s.flatMap((time_s, k) => (k === 0 || open[k] !== open[k - 1] ? [k] : []));
  return starts.map((first, k) => {
    const [start, end] = [x(times_s[first]), x(times_s[starts[k + 1] ?? times_s.length - 1])];
    const name = open[first] ? "open" : "closed";
    return svg("rect", { class: name, x: start, y: HEIGHT - BAND, width: Math.max(0, end - start), height: BAND });
  });
}
