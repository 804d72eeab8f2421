// One recorded prediction: its scene in 3D, and how the robot fared.

import { data } from "./dom.js";
import { listenForOutcome } from "./outcome.js";
import { drawScene } from "./scene3d.js";

drawScene(document.getElementById("space-view"), data("scene"));
listenForOutcome(document.getElementById("main"), () => location.reload());
