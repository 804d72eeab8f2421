// Small helpers around the document: elements, messages, confirmation.

export const byId = (id) => document.getElementById(id);

/** A new element with properties and children; text is never read as HTML. */
export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** A new element of a drawing. */
export function svg(tag, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** The value of a `<script type="application/json" id=...>` of the page. */
export function data(id) {
  return JSON.parse(byId(id).textContent);
}

/** Put a box into `place` that says `text`; kind: "busy", "good" or "bad". Screen readers announce it. */
export function say(place, kind, text) {
  const spinner = kind === "busy" ? [element("span", { className: "spinner", ariaHidden: "true" }), " "] : [];
  const box = element("div", { className: `card ${kind}`, role: kind === "bad" ? "alert" : "status" }, ...spinner, text);
  place.replaceChildren(box);
}

/** Put into `place` what went wrong, in the service's words. */
export function sayProblem(place, error) {
  const problem = error.problem ?? { title: "This page failed", detail: String(error) };
  const entries = (problem.errors ?? []).map((entry) =>
    element("li", {}, element("strong", {}, entry.field), `: ${entry.message}${entry.valid ? `. Valid: ${entry.valid}` : ""}`),
  );
  const what = entries.length ? element("ul", {}, ...entries) : element("p", {}, problem.detail ?? "");
  const box = element("div", { className: "card bad", role: "alert" }, element("strong", {}, problem.title), what);
  place.replaceChildren(box);
}

/** What `run` resolves to; undefined if it fails, after `place` says why. */
export async function attempt(place, run) {
  try {
    return await run();
  } catch (error) {
    sayProblem(place, error);
  }
}

/**
 * Ask in a dialog; whether the answer is yes. Escape and Cancel say no, and the focus goes back.
 * @param look class of the button that says yes, e.g. "danger"
 */
export function confirmed(title, text, yes, look = "") {
  const cancel = element("button", { className: "plain", value: "no", autofocus: true }, "Cancel");
  const form = element(
    "form",
    { method: "dialog" },
    element("h2", { id: "question" }, title),
    element("p", {}, text),
    element("div", { className: "row" }, element("button", { value: "yes", className: look }, yes), cancel),
  );
  const dialog = element("dialog", {}, form);
  dialog.setAttribute("aria-labelledby", "question");
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    });
  });
}
