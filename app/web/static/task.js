// A task's settings: what would change is listed and drawn before it is applied.

import { call, root } from "./api.js";
import { attempt, byId, data, element, say } from "./dom.js";
import { numbers } from "./fields.js";
import { drawScene } from "./scene3d.js";

const form = byId("settings");
const view = byId("space-view");
const scene = data("scene");
const stored = data("stored");

const CLICK_PX = 4; // a longer way of the pointer turns the view
const NEW_BOX_M = 0.1; // its edges

const point = (input, field) => numbers(input.value, field, 3);
const groups = () => [...form.querySelectorAll(".box")];
const ends = (group) => ({ min: group.querySelector("[name=low]"), max: group.querySelector("[name=high]") });
const boxOf = (group) => ({ min: point(ends(group).min, "keep_out.min"), max: point(ends(group).max, "keep_out.max") });
const ownWorkspace = () => ({ min: point(form.elements.min, "workspace.min"), max: point(form.elements.max, "workspace.max") });

/** What `read` returns as the only item of a list, which is empty if the form says something unreadable there. */
function readable(read) {
  try {
    return [read()];
  } catch {
    return [];
  }
}

/** Draw what can be read. */
function draw(isChanged) {
  const boxes = groups().flatMap((group) => readable(() => boxOf(group)));
  const [workspace = scene.workspace] = form.elements.preset.value ? [] : readable(ownWorkspace);
  drawScene(view, { ...scene, workspace, boxes, whole: isChanged || boxes.length > 0 });
}

/** The settings that the form says, in the API's words. Throws ProblemError for what cannot be read. */
function wanted() {
  const { arm, robot_base, robot_base_yaw_deg, preset, num_demonstrations } = form.elements;
  const boxes = groups().map(boxOf);
  const words = (input) => input.value.split(",").map((word) => word.trim()).filter(Boolean);
  const named = [...form.querySelectorAll("[name=alias]")].map((input) => [input.dataset.object, words(input)]);
  return {
    arm: arm.value || null,
    robot_base: point(robot_base, "robot_base"),
    robot_base_yaw_deg: robot_base_yaw_deg.valueAsNumber,
    workspace: preset.value ? { preset: preset.value } : ownWorkspace(),
    motion_limits: { keep_out: boxes },
    aliases: Object.fromEntries(named.filter(([, others]) => others.length)),
    num_demonstrations: num_demonstrations.valueAsNumber,
  };
}

/** [name, before, after] of each setting that the form changes. */
function changes(after) {
  return Object.keys(after).filter((name) => JSON.stringify(stored[name]) !== JSON.stringify(after[name]));
}

const text = (value) => JSON.stringify(value).replaceAll('"', "").replaceAll(",", ", ");

/** List what would change, and draw it. */
function look() {
  const { preset, min, max } = form.elements;
  for (const input of [min, max]) input.closest(".field").hidden = Boolean(preset.value);
  try {
    const after = wanted();
    const names = changes(after);
    if (names.length) byId("state").replaceChildren();
    const items = names.map((name) =>
      element("li", {}, element("strong", {}, name), ` ${text(stored[name])} → ${text(after[name])}`),
    );
    byId("changes").replaceChildren(...(items.length ? [element("ul", {}, ...items)] : []));
    byId("apply").disabled = !names.length;
    draw(names.length > 0);
  } catch (error) {
    draw(true);
    byId("apply").disabled = true;
    const [wrong] = error.problem?.errors ?? [];
    byId("changes").replaceChildren(wrong ? `${wrong.field} ${wrong.message}. Valid: ${wrong.valid}` : String(error));
  }
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const after = wanted();
  const json = Object.fromEntries(changes(after).map((name) => [name, after[name]]));
  say(byId("state"), "busy", "Applying…");
  await attempt(byId("state"), async () => {
    const seen = byId("version").textContent; // another change since, e.g. of boxes, must not be overwritten unseen
    await call(`/tasks/${encodeURIComponent(form.dataset.task)}?version=${seen}`, { method: "PUT", json });
    location.assign(`${location.pathname}?applied=true`);
  });
});
byId("add").addEventListener("click", () => {
  byId("boxes").append(byId("box").content.cloneNode(true));
  const group = byId("boxes").lastElementChild;
  const low = scene.workspace.min.map((value, k) => (k < 2 ? (value + scene.workspace.max[k] - NEW_BOX_M) / 2 : value));
  ends(group).min.value = low.map((value) => Number(value.toFixed(3))).join(" ");
  ends(group).max.value = low.map((value) => Number((value + NEW_BOX_M).toFixed(3))).join(" ");
  ends(group).min.focus();
  look();
});
byId("boxes").addEventListener("click", (event) => {
  if (!event.target.matches(".remove")) return;
  event.target.closest(".box").remove();
  byId("add").focus();
  look();
});
form.addEventListener("input", look);
let pressed = { clientX: 0, clientY: 0 };
view.addEventListener("pointerdown", (event) => (pressed = event));
view.addEventListener("pointerup", ({ clientX, clientY }) => {
  const { id } = document.elementFromPoint(clientX, clientY)?.dataset ?? {};
  if (id && Math.hypot(clientX - pressed.clientX, clientY - pressed.clientY) < CLICK_PX) location.assign(`${root}/ui/predictions/${id}`);
});
look();
