// What runs now, asked for again and again while somebody looks.

import { send } from "./api.js";
import { sayProblem } from "./dom.js";

const PAUSE_MS = 1000;
const place = document.getElementById("now");
const problem = document.getElementById("problem");
const count = document.getElementById("count");

async function look() {
  if (!document.hidden) {
    try {
      place.innerHTML = await (await send("/ui/live/now")).text(); // made by our own templates, which escape what they show
      problem.replaceChildren();
      // Screen readers hear the number when it changes, not every tick of the clock.
      const said = `${place.querySelectorAll("section:first-of-type tbody tr").length} under way`;
      if (count.textContent !== said) count.textContent = said;
    } catch (error) {
      sayProblem(problem, error);
    }
  }
  setTimeout(look, PAUSE_MS);
}

setTimeout(look, PAUSE_MS);
