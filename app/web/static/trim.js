// The ends of an episode: two handles on the timeline choose the part that is kept.

import { call } from "./api.js";
import { attempt, byId, element, say } from "./dom.js";
import { seekTo } from "./player.js";

const STEP_S = 0.01;
const LEAST_S = 0.1; // between the handles
const percent = (share) => `${(100 * share).toFixed(2)}%`;

/** Let the buttons of `place` trim the episode that `view` plays, which is `end_s` long as it is kept. */
export function mountTrim(place, view, end_s) {
  const { episode, start, end } = place.dataset; // of the kept part, seconds of the whole recording; no end: the last frame
  const open = byId("trim-open");
  const save = async (trim) => {
    say(byId("trim-state"), "busy", "Extracting the episode again…");
    await attempt(byId("trim-state"), async () => {
      await call(`/episodes/${episode}`, { method: "PATCH", json: { trim } });
      location.reload();
    });
  };
  const keep = (start_s, stop_s) =>
    save({ start_s: Number(start) + start_s, end_s: stop_s > end_s - STEP_S ? (end ? Number(end) : null) : Number(start) + stop_s });
  let drawn = [];
  open.addEventListener("click", () => {
    const wasOpen = drawn.some((each) => each.isConnected); // another keyframe rule draws a new timeline
    for (const each of drawn) each.remove();
    drawn = wasOpen ? [] : drawHandles(view, end_s, keep);
    drawn[0]?.querySelector("input").focus();
    open.setAttribute("aria-expanded", String(!wasOpen));
  });
  byId("trim-undo")?.addEventListener("click", () => save(null));
}

/** Draw handles over the lanes of the timeline, and a button that keeps what is between them; returns both. */
function drawHandles(view, end_s, keep) {
  const player = view.parentNode.querySelector(".player");
  const off = [element("div", { className: "off" }), element("div", { className: "off" })];
  const handle = (value, label) => element("input", { type: "range", min: 0, max: end_s, step: STEP_S, value, ariaLabel: label });
  const [first, last] = [handle(0, "Beginning of the kept part"), handle(end_s, "End of the kept part")];
  const button = element("button", { type: "button", className: "small" });
  const place = element("div", { className: "trim", role: "group", ariaLabel: "Trim the ends" }, ...off, first, last);
  const look = (moved) => {
    if (moved === first) first.value = Math.min(first.valueAsNumber, last.valueAsNumber - LEAST_S);
    if (moved === last) last.value = Math.max(last.valueAsNumber, first.valueAsNumber + LEAST_S);
    const [start_s, stop_s] = [first.valueAsNumber, last.valueAsNumber];
    Object.assign(off[0].style, { left: 0, width: percent(start_s / end_s) });
    Object.assign(off[1].style, { right: 0, width: percent(1 - stop_s / end_s) });
    for (const input of [first, last]) input.setAttribute("aria-valuetext", `${input.valueAsNumber.toFixed(2)} s`);
    button.textContent = `Keep ${start_s.toFixed(2)} to ${stop_s.toFixed(2)} s`;
    if (moved) seekTo(view, moved.valueAsNumber);
  };
  for (const input of [first, last]) {
    input.addEventListener("input", () => look(input));
    input.addEventListener("keydown", (event) => event.stopPropagation()); // arrows move the handle, not the moment
  }
  button.addEventListener("click", () => keep(first.valueAsNumber, last.valueAsNumber));
  player.querySelector(".lanes").append(place);
  player.querySelector(".timeline").append(button);
  look();
  return [place, button];
}
