// The scene of a question: typed poses, or images with their cameras.

import { call, send } from "./api.js";
import { byId } from "./dom.js";
import { numbers, words, wrong } from "./fields.js";

const PART = /^((?:rgb|depth|mask)_.+)\.(?:png|jpe?g|npy)$/i;
const SETTINGS = ["model", "representation", "prompt_format", "system_prompt", "selection", "unfamiliar"];
const NUMBERS = ["num_demonstrations", "seed", "max_actions", "timeout_s", "temperature"];
const taken = new Map(); // images taken from an episode, by the name of their part

const edited = new Set(); // fields that a person changed since an episode was chosen: what is typed stays

const fromImages = (form) => form.elements.scene.value === "images";

/** The field of an object; undefined if the form does not have the object. */
function fieldOf(form, object, name) {
  const group = [...form.querySelectorAll("[data-object]")].find((each) => each.dataset.object === object);
  return group?.querySelector(`[name="${name}"]`);
}

/** Note what a person changes. */
export function watch(form) {
  form.addEventListener("input", ({ target }) => (target.id === "episode" ? edited.clear() : edited.add(target)));
}

function fill(field, value) {
  if (field && !edited.has(field)) field.value = value;
}

/** Show the fields of the chosen kind of scene; those not shown are not required. */
export function showKind(form) {
  const looks = fromImages(form);
  for (const place of form.querySelectorAll(".given")) {
    place.hidden = looks;
    for (const input of place.querySelectorAll("input")) input.disabled = looks;
  }
  for (const place of form.querySelectorAll(".looked")) place.hidden = !looks;
}

/** Take over the instruction and the objects of a stored episode. */
export async function takePoses(form, id) {
  const episode = await call(`/episodes/${id}`);
  fill(form.elements.instruction, episode.instruction);
  for (const { name, position, quaternion_xyzw } of episode.objects) {
    ["x", "y", "z"].forEach((axis, k) => fill(fieldOf(form, name, axis), position[k].toFixed(4)));
    fill(fieldOf(form, name, "quaternion"), (quaternion_xyzw ?? []).map((value) => Number(value.toFixed(5)) + 0).join(" "));
  }
}

/** Take over its cameras and images, and the objects' ids in its masks. */
export async function takeImages(form, id) {
  const before = byId("files").value;
  const { cameras, images, mask_ids } = await call(`/ui/predict/scenes/${id}`);
  for (const [name, ids] of Object.entries(mask_ids)) fill(fieldOf(form, name, "mask_ids"), ids.join(" "));
  fill(byId("cameras"), JSON.stringify(cameras, null, 1));
  listCameras();
  taken.clear();
  for (const [part, address] of Object.entries(images)) taken.set(part, address);
  if (byId("files").value === before) byId("files").value = ""; // files chosen meanwhile are what is meant
  chosenImages();
}

/** Say which cameras would be sent, and where they come from. */
export function listCameras() {
  const place = byId("listed-cameras");
  try {
    const names = cameras().map((camera) => camera.name);
    place.textContent = names.length ? `Cameras: ${names.join(", ")}, as the episode has them.` : "No camera is known: describe one below.";
    byId("calibration").open = !names.length;
  } catch (error) {
    place.textContent = error.problem.errors[0].message;
  }
}

/** Say which images would be sent; returns the chosen files by the name of their part. */
export function chosenImages() {
  const parts = new Map();
  const unused = [];
  for (const file of byId("files").files) {
    const [, part] = PART.exec(file.name) ?? [];
    if (part) parts.set(part, file);
    else unused.push(file.name);
  }
  const listed = [...(parts.size ? parts.keys() : taken.keys())].join(", ");
  const whose = parts.size ? "Images" : "Images of the episode";
  const ignored = unused.length ? ` Not named as an image of a camera: ${unused.join(", ")}.` : "";
  byId("chosen-images").textContent = (listed ? `${whose}: ${listed}.` : "No image is chosen yet.") + ignored;
  return parts;
}

/** `more => options of fetch`: the request that the form describes. Throws ProblemError for what cannot be read. */
export async function requestOf(form) {
  const document = documentOf(form);
  if (!fromImages(form)) return (more) => ({ json: { ...document, ...more } });
  const parts = await images();
  return (more) => ({ body: bodyOf({ ...document, ...more }, parts) });
}

/** The chosen files, else the images taken from an episode, by the name of their part. */
async function images() {
  const parts = chosenImages();
  if (parts.size) return parts;
  if (!taken.size) throw wrong("images", "there are none", "files named rgb_CAMERA, depth_CAMERA, mask_CAMERA");
  const fetched = [...taken].map(async ([part, address]) => [part, await (await send(address)).blob()]);
  return new Map(await Promise.all(fetched));
}

function bodyOf(document, parts) {
  const body = new FormData();
  body.append("metadata", new Blob([JSON.stringify(document)], { type: "application/json" }), "metadata.json");
  for (const [name, file] of parts) body.append(name, file, name);
  return body;
}

function documentOf(form) {
  const found = {
    task: form.dataset.task,
    instruction: form.elements.instruction.value,
    objects: [...form.querySelectorAll("[data-object]")].map((group) => objectOf(group, fromImages(form))),
  };
  for (const name of SETTINGS) if (form.elements[name].value) found[name] = form.elements[name].value;
  for (const name of NUMBERS) if (form.elements[name].value) found[name] = form.elements[name].valueAsNumber;
  const ids = words(form.elements.episode_ids.value);
  if (ids.length) found.episode_ids = ids;
  const arm = form.elements.end_effector.value.trim();
  if (arm) {
    const values = numbers(arm, "end_effector", 7);
    found.end_effector = { position: values.slice(0, 3), quaternion_xyzw: values.slice(3) };
  }
  if (fromImages(form)) found.cameras = cameras();
  return found;
}

function objectOf(group, looks) {
  const name = group.dataset.object;
  const value = (field) => group.querySelector(`[name="${field}"]`).value.trim();
  if (looks) {
    const ids = value("mask_ids");
    return ids ? { name, mask_ids: numbers(ids, `objects[${name}].mask_ids`) } : { name };
  }
  const position = ["x", "y", "z"].map((axis) => Number(value(axis)));
  const quaternion = value("quaternion");
  const turn = quaternion ? { quaternion_xyzw: numbers(quaternion, `objects[${name}].quaternion_xyzw`, 4) } : {};
  return { name, position, ...turn };
}

function cameras() {
  try {
    return JSON.parse(byId("cameras").value);
  } catch (error) {
    throw wrong("cameras", `is not JSON: ${error.message}`, "a list of cameras");
  }
}
