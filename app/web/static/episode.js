// One episode: plots, the keyframe rule tried out and applied, deletion.

import { call, root, send } from "./api.js";
import { attempt, byId, confirmed, data, element, say, sayProblem } from "./dom.js";
import { deleted } from "./episodes.js";
import { drawMotion } from "./motion_plot.js";
import { mountPlayer } from "./player.js";
import { drawScene } from "./scene3d.js";

const PAUSE_MS = 60;
const section = byId("keyframes");
const form = byId("rule");
const slider = byId("delta-slider");
const { episode, task, episodes } = section.dataset;
const stored = data("stored");
const motion = call(`/ui/episodes/${episode}/motion`);
let preview = data("preview");
let marked = null; // the keyframes of the player that is there
let asked = new AbortController();
let waiting;

/** The rule that the form says, with all its numbers. */
function chosenRule() {
  const { rule, ...numbers } = Object.fromEntries(Object.keys(stored).map((name) => [name, form.elements[name]]));
  return { rule: rule.value, ...Object.fromEntries(Object.entries(numbers).map(([name, input]) => [name, input.valueAsNumber])) };
}

function isChanged() {
  return Object.entries(chosenRule()).some(([name, value]) => stored[name] !== value);
}

/** Show the fields of the chosen rule and the buttons that make sense; nothing hidden may be wrong. */
function arrange() {
  const { rule, delta_rad_s } = chosenRule();
  for (const field of form.querySelectorAll("[data-for]")) {
    field.hidden = !field.dataset.for.split(" ").includes(rule);
    const input = field.querySelector("input[name]");
    if (field.hidden && input && !input.checkValidity()) input.value = stored[input.name];
  }
  slider.setAttribute("aria-valuetext", `${delta_rad_s} rad/s`);
  byId("apply").disabled = byId("reset").disabled = !isChanged();
}

/** Put the slider where the number is. */
function followNumber() {
  const { delta_rad_s } = chosenRule();
  if (delta_rad_s > 0) slider.value = Math.log10(delta_rad_s);
}

const drawSpeed = () => attempt(byId("speed"), async () => drawMotion(byId("speed"), await motion, preview, chosenRule()));

const drawSpace = () =>
  attempt(byId("space-view"), async () => {
    const { scene, play } = await motion;
    drawScene(byId("space-view"), { ...scene, play, frames: preview.frames });
    const marks_s = preview.keyframes.map((item) => item.time_s);
    if (String(marks_s) !== marked) mountPlayer(byId("space-view"), play, marks_s);
    marked = String(marks_s);
  });

/** Ask what the rule would find; the service's own rule, so that it is what applying it gives. */
async function look() {
  if (!form.checkValidity()) return;
  asked.abort();
  asked = new AbortController();
  const query = new URLSearchParams(chosenRule());
  try {
    preview = await call(`/ui/episodes/${episode}/keyframes?${query}`, { signal: asked.signal });
  } catch (error) {
    if (error.name !== "AbortError") sayProblem(byId("problem"), error);
    return;
  }
  byId("problem").replaceChildren();
  byId("table").innerHTML = preview.html;
  history.replaceState(null, "", isChanged() ? `?${query}` : location.pathname);
  drawSpeed();
  drawSpace();
}

function changed() {
  arrange();
  if (!form.checkValidity()) return;
  drawSpeed();
  clearTimeout(waiting);
  waiting = setTimeout(look, PAUSE_MS);
}

form.addEventListener("submit", (event) => event.preventDefault());
form.addEventListener("change", () => form.reportValidity());
form.addEventListener("input", (event) => {
  // The number is rounded, so it must not move the slider back: one could never leave a step.
  if (event.target === slider) form.elements.delta_rad_s.value = Number((10 ** slider.value).toPrecision(3));
  else followNumber();
  changed();
});
byId("reset").addEventListener("click", () => {
  for (const [name, value] of Object.entries(stored)) form.elements[name].value = value;
  followNumber();
  changed();
});
byId("apply").addEventListener("click", async () => {
  const { rule } = chosenRule();
  const text = `All ${episodes} episodes of ${task} are extracted again with the rule ${rule} of the form; later prompts show what is found then.`;
  if (!(await confirmed("Apply to the whole task?", text, "Apply"))) return;
  say(byId("problem"), "busy", `Extracting ${episodes} episodes again…`);
  await attempt(byId("problem"), async () => {
    await call(`/tasks/${encodeURIComponent(task)}`, { method: "PUT", json: { keyframes: chosenRule() } });
    location.assign(`${location.pathname}?applied=true`);
  });
});
byId("delete").addEventListener("click", async () => {
  if (await deleted(episode, "It")) location.assign(`${root}/ui/episodes?task=${encodeURIComponent(task)}`);
});

byId("correct").addEventListener("submit", async (event) => {
  event.preventDefault();
  const { instruction, left_out, note } = event.target.elements;
  const json = { instruction: instruction.value, left_out: left_out.checked, note: note.value };
  say(byId("corrected"), "busy", "Saving…");
  await attempt(byId("corrected"), async () => {
    await call(`/episodes/${episode}`, { method: "PATCH", json });
    location.reload();
  });
});

/** Its texts take the service seconds: they are fetched as soon as a person gets near to them. */
const texts = new IntersectionObserver(([{ isIntersecting, target }]) => {
  if (!isIntersecting) return;
  texts.disconnect();
  const place = element("div", { className: "note" }, element("span", { className: "spinner" }), " Aligning the task's demonstrations…");
  target.append(place);
  attempt(place, async () => {
    const page = await (await send(`/ui/episodes/${episode}/texts`)).text();
    target.replaceWith(new DOMParser().parseFromString(page, "text/html").getElementById("text"));
  });
});
texts.observe(byId("text"));

followNumber();
arrange();
drawSpeed();
drawSpace();
