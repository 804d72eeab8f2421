// Predictions side by side: their motions in 3D, which play together.

import { data } from "./dom.js";
import { link, showMotion } from "./player.js";

const views = document.querySelectorAll("[data-scene]");
for (const view of views) showMotion(view, data(view.dataset.scene));
link(views);
