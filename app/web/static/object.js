// Teach an object: mark it in an episode's pictures, keep labels, learn, and see where it is found.

import { call, root } from "./api.js";
import { attempt, byId, data, element, say, sayProblem } from "./dom.js";
import { mountMarking } from "./marking.js";

const AT_ONCE = 4; // episodes in a request
const ENOUGH = 3; // labeled episodes to rely on
const page = data("page");
const rows = byId("rows").tBodies[0];
const { label: form, learn: teaching } = document.forms;
const task = `/tasks/${encodeURIComponent(page.task)}`;
const name = () => form.elements.object.value;
let marks = [];
let shown = null; // the preview of the marks
let previewing = new AbortController();
let looking = null;

const pictures = Object.fromEntries(
  [...document.querySelectorAll(".marking")].map((place) => [
    place.dataset.camera,
    { place, ...mountMarking(place, () => form.elements.tool.value, add) },
  ]),
);

/** The marks as the API wants them: of arrows and of a camera's boxes the last one. */
function draft() {
  const body = { object: name(), episode_id: page.episode, clicks: {}, clicks_off: {}, boxes: {}, arrows: {} };
  for (const { kind, camera, at } of marks) {
    if (kind === "box") body.boxes[camera] = at;
    else if (kind === "arrow") body.arrows = { [camera]: at };
    else (body[kind === "on" ? "clicks" : "clicks_off"][camera] ??= []).push(at);
  }
  return body;
}

function draw() {
  for (const [camera, { place, show }] of Object.entries(pictures)) {
    const seen = shown?.cameras.find((item) => item.name === camera);
    show(seen?.outlines ?? [], marks.filter((mark) => mark.camera === camera));
    place.parentElement.querySelector(".count").textContent = seen ? `· ${seen.num_pixels} pixels are the object` : "";
  }
  byId("keep").disabled = !shown;
  byId("undo").disabled = byId("clear").disabled = !marks.length;
}

/** Ask what the marks mean; a mark that means nothing is taken back. */
async function preview() {
  previewing.abort();
  previewing = new AbortController();
  if (!marks.some(({ kind }) => kind === "on" || kind === "box")) {
    shown = null;
    draw();
    const text = marks.length ? "Click on the object, or drag a box around it." : "";
    text ? say(byId("state"), "", text) : byId("state").replaceChildren();
    return;
  }
  draw();
  byId("keep").disabled = true; // until the preview shows these marks
  const { signal } = previewing;
  try {
    shown = await call(`${task}/labels/preview`, { method: "POST", json: draft(), signal });
    const where = shown.cameras.filter((item) => item.num_pixels).map((item) => item.name);
    const yaw = shown.yaw_deg === null ? "" : ` Its x axis points ${Math.round(shown.yaw_deg)} degrees from x to y.`;
    say(byId("state"), "good", `${name()} is seen by ${where.join(", ")}.${yaw}`);
  } catch (error) {
    if (error.name === "AbortError") return;
    sayProblem(byId("state"), error);
    marks.pop();
  }
  draw();
}

function add(mark) {
  marks.push(mark);
  preview();
}

function start() {
  marks = [];
  shown = null;
  preview();
}

byId("undo").addEventListener("click", () => {
  marks.pop();
  preview();
});
byId("clear").addEventListener("click", start);
form.elements.object.addEventListener("change", () => {
  start();
  changed();
});
form.addEventListener("submit", async (event) => {
  event.preventDefault();
  byId("keep").disabled = true;
  try {
    await call(`${task}/labels`, { method: "POST", json: draft() });
    start();
    say(byId("state"), "good", `Kept: ${name()} in this episode.`);
    await changed();
  } catch (error) {
    sayProblem(byId("state"), error);
    draw();
  }
});

/** The object or its labels have changed: list them, and forget what was learned. */
async function changed() {
  looking?.abort();
  byId("found").hidden = true;
  byId("use").disabled = true;
  byId("learned").replaceChildren();
  for (const link of document.querySelectorAll(".elsewhere")) link.search = `?name=${encodeURIComponent(name())}`;
  history.replaceState(null, "", `?name=${encodeURIComponent(name())}`);
  await attempt(byId("learned"), async () => {
    const { labels } = await call(`${task}/labels?object=${encodeURIComponent(name())}`);
    byId("labels").replaceChildren(...labels.map(entry));
    const number = new Set(labels.map((label) => label.episode_id ?? label.id)).size;
    const advice = number < ENOUGH ? "one is enough to try, three are to rely on." : "enough to rely on, if they fit each other.";
    byId("enough").textContent = `${name()}: ${number} labeled episode${number === 1 ? "" : "s"}; ${advice}`;
    byId("look").disabled = !labels.length;
  });
}

function entry({ id, episode_id, cameras, yaw_deg }) {
  const where = episode_id === page.episode ? "this episode" : episode_id ? `episode ${episode_id.slice(0, 8)}` : "images of its own";
  const link = episode_id && episode_id !== page.episode ? element("a", { href: `${root}/ui/episodes/${episode_id}` }, where) : where;
  const pixels = cameras.map((camera) => `${camera.name} ${camera.num_pixels}`).join(", ");
  const yaw = yaw_deg === null ? "" : `, x axis at ${Math.round(yaw_deg)} degrees`;
  const remove = element("button", { type: "button", className: "danger small" }, "Remove");
  remove.setAttribute("aria-label", `Remove the label in ${where}`);
  remove.addEventListener("click", () =>
    attempt(byId("learned"), async () => {
      await call(`${task}/labels/${id}`, { method: "DELETE" });
      await changed();
      form.elements.object.focus();
    }),
  );
  return element("li", {}, element("span", {}, link, element("span", { className: "note" }, ` pixels: ${pixels}${yaw}`)), remove);
}

function wanted() {
  const { symmetric, yaw_may_be_unknown } = teaching.elements;
  const turn = Number(symmetric.value) || symmetric.value;
  return { object: name(), symmetric: turn, yaw_may_be_unknown: yaw_may_be_unknown.checked };
}

const meters = (position) => position.map((value) => (Math.round(1000 * value) / 1000 + 0).toFixed(3)).join(", ");

/** What was found in an episode, as a row. */
function row({ episode_id, pose, refusal }) {
  const here = episode_id === page.episode;
  const link = element("a", { href: `${root}/ui/episodes/${episode_id}` }, here ? "this episode" : episode_id.slice(0, 8));
  const kind = pose ? "success" : refusal ? "failure" : "unknown";
  const badge = element("span", { className: `badge ${kind}` }, pose ? "found" : refusal ? "refused" : "no pictures");
  const what = element("td", { className: "full" });
  if (pose) {
    const yaw = pose.quaternion_xyzw ? "" : ", yaw unknown";
    const reason = pose.reason ? `; ${pose.reason}` : "";
    what.append(`at ${meters(pose.position)} m${yaw}, in ${pose.cameras.join(", ")}, confidence ${pose.confidence.toFixed(2)}${reason}`);
  } else if (refusal) {
    const address = `${root}/ui/episodes/${episode_id}/object?name=${encodeURIComponent(name())}`;
    const again = here ? [] : [" ", element("a", { href: address }, "Label it there")];
    what.append(`${refusal.message}. What helps: ${refusal.valid ?? "another view"}.`, ...again);
  } else what.append("no camera with color and depth: its pose stays as it was given");
  return element("tr", {}, element("th", { scope: "row" }, link), element("td", {}, badge), what);
}

/** Look for the object in all episodes, some at a time; what is known so far is shown. */
async function tryOut(model, signal) {
  const counts = { found: 0, refused: 0, "without pictures": 0 };
  const { episodes, num_episodes } = page;
  rows.replaceChildren();
  byId("found").hidden = byId("stop").hidden = false;
  const say = (tried) => {
    const outcome = Object.entries(counts).filter(([, count]) => count).map(([what, count]) => `${count} ${what}`);
    const of = episodes.length < num_episodes ? `the newest ${episodes.length} of ${num_episodes}` : String(num_episodes);
    byId("progress").textContent = `${tried} of ${of} episodes: ${outcome.join(", ") || "looking…"}`;
  };
  say(0);
  for (let first = 0; first < episodes.length; first += AT_ONCE) {
    const json = { object: name(), model, episode_ids: episodes.slice(first, first + AT_ONCE) };
    const { episodes: tried } = await call(`${task}/object_models/try`, { method: "POST", json, signal });
    for (const each of tried) counts[each.pose ? "found" : each.refusal ? "refused" : "without pictures"] += 1;
    rows.append(...tried.map(row));
    say(Math.min(first + AT_ONCE, episodes.length));
  }
}

teaching.addEventListener("submit", async (event) => {
  event.preventDefault();
  looking?.abort();
  looking = new AbortController();
  const { signal } = looking;
  byId("use").disabled = true;
  say(byId("learned"), "busy", "Learning…");
  try {
    const { model, advice } = await call(`${task}/labels/learn`, { method: "POST", json: { ...wanted(), dry_run: true }, signal });
    const out = model.left_out.map(({ reason }) => ` A view was left out: ${reason}.`).join("");
    say(byId("learned"), model.left_out.length ? "" : "good", `Learned from ${model.views.length} of ${model.views.length + model.left_out.length} views.${advice ? ` ${advice}.` : ""}${out}`);
    byId("use").disabled = false;
    await tryOut(model, signal);
  } catch (error) {
    if (error.name !== "AbortError") sayProblem(byId("learned"), error);
  } finally {
    byId("stop").hidden = true;
  }
});
teaching.addEventListener("change", () => {
  byId("use").disabled = true; // what was learned was learned otherwise
});
byId("stop").addEventListener("click", () => looking?.abort());
byId("use").addEventListener("click", async () => {
  byId("use").disabled = true;
  say(byId("learned"), "busy", "Extracting every episode again…");
  await attempt(byId("learned"), async () => {
    await call(`${task}/labels/learn`, { method: "POST", json: wanted() });
    say(byId("learned"), "good", `${page.task} finds ${name()} by this from now on; every episode was extracted again.`);
  });
});
for (const picture of Object.values(pictures)) picture.show([], []);
draw();
changed();
