// The list of episodes: delete with confirmation.

import { call } from "./api.js";
import { confirmed, say, sayProblem } from "./dom.js";

const message = document.getElementById("message");

document.getElementById("episodes")?.addEventListener("click", async (event) => {
  const button = event.target.closest("[data-delete]");
  if (!button) return;
  const { delete: id, name } = button.dataset;
  const text = `${name} will no longer be shown to the LLM. Its recording cannot be brought back.`;
  if (!(await confirmed("Delete this episode?", text, "Delete", "danger"))) return;
  button.disabled = true;
  say(message, "busy", "Deleting…");
  try {
    await call(`/episodes/${id}`, { method: "DELETE" });
  } catch (error) {
    button.disabled = false;
    sayProblem(message, error);
    return;
  }
  const row = button.closest("tr");
  const next = (row.nextElementSibling ?? row.previousElementSibling)?.querySelector("a");
  row.remove();
  say(message, "good", `Deleted: ${name}.`);
  (next ?? document.getElementById("main")).focus();
});
