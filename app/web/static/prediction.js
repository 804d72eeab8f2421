// One recorded prediction: its motion in 3D, beside a demonstration's if one is chosen, and its outcome.

import { call } from "./api.js";
import { attempt, byId, data } from "./dom.js";
import { listenForOutcome } from "./outcome.js";
import { playBeside, showMotion } from "./player.js";
import { drawScene } from "./scene3d.js";

const view = byId("space-view");
const scene = data("scene");
showMotion(view, scene);
listenForOutcome(byId("main"), () => location.reload());
byId("beside")?.addEventListener("change", ({ target }) =>
  attempt(byId("message"), async () => {
    const found = target.value ? await call(`/ui/episodes/${target.value}/motion`) : null;
    drawScene(view, found ? { ...scene, shown: found.scene.objects, ways: [found.scene.path] } : scene);
    playBeside(view, found?.play);
  }),
);
