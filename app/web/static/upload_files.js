// Files -> demonstrations: folders with metadata.json and trajectory.npz, or single .json files.

const PART = /^(metadata\.json|(trajectory|film_.+)\.npz|(rgb|depth|mask)_.+\.(png|jpe?g|npy))$/i;
const NEEDED = ["metadata.json", "trajectory.npz"];

/** Every file that was dropped, those in folders too, with its path. */
export async function collect(transfer) {
  // The items are emptied as soon as this handler waits for anything.
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean);
  return (await Promise.all(entries.map(walk))).flat();
}

async function walk(entry) {
  if (entry.isFile) {
    const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
    return [{ path: entry.fullPath.replace(/^\//, ""), file }];
  }
  const reader = entry.createReader();
  const inside = [];
  for (;;) {
    // Folders are read in batches of about a hundred.
    const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
    if (!some.length) break;
    inside.push(...some);
  }
  return (await Promise.all(inside.map(walk))).flat();
}

/** The demonstrations among files `{path, file}`, and `{path, reason}` of those that belong to none. */
export async function demonstrationsIn(files) {
  const folders = Map.groupBy(files, ({ path }) => path.slice(0, path.lastIndexOf("/") + 1));
  const demonstrations = [];
  const unused = [];
  for (const [folder, inside] of [...folders].sort(([one], [other]) => one.localeCompare(other, "en", { numeric: true }))) {
    const parts = inside.filter(({ file }) => PART.test(file.name));
    const complete = NEEDED.every((name) => parts.some(({ file }) => file.name === name));
    if (complete) demonstrations.push(ofParts(folder, parts));
    for (const item of inside) {
      if (complete && parts.includes(item)) continue;
      const { single, reason } = await alone(item, parts);
      if (single) demonstrations.push(single);
      else unused.push({ path: item.path, reason });
    }
  }
  return { demonstrations, unused };
}

function ofParts(folder, parts) {
  const request = () => {
    const body = new FormData();
    for (const { file } of parts) body.append(file.name.replace(/\.\w+$/, ""), file);
    return { body };
  };
  return { name: folder.replace(/\/$/, "") || "Chosen files", request };
}

/** The demonstration that a file holds by itself, or the reason why it holds none. `parts`: those of its folder. */
async function alone({ path, file }, parts) {
  if (PART.test(file.name) && file.name !== "metadata.json") return { reason: `${missing(parts)} is not beside it` };
  if (!file.name.endsWith(".json")) return { reason: "its name is not that of a demonstration's file" };
  let document;
  try {
    document = JSON.parse(await file.text());
  } catch (error) {
    return { reason: `it is not JSON: ${error.message}` };
  }
  const lacking = ["metadata", "trajectory"].filter((name) => !document?.[name]);
  if (!lacking.length) return { single: { name: path, request: () => ({ json: document }) } };
  if (file.name === "metadata.json") return { reason: `${missing(parts)} is not beside it` };
  return { reason: `it has no ${lacking.join(" and no ")}` };
}

const missing = (parts) => NEEDED.filter((name) => !parts.some(({ file }) => file.name === name)).join(" with ");
