// Two predictions side by side: their motions in 3D.

import { data } from "./dom.js";
import { mountPlayer } from "./player.js";
import { drawScene } from "./scene3d.js";

for (const view of document.querySelectorAll("[data-scene]")) {
  const scene = data(view.dataset.scene);
  drawScene(view, scene);
  mountPlayer(view, scene.play, scene.play?.marks_s);
}
