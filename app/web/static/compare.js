// Two predictions side by side: their scenes in 3D.

import { data, sayProblem } from "./dom.js";
import { inBothModes, whenNear } from "./plot.js";
import { drawScene } from "./scene3d.js";

for (const view of document.querySelectorAll("[data-scene]")) {
  const draw = async () => {
    try {
      view.querySelector("p")?.remove();
      await drawScene(view, data(view.dataset.scene));
    } catch (error) {
      sayProblem(view, error);
    }
  };
  whenNear(view, () => inBothModes(draw));
}
