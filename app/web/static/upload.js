// Upload: what is dropped or chosen is sorted into demonstrations, and each is sent on its own.

import { root, send } from "./api.js";
import { element, findings, say, sayProblem } from "./dom.js";
import { collect, demonstrationsIn } from "./upload_files.js";

const drop = document.getElementById("drop");
const summary = document.getElementById("summary");
const list = document.getElementById("found");
const MAX_NAMED = 5;
let waiting = Promise.resolve();

for (const id of ["folder", "files"]) {
  const input = document.getElementById(id);
  input.addEventListener("change", () => {
    const files = [...input.files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
    input.value = "";
    upload(files);
  });
}
for (const kind of ["dragenter", "dragover"]) {
  drop.addEventListener(kind, (event) => {
    event.preventDefault();
    drop.classList.add("over");
  });
}
drop.addEventListener("dragleave", () => drop.classList.remove("over"));
drop.addEventListener("drop", async (event) => {
  event.preventDefault();
  drop.classList.remove("over");
  upload(await collect(event.dataTransfer));
});

/** Send the demonstrations among `files`, after those that are under way. */
function upload(files) {
  waiting = waiting.then(() => sendAll(files)).catch((error) => sayProblem(summary, error));
}

async function sendAll(files) {
  const { demonstrations, unused } = await demonstrationsIn(files);
  if (!demonstrations.length) {
    const detail = "A demonstration is metadata.json with trajectory.npz beside it, or a .json file that holds both.";
    sayProblem(summary, { problem: { title: "No demonstration among these files", detail } });
    summary.firstChild.append(...ignored(unused));
    return;
  }
  const entries = demonstrations.map((item) => ({ item, place: entry(item) }));
  let stored = 0;
  for (const [done, { item, place }] of entries.entries()) {
    say(summary, "busy", `Sending ${done + 1} of ${entries.length}…`);
    stored += (await sendOne(item, place)) ? 1 : 0;
  }
  const refused = entries.length - stored;
  say(summary, refused ? "bad" : "good", `${stored} stored${refused ? `, ${refused} refused: see below` : ""}.`);
  summary.firstChild.append(...ignored(unused));
}

/** Which files were not used, each with the reason; nothing if there is none. */
function ignored(unused) {
  if (!unused.length) return [];
  const listed = unused.slice(0, MAX_NAMED).map(({ path, reason }) => element("li", {}, element("strong", {}, path), `: ${reason}`));
  if (unused.length > MAX_NAMED) listed.push(element("li", {}, `and ${unused.length - MAX_NAMED} more`));
  return [element("p", {}, "Not used:"), element("ul", {}, ...listed)];
}

function entry(item) {
  const place = element("div", {}, element("span", { className: "note" }, "waiting"));
  list.append(element("li", { className: "card" }, element("strong", {}, item.name), place));
  return place;
}

/** Whether the service stored it; `place` says what became of it. */
async function sendOne(item, place) {
  say(place, "busy", "Sending…");
  try {
    const response = await send("/episodes", { method: "POST", ...item.request() });
    const episode = await response.json();
    const link = element("a", { href: `${root}/ui/episodes/${episode.id}` }, `“${episode.instruction}” of ${episode.task}`);
    const summary = `: ${episode.num_frames} frames, ${episode.keyframes.length} keyframes`;
    place.replaceChildren(link, summary, ...findings(episode.findings));
    return true;
  } catch (error) {
    sayProblem(place, error);
    return false;
  }
}
