// Deleting episodes: from their list, where this is the page's script, and from the page of one.

import { call } from "./api.js";
import { attempt, byId, confirmed, say } from "./dom.js";

/** Ask whether to delete an episode that people know by `name`, and do it; whether it is gone. */
export async function deleted(id, name) {
  const text = `${name} will no longer be shown to the LLM. Its recording cannot be brought back.`;
  if (!(await confirmed("Delete this episode?", text, "Delete", "danger"))) return false;
  say(byId("message"), "busy", "Deleting…");
  return (await attempt(byId("message"), () => call(`/episodes/${id}`, { method: "DELETE" }))) !== undefined;
}

byId("episodes")?.addEventListener("click", async (event) => {
  const button = event.target.closest("[data-delete]");
  if (!button || !(await deleted(button.dataset.delete, button.dataset.name))) return;
  const row = button.closest("tr");
  const next = (row.nextElementSibling ?? row.previousElementSibling)?.querySelector("a");
  row.remove();
  say(byId("message"), "good", `Deleted: ${button.dataset.name}.`);
  (next ?? byId("main")).focus();
});
