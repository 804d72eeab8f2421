// A camera's picture that is marked by pointer or keyboard: clicks, boxes, arrows; masks are drawn over it.

import { svg } from "./dom.js";

const DRAG_PX = 6; // on the screen; less is a click
const STEP_PX = 8; // of the picture, for an arrow key

/**
 * Let people mark the picture in `place`.
 * @param tool () => "on", "off" or "arrow"
 * @param marked called with {kind, camera, at}: `at` is [x, y] of "on" and "off", [left, top, right, bottom] of a "box", and
 *   [tail, head] of an "arrow"
 * @returns {show(outlines, marks)}
 */
export function mountMarking(place, tool, marked) {
  const { camera, image } = place.dataset;
  const over = svg("g", {});
  const drawn = svg("g", {});
  const cross = svg("path", { class: "cross" });
  let [width, height] = [640, 480];
  let at = [width / 2, height / 2]; // the cross
  let from = null; // where a drag began, or a corner set by key
  let byKey = false;

  const picture = new Image();
  picture.addEventListener("load", () => {
    [width, height] = [picture.naturalWidth, picture.naturalHeight];
    place.setAttribute("viewBox", `0 0 ${width} ${height}`);
    place.replaceChildren(svg("image", { href: image, width, height }), over, drawn, cross);
    move([width / 2, height / 2]);
  });
  picture.src = image;

  const inside = ([x, y]) => [Math.min(width - 1, Math.max(0, x)), Math.min(height - 1, Math.max(0, y))];
  const radius = () => (5 * width) / (place.clientWidth || width);

  function move(point) {
    at = inside(point);
    cross.setAttribute("d", `M${at[0]} 0V${height}M0 ${at[1]}H${width}`);
    if (from && byKey) drawn.replaceChildren(...shapes(between(from, at), radius()));
  }

  function pixel(event) {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(place.getScreenCTM().inverse());
    return inside([Math.round(x * 10) / 10, Math.round(y * 10) / 10]);
  }

  function between(one, other) {
    if (tool() === "arrow") return { kind: "arrow", camera, at: [one, other] };
    const edges = [0, 1].map((k) => [one[k], other[k]].sort((a, b) => a - b));
    return { kind: "box", camera, at: [edges[0][0], edges[1][0], edges[0][1], edges[1][1]] };
  }

  function end(mark) {
    from = null;
    drawn.replaceChildren();
    if (mark) marked(mark);
  }

  place.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    [from, byKey] = [pixel(event), false];
    place.setPointerCapture(event.pointerId);
  });
  place.addEventListener("pointermove", (event) => {
    if (from && !byKey && tool() !== "off") drawn.replaceChildren(...shapes(between(from, pixel(event)), radius()));
  });
  place.addEventListener("pointerup", (event) => {
    if (!from || byKey) return;
    const to = pixel(event);
    const dragged = Math.hypot(to[0] - from[0], to[1] - from[1]) * (place.clientWidth / width) > DRAG_PX;
    if (dragged && tool() !== "off") end(between(from, to));
    else end(tool() === "arrow" ? null : { kind: tool(), camera, at: from });
  });
  place.addEventListener("pointercancel", () => end(null));

  const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  place.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 1 : STEP_PX;
    if (STEPS[event.key]) move([at[0] + step * STEPS[event.key][0], at[1] + step * STEPS[event.key][1]]);
    else if (event.key === "Escape") end(null);
    else if (event.key.toLowerCase() === "b") [from, byKey] = [at, true];
    else if (event.key !== "Enter") return;
    else if (from) end(between(from, at));
    else if (tool() === "arrow") [from, byKey] = [at, true];
    else end({ kind: tool(), camera, at });
    event.preventDefault();
  });

  return {
    show(outlines, marks) {
      const path = outlines.map((corners) => `M${corners.map((corner) => corner.join(" ")).join("L")}Z`).join("");
      const mask = svg("path", { class: "mask", d: path, "fill-rule": "evenodd" });
      over.replaceChildren(...(path ? [mask] : []), ...marks.flatMap((mark) => shapes(mark, radius())));
    },
  };
}

/** What a mark looks like; `size` is in pixels of the picture. */
function shapes({ kind, at }, size) {
  if (kind === "box") {
    const [x, y] = at;
    return [svg("rect", { class: "box", x, y, width: at[2] - x, height: at[3] - y })];
  }
  if (kind !== "arrow") return [svg("circle", { class: kind, cx: at[0], cy: at[1], r: size })];
  const [[x, y], [u, v]] = at;
  return [svg("line", { class: "arrow", x1: x, y1: y, x2: u, y2: v }), svg("circle", { class: "head", cx: u, cy: v, r: size })];
}
