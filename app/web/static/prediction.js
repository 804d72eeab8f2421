// One recorded prediction: its motion in 3D, and how the robot fared.

import { data } from "./dom.js";
import { listenForOutcome } from "./outcome.js";
import { mountPlayer } from "./player.js";
import { drawScene } from "./scene3d.js";

const view = document.getElementById("space-view");
const scene = data("scene");
drawScene(view, scene);
mountPlayer(view, scene.play, scene.play?.marks_s);
listenForOutcome(document.getElementById("main"), () => location.reload());
