// Two predictions side by side: their scenes in 3D.

import { data } from "./dom.js";
import { drawScene } from "./scene3d.js";

for (const view of document.querySelectorAll("[data-scene]")) drawScene(view, data(view.dataset.scene));
