// One recorded prediction: its motion in 3D, and its outcome.

import { call } from "./api.js";
import { data, sayProblem } from "./dom.js";
import { listenForOutcome } from "./outcome.js";
import { mountPlayer } from "./player.js";
import { drawScene } from "./scene3d.js";

const view = document.getElementById("space-view");
const scene = data("scene");
drawScene(view, scene);
mountPlayer(view, scene.play, scene.play?.marks_s);
listenForOutcome(document.getElementById("main"), () => location.reload());
document.getElementById("case").addEventListener("click", async ({ target }) => {
  const keep = target.ariaPressed !== "true";
  try {
    await call(`/predictions/${target.dataset.prediction}/case`, { method: keep ? "PUT" : "DELETE" });
    target.ariaPressed = String(keep);
  } catch (error) {
    sayProblem(document.getElementById("message"), error);
  }
});
