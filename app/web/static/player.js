// Plays a motion (app/web/play.py) in the 3D view: buttons, a timeline of its curves, and the keyboard.

import { element } from "./dom.js";
import { axesOf, drawScene, showMoment } from "./scene3d.js";
import { drawTimeline } from "./timeline.js";

const SPEEDS = [0.25, 0.5, 1, 2, 4];
const STEP_S = 0.1;
const WORDS_MS = 100; // between readings while it plays
const players = new WeakMap();

/** Draw `scene` into `view`, and add a player of its motion, if it has one. */
export function showMotion(view, scene) {
  drawScene(view, scene);
  mountPlayer(view, scene.play);
}

/** Play another motion in the same view, faintly, from mark to mark as the first goes; null: no more. */
export function playBeside(view, motion) {
  const player = players.get(view);
  player.beside = motion;
  player.seek(player.time_s);
}

/** Add a player of `motion` to `view`, in which a scene is drawn; remove the present one. null: remove only. */
export function mountPlayer(view, motion, marks_s = motion?.marks_s ?? []) {
  players.get(view)?.remove();
  players.delete(view);
  if (!motion || motion.times_s.length < 2) return;
  const player = new Player(view, motion, marks_s);
  players.set(view, player);
  view.after(player.place);
}

class Player {
  constructor(view, motion, marks_s) {
    [this.view, this.motion, this.marks_s, this.end_s] = [view, motion, marks_s, motion.times_s.at(-1)];
    [this.time_s, this.written_ms, this.speed, this.playing, this.beside] = [0, 0, 1, false, null];
    this.toggle = element("button", { type: "button", className: "play" });
    this.scrubber = element("input", { type: "range", min: 0, max: this.end_s, step: 0.01, ariaLabel: "Moment of the motion" });
    this.clock = element("span", { className: "mono clock" });
    this.timeline = drawTimeline(motion, marks_s, (time_s) => this.seek(time_s));
    const bar = element("div", { className: "row" }, this.toggle, this.scrubber, this.clock, this.speeds());
    this.place = element("div", { className: "player", role: "group", ariaLabel: "Play the motion" }, bar, this.timeline.place);
    this.toggle.addEventListener("click", () => this.play(!this.playing));
    this.scrubber.addEventListener("input", () => this.seek(this.scrubber.valueAsNumber));
    this.place.addEventListener("keydown", (event) => this.key(event));
    this.onSpace = (event) => event.key === " " && this.key(event);
    view.addEventListener("keydown", this.onSpace);
    this.play(false);
  }

  speeds() {
    const options = SPEEDS.map((value) => element("option", { value, selected: value === 1 }, `${value}×`));
    const select = element("select", { ariaLabel: "Speed" }, ...options);
    select.addEventListener("change", () => (this.speed = Number(select.value)));
    return select;
  }

  remove() {
    this.play(false);
    this.view.removeEventListener("keydown", this.onSpace);
    this.place.remove();
    showMoment(this.view, null);
  }

  /** Space plays and stops, arrows step. Fields and buttons keep their own keys. */
  key(event) {
    const steps = { ArrowLeft: -STEP_S, ArrowRight: STEP_S, Home: -Infinity, End: Infinity };
    const field = event.target.tagName;
    if (event.key === " " && field !== "BUTTON" && field !== "SELECT") this.play(!this.playing);
    else if (event.key in steps && field !== "SELECT") this.seek(this.time_s + steps[event.key]);
    else return;
    event.preventDefault();
  }

  play(on) {
    if (on && this.time_s >= this.end_s) this.seek(0);
    this.playing = on;
    this.toggle.textContent = on ? "Pause" : "Play";
    if (on) this.next(performance.now());
    else this.seek(this.time_s);
  }

  next(before_ms) {
    requestAnimationFrame((now_ms) => {
      if (!this.playing) return;
      this.seek(this.time_s + (this.speed * Math.max(0, now_ms - before_ms)) / 1000);
      if (this.time_s < this.end_s) this.next(now_ms);
      else this.play(false);
    });
  }

  seek(time_s) {
    this.time_s = Math.min(this.end_s, Math.max(0, time_s));
    const moment = momentOf(this.motion, this.time_s);
    showMoment(this.view, moment, this.beside && momentOf(this.beside, this.timeBeside()));
    this.timeline.at(this.time_s);
    // Words that change faster than people read them only cost frames.
    const now_ms = performance.now();
    if (this.playing && now_ms - this.written_ms < WORDS_MS && this.time_s < this.end_s) return;
    this.written_ms = now_ms;
    this.scrubber.value = this.time_s;
    const said = `${this.time_s.toFixed(2)} of ${this.end_s.toFixed(2)} s`;
    this.clock.textContent = said;
    this.scrubber.setAttribute("aria-valuetext", `${said}, gripper ${moment.open ? "open" : "closed"}`);
    this.timeline.read(moment.index);
  }

  /** Where the motion beside is: as far from mark to mark as this one, or as a whole if their marks differ in number. */
  timeBeside() {
    const { marks_s, times_s } = this.beside;
    const same = marks_s.length === this.marks_s.length;
    const stops = (marks, end_s) => [0, ...(same ? marks : []), end_s];
    return between(this.time_s, stops(this.marks_s, this.end_s), stops(marks_s, times_s.at(-1)));
  }
}

/** The time of `to` that lies between its stops as `time` does between those of `from`, which are equally many. */
function between(time, from, to) {
  const k = Math.max(1, from.findIndex((stop) => time <= stop));
  return to[k - 1] + ((to[k] - to[k - 1]) * (time - from[k - 1])) / Math.max(from[k] - from[k - 1], 1e-9);
}

const mix = (one, other, share) => one.map((value, k) => value + share * (other[k] - value));

/** Hand and arm at a time: straight between the moments that there are. */
function momentOf({ times_s, positions, quaternions, open, arm, objects, turns }, time_s) {
  let [low, high] = [0, times_s.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times_s[middle] <= time_s) low = middle;
    else high = middle;
  }
  const share = Math.min(1, (time_s - times_s[low]) / (times_s[high] - times_s[low]));
  const [turn, next] = [quaternions[low], quaternions[high]];
  const same = turn.reduce((sum, value, k) => sum + value * next[k], 0) >= 0;
  const mixed = mix(turn, same ? next : next.map((value) => -value), share);
  const length = Math.hypot(...mixed);
  const links = arm?.[low] && arm[high] ? arm[low].map((point, k) => mix(point, arm[high][k], share)) : null;
  const nearest = share === 1 ? high : low;
  return {
    index: nearest,
    position: mix(positions[low], positions[high], share),
    axes: axesOf(mixed.map((value) => value / length)),
    open: open[nearest],
    arm: links,
    objects: objects?.[low].map((place, k) => ({ position: mix(place, objects[high][k], share), ...(turns && { axes: axesOf(turns[nearest][k]) }) })),
  };
}
