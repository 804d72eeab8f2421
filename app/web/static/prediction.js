// One recorded prediction: its scene in 3D, and how the robot fared.

import { data, sayProblem } from "./dom.js";
import { listenForOutcome } from "./outcome.js";
import { inBothModes, whenNear } from "./plot.js";
import { drawScene } from "./scene3d.js";

const view = document.getElementById("space-view");

async function draw() {
  try {
    view.querySelector("p")?.remove();
    await drawScene(view, data("scene"));
  } catch (error) {
    sayProblem(view, error);
  }
}

whenNear(view, () => inBothModes(draw));
listenForOutcome(document.getElementById("main"), () => location.reload());
