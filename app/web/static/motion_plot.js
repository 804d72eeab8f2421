// Joint speed over time, with the threshold, the gripper's state and the keyframes, as SVG in the page's colors.

import { svg } from "./dom.js";
import { gripperBand, gripperStates } from "./timeline.js";

const [LEFT, RIGHT, TOP, BOTTOM, HEIGHT, BAND] = [56, 16, 40, 44, 356, 22];
const HEADROOM = 1.12;
const TICKS = [60, 40]; // pixels between lines, about: along and up
const shown = new WeakMap(); // what is drawn in a place, for when it changes its width

/**
 * Draw into `place`.
 * @param motion what /ui/episodes/ID/motion answers
 * @param preview what /ui/episodes/ID/keyframes answers
 * @param rule {rule, delta_rad_s}: `authors` looks at the fastest joint, the others at the norm of all
 */
export function drawMotion(place, motion, preview, rule) {
  if (!shown.has(place)) new ResizeObserver(() => paint(place, ...shown.get(place))).observe(place);
  shown.set(place, [motion, preview, rule]);
  paint(place, motion, preview, rule);
}

function paint(place, motion, { keyframes, dropped_s }, rule) {
  const { name, speeds, times_s = motion.times_s } = speedOf(motion, rule);
  const [end_s, top, width] = [times_s.at(-1) || 1, Math.max(...speeds, 1e-6) * HEADROOM, place.clientWidth];
  const [floor, bottom] = [HEIGHT - BOTTOM - BAND, HEIGHT - BOTTOM];
  const x = (time_s) => LEFT + ((width - LEFT - RIGHT) * time_s) / end_s;
  const y = (speed) => floor - 8 - ((floor - 8 - TOP) * speed) / top;
  const line = (from, to, name, more = {}) => svg("line", { x1: from[0], y1: from[1], x2: to[0], y2: to[1], class: name, ...more });
  const word = (words, at, name) => svg("text", { x: at[0], y: at[1], class: name }, words);
  const points = times_s.map((time_s, k) => `${x(time_s).toFixed(1)},${y(speeds[k]).toFixed(1)}`);
  const rests = motion.has_joints && !["uniform", "waypoints"].includes(rule.rule) && rule.delta_rad_s <= top;
  const drawn = [
    ...ticks(top, (floor - TOP) / TICKS[1]).flatMap((value) => [line([LEFT, y(value)], [width - RIGHT, y(value)], "grid"), word(String(value), [LEFT - 6, y(value) + 4], "end")]),
    ...ticks(end_s, (width - LEFT) / TICKS[0]).flatMap((value) => [line([x(value), TOP], [x(value), bottom], "grid"), word(String(value), [x(value), bottom + 16])]),
    ...gripperBand(motion.play, x, floor, BAND),
    ...gripperStates(motion.play).filter(([start, end]) => x(end) - x(start) > 60).map(([start, end, isOpen]) => word(isOpen ? "open" : "closed", [x((start + end) / 2), floor + 16])),
    ...dropped_s.map((time_s) => line([x(time_s), TOP], [x(time_s), bottom], "dropped")),
    ...keyframes.map((item) => line([x(item.time_s), TOP], [x(item.time_s), bottom], item.new ? "keyframe new" : "keyframe")),
    ...keyframes.map((item) => word(String(item.number), [x(item.time_s), TOP - 6], item.new ? "new" : "")),
    svg("polyline", { class: "curve", points: points.join(" ") }),
    ...(rests ? [line([LEFT, y(rule.delta_rad_s)], [width - RIGHT, y(rule.delta_rad_s)], "threshold", { "data-rad-s": rule.delta_rad_s })] : []),
    ...(rests ? [word(`at rest below ${rule.delta_rad_s}`, [width - RIGHT, y(rule.delta_rad_s) - 5], "end threshold")] : []),
    word(name, [LEFT, 12], "start"),
    word("time, s", [width / 2, HEIGHT - 8]),
  ];
  place.replaceChildren(svg("svg", { viewBox: `0 0 ${width} ${HEIGHT}`, height: HEIGHT, "aria-hidden": "true" }, ...drawn));
}

/** What the rule looks at; the hand's speed where no joints were recorded. */
function speedOf(motion, rule) {
  if (!motion.has_joints) return { name: "speed of the hand, m/s", speeds: motion.play.speeds_m_s, times_s: motion.play.times_s };
  if (rule.rule === "authors") return { name: "fastest joint, rad/s", speeds: motion.fastest_joint_rad_s };
  return { name: "joint speed ‖q̇‖, rad/s", speeds: motion.speed_rad_s };
}

/** About `number` round numbers from 0 to `end`. */
function ticks(end, number) {
  const least = end / Math.max(1, number);
  const power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((times) => times * power).find((value) => value >= least);
  return Array.from({ length: Math.floor(end / step) + 1 }, (_, k) => Number((k * step).toPrecision(6)));
}
