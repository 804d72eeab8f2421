// Ask for a prediction and show it while it comes.

import { call, root, send } from "./api.js";
import { attempt, byId, element, say, sayProblem } from "./dom.js";
import { events } from "./events.js";
import { listenForOutcome } from "./outcome.js";
import { mountPlayer, showMotion } from "./player.js";
import { chosenImages, listCameras, requestOf, showKind, takeImages, takePoses, watch } from "./predict_scene.js";
import { axesOf, drawScene } from "./scene3d.js";

const TICK_MS = 100;
const form = byId("ask");
let filling = Promise.resolve(); // takes one episode's scene after the other
let running = null; // the AbortController of what runs
let scene = null;

function draw() {
  byId("space").hidden = false;
  drawScene(byId("space-view"), scene);
}

function add(action) {
  const label = String(scene.frames.length + 1);
  const arrived = { label, position: action.position, axes: axesOf(action.quaternion_xyzw), gripper_open: action.gripper_open };
  scene = { ...scene, path: [...scene.path, action.position], frames: [...scene.frames, arrived] };
  draw();
}

/** Run `work(signal)` with the buttons and the clock of a request under way. */
async function busy(text, work) {
  running = new AbortController();
  const started = performance.now();
  const tick = () => (byId("clock").textContent = `${((performance.now() - started) / 1000).toFixed(1)} s`);
  const clock = setInterval(tick, TICK_MS);
  for (const id of ["predict", "show"]) byId(id).disabled = true;
  byId("cancel").hidden = false;
  // a refused request must not stand above the prompt and the scene of the one before
  for (const id of ["coming", "space", "part-instruction"]) byId(id).hidden = true;
  for (const id of ["verdict", "result"]) byId(id).replaceChildren();
  say(byId("state"), "busy", text);
  try {
    await work(running.signal);
  } catch (error) {
    if (error.name === "AbortError") say(byId("state"), "", "Cancelled: the LLM was stopped, and nothing was recorded.");
    else await failed(error);
  } finally {
    running = null;
    clearInterval(clock);
    byId("clock").textContent = "";
    for (const id of ["predict", "show"]) byId(id).disabled = false;
    byId("cancel").hidden = true;
    byId("reply").classList.remove("writing");
  }
}

/** What the service said; a reply that is no list of actions was recorded, and its page tells more. */
async function failed(error) {
  sayProblem(byId("state"), error);
  const field = error.problem?.errors?.[0]?.field;
  if (field) focusOn(field);
  if (error.problem?.prediction_id) await showResult(error.problem.prediction_id);
}

/** Mark the form's field that a problem names, if it is one of them. */
function focusOn(field) {
  const named = /^objects\[(.+?)\]/.exec(field);
  const group = named && [...form.querySelectorAll("[data-object]")].find((each) => each.dataset.object === named[1]);
  const input = group ? group.querySelector("input:not([hidden])") : form.elements.namedItem(field.split(/[.[]/)[0]);
  if (!(input instanceof HTMLElement)) return;
  input.closest("details")?.setAttribute("open", "");
  input.setAttribute("aria-invalid", "true");
  input.focus();
}

async function showPrompt(body, signal) {
  const { html, scene: found } = await call("/ui/predict/prompt", { method: "POST", signal, ...body({ dry_run: true }) });
  byId("prompt").innerHTML = html; // made by our own templates, which escape what they show
  byId("part-instruction").hidden = false;
  scene = found;
  draw();
  mountPlayer(byId("space-view"), null);
}

/** The link and the result. */
async function showResult(id) {
  const { verdict, html, scene: found } = await call(`/ui/predictions/${id}/result`);
  const link = element("a", { className: "button plain", href: `${root}/ui/predictions/${id}` }, "Open this prediction");
  byId("coming").hidden = true;
  byId("verdict").innerHTML = verdict;
  byId("verdict").prepend(element("p", {}, link));
  byId("result").innerHTML = html;
  listenForOutcome(byId("verdict"), async (success) => {
    await showResult(id);
    say(byId("state"), "good", `Recorded: ${success ? "success" : "failure"}.`);
  });
  byId("space").hidden = false;
  scene = found;
  showMotion(byId("space-view"), scene);
  lookAtAnswer();
}

/** What comes is below the form. */
function lookAtAnswer() {
  byId("answer").focus({ preventScroll: true });
  byId("answer").scrollIntoView();
}

async function ask(body, signal) {
  await showPrompt(body, signal);
  say(byId("state"), "busy", `Asking ${form.elements.model.value}…`);
  byId("reply").textContent = "";
  byId("reply").classList.add("writing");
  byId("coming").hidden = false;
  lookAtAnswer();
  const headers = { Accept: "text/event-stream" };
  const response = await send("/predict", { method: "POST", headers, signal, ...body({ stream_text: true }) });
  for await (const { event, data } of events(response)) {
    if (event === "text") byId("reply").append(data.text);
    if (event === "action") add(data);
    if (event === "error") throw Object.assign(new Error(data.title), { problem: data });
    if (event === "done") {
      await showResult(data.id);
      say(byId("state"), "good", `${data.actions.length} actions in ${(data.timings_ms.total / 1000).toFixed(2)} s.`);
      return;
    }
  }
  throw new Error("The answer broke off before it was complete.");
}

/** The request as the form says it, or null after telling what is wrong with the form. */
async function read() {
  for (const input of form.querySelectorAll("[aria-invalid]")) input.removeAttribute("aria-invalid");
  await filling;
  if (!form.reportValidity()) return null;
  try {
    return await requestOf(form);
  } catch (error) {
    await failed(error);
    return null;
  }
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  if (running) return;
  const body = await read();
  if (!body) return;
  await busy("Writing the prompt…", async (signal) => {
    await ask(body, signal);
  });
});
byId("show").addEventListener("click", async () => {
  const body = await read();
  if (!body) return;
  await busy("Writing the prompt…", async (signal) => {
    await showPrompt(body, signal);
    say(byId("state"), "", "The prompt is below; no LLM was asked.");
  });
});
byId("cancel").addEventListener("click", () => running?.abort());
/** What is taken of the chosen episode; the last choice stays. */
function take(...parts) {
  const id = byId("episode").value;
  if (id) filling = filling.then(() => attempt(byId("filled"), () => Promise.all(parts.map((part) => part(form, id)))));
}

byId("episode").addEventListener("change", () => {
  byId("filled").replaceChildren();
  take(takePoses, takeImages);
});
for (const choice of form.elements.scene) {
  choice.addEventListener("change", () => {
    showKind(form);
    if (choice.value === "images") take(takeImages);
  });
}
byId("files").addEventListener("change", chosenImages);
byId("cameras").addEventListener("change", listCameras);
listCameras();
showKind(form);
watch(form);
// Another task is another form. The choice keeps the focus, so that arrow keys go on through the list.
byId("task").addEventListener("change", () => {
  sessionStorage.setItem("chosen", "task");
  byId("choose-task").submit();
});
if (sessionStorage.getItem("chosen")) byId("task").focus();
sessionStorage.removeItem("chosen");
