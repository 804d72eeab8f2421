// The form of the outcome in prediction_result.html.

import { call } from "./api.js";
import { sayProblem } from "./dom.js";

/** Let the outcome form in `place` record; `recorded` is called afterwards, with whether it succeeded. */
export function listenForOutcome(place, recorded) {
  const form = place.querySelector("form.outcome");
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const success = event.submitter?.value === "true";
    const note = form.elements.note.value.trim();
    const buttons = form.querySelectorAll("button");
    for (const button of buttons) button.disabled = true;
    try {
      const json = { success, note: note || null };
      await call(`/predictions/${form.dataset.prediction}/outcome`, { method: "POST", json });
      await recorded(success);
    } catch (error) {
      sayProblem(form.querySelector(".problem-place"), error);
    } finally {
      for (const button of buttons) button.disabled = false;
    }
  });
  // Enter in the note must not record an outcome that was not chosen.
  form.elements.note.addEventListener("keydown", (event) => {
    if (event.key === "Enter") event.preventDefault();
  });
}
