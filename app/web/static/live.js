// What runs now, asked for again and again while somebody looks: robots, which can be stopped, and predictions.

import { call, root, send } from "./api.js";
import { attempt, byId, element, sayProblem } from "./dom.js";
import { axesOf, drawScene, showMoment } from "./scene3d.js";

const [PAUSE_MS, RUNS_MS] = [1000, 250];
const SILENT_S = 2; // longer than any robot that is well
const none = byId("runs").firstElementChild;
const cards = new Map(); // of robots, by the id of their run

/** Do it now and, while the page is seen, a pause after each time that it was done. */
async function again(pause_ms, problem, run) {
  if (!document.hidden) {
    try {
      await run();
      problem.replaceChildren();
    } catch (error) {
      sayProblem(problem, error);
    }
  }
  setTimeout(() => again(pause_ms, problem, run), pause_ms);
}

async function lookAtPredictions() {
  byId("now").innerHTML = await (await send("/ui/live/now")).text(); // made by our own templates, which escape what they show
  // Screen readers hear the number when it changes, not every tick of the clock.
  const said = `${byId("now").querySelectorAll("section:first-of-type tbody tr").length} under way`;
  if (byId("count").textContent !== said) byId("count").textContent = said;
}

async function lookAtRobots() {
  const { runs } = await call("/ui/live/runs");
  const gone = [...cards.keys()].filter((id) => !runs.some((run) => run.id === id));
  for (const id of gone) {
    cards.get(id).place.remove();
    cards.delete(id);
  }
  for (const run of runs) {
    if (!cards.has(run.id)) cards.set(run.id, new Card(run));
    cards.get(run.id).show(run);
  }
  if (cards.size) none.remove();
  else byId("runs").append(none);
}

/** One robot: what it carries out, where it is, and the button that stops it. */
class Card {
  constructor(run) {
    this.id = run.id;
    this.stop = element("button", { type: "button", className: "stop" }, "Stop");
    this.stop.setAttribute("aria-label", `Stop the robot: ${run.instruction}`);
    this.stop.addEventListener("click", () => this.press());
    this.where = element("p", { className: "note" });
    this.problem = element("div");
    this.view = element("div", { className: "view3d", role: "group", ariaLabel: `The hand of the robot in 3D: ${run.instruction}` });
    this.words = element("div", {}, element("h3", { className: "instruction" }, run.instruction), this.where);
    const head = element("div", { className: "row spread" }, this.words, this.stop);
    this.place = element("div", { className: "card robot" }, head, this.problem, this.view);
    byId("runs").append(this.place);
    this.scene = run.scene;
  }

  press() {
    return attempt(this.problem, async () => {
      await call(`/runs/${this.id}/stop`, { method: "POST" });
      this.stop.disabled = true;
      this.stop.textContent = "Stopping";
    });
  }

  /** The scene is that of the prediction, once it is known. */
  async take(id) {
    this.prediction = id;
    const { scene } = await call(`/ui/predictions/${id}/result`);
    this.scene = { ...scene, play: null };
    this.words.append(element("a", { href: `${root}/ui/predictions/${id}` }, "Its prediction"));
  }

  show(run) {
    if (run.prediction_id && this.prediction !== run.prediction_id) attempt(this.problem, () => this.take(run.prediction_id));
    const number = this.scene.frames.length;
    const action = run.action ? `action ${run.action}${number ? ` of ${number}` : ""}` : "waits for its actions";
    const silent = run.silent_s > SILENT_S ? `; not heard of for ${run.silent_s.toFixed(0)} s` : "";
    const whose = run.hand && !run.is_measured ? "; the hand is drawn at its target" : "";
    this.where.textContent = `${run.task}: ${action}${whose}${silent}`;
    this.stop.disabled ||= run.stop;
    if (run.stop) this.stop.textContent = "Stopping";
    drawScene(this.view, { ...this.scene, play: run.arm && { arm: [run.arm] } });
    const { hand, open, arm } = run;
    showMoment(this.view, hand && { position: hand.position, axes: axesOf(hand.quaternion_xyzw), open, arm });
  }
}

again(PAUSE_MS, byId("problem"), lookAtPredictions);
again(RUNS_MS, byId("problem-of-robots"), lookAtRobots);
