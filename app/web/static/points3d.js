// A point cloud (app/web/play.py) under the drawing of a 3D view: pixels in a canvas, the nearest in front.

import { send } from "./api.js";

const BYTES = 15; // of a point: three floats and a color
const DOT_PX = 2;

/** `{positions, colors}` of an address of the service. */
export async function loadPoints(address) {
  const bytes = await (await send(address)).arrayBuffer();
  const number = bytes.byteLength / BYTES;
  return { positions: new Float32Array(bytes, 0, 3 * number), colors: new Uint8Array(bytes, 12 * number) };
}

/** Paint it as `projection` sees it; `canvas` has the size of the view. */
export function paintPoints(canvas, { positions, colors }, { at, depth }) {
  const { width, height } = canvas;
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  const nearest = new Float32Array(width * height).fill(-Infinity);
  // Orthographic: a place on the page is a sum of multiples of x, y and z.
  const origin = [...at([0, 0, 0]), depth([0, 0, 0])];
  const [ux, uy, uz] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => [...at(axis), depth(axis)].map((value, k) => value - origin[k]));
  for (let k = 0; k < colors.length; k += 3) {
    const [x, y, z] = [positions[k], positions[k + 1], positions[k + 2]];
    const column = Math.round(origin[0] + x * ux[0] + y * uy[0] + z * uz[0]);
    const row = Math.round(origin[1] + x * ux[1] + y * uy[1] + z * uz[1]);
    const near = origin[2] + x * ux[2] + y * uy[2] + z * uz[2];
    const color = (255 << 24) | (colors[k + 2] << 16) | (colors[k + 1] << 8) | colors[k];
    for (let v = Math.max(0, row); v < Math.min(height, row + DOT_PX); v += 1) {
      for (let u = Math.max(0, column); u < Math.min(width, column + DOT_PX); u += 1) {
        if (nearest[v * width + u] >= near) continue;
        nearest[v * width + u] = near;
        pixels[v * width + u] = color;
      }
    }
  }
  context.putImageData(image, 0, 0);
}
