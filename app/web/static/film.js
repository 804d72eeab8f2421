// What a camera took during a motion (`film_bytes` of app/web/play.py), in step with the player of a 3D view.

import { send } from "./api.js";

/** Draw into `canvas` the picture of the moment that the player of `view` shows, and number it in `caption`. */
export async function mountFilm(view, canvas, caption) {
  const seen = { time_s: 0 };
  view.addEventListener("moment", ({ detail }) => (seen.time_s = detail));
  const film = read(await (await send(canvas.dataset.film)).arrayBuffer());
  let [shown, drawing] = [-1, false];
  const draw = async () => {
    const number = pictureAt(film.times_s, seen.time_s);
    if (drawing || number === shown) return;
    [shown, drawing] = [number, true];
    try {
      const bitmap = await createImageBitmap(film.pictures[number]);
      if (canvas.width !== bitmap.width || canvas.height !== bitmap.height) Object.assign(canvas, { width: bitmap.width, height: bitmap.height });
      canvas.getContext("2d").drawImage(bitmap, 0, 0);
      bitmap.close();
      caption.textContent = `, picture ${number + 1} of ${film.times_s.length}`;
    } catch {
      caption.textContent = `, picture ${number + 1} of ${film.times_s.length} is damaged`;
    }
    drawing = false;
    draw(); // the player has gone on
  };
  view.addEventListener("moment", draw);
  await draw();
}

/** Times in seconds, and the pictures. */
function read(bytes) {
  const [number] = new Float32Array(bytes, 0, 1);
  const times_s = new Float32Array(bytes, 4, number);
  let end = 4 + 8 * number;
  const pictures = [...new Float32Array(bytes, 4 + 4 * number, number)].map((size) => new Blob([new Uint8Array(bytes, (end += size) - size, size)], { type: "image/jpeg" }));
  return { times_s, pictures };
}

/** The last picture that was taken by then; before the first the first. */
function pictureAt(times_s, time_s) {
  let [low, high] = [0, times_s.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times_s[middle] <= time_s + 1e-4) low = middle; // its times were rounded
    else high = middle;
  }
  return low;
}
