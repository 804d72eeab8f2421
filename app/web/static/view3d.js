// Where the 3D view is seen from: turning, zooming, and points of the world on the page. Orthographic.

const AZIMUTH_DEG = -47; // in front of the robot, on its right, as app/web/scene.py draws
const ELEVATION_DEG = 27;
const STEEPEST_DEG = 89;
const FILLED = 0.86; // the share of the view that the scene takes up

/** Points of the world, as SVG writes those that a projection makes of them. */
export const text = (points, { at }) => points.map((point) => at(point).map((value) => value.toFixed(1)).join(",")).join(" ");

const radians = (degrees) => (degrees * Math.PI) / 180;
const dot = (one, other) => one[0] * other[0] + one[1] * other[1] + one[2] * other[2];

export class View {
  constructor() {
    this.reset();
  }

  /** As it opens. */
  reset() {
    [this.azimuth_deg, this.elevation_deg, this.zoom] = [AZIMUTH_DEG, ELEVATION_DEG, 1];
    return this;
  }

  /** To where the table is seen as a map: x to the right, y up. */
  rise() {
    [this.azimuth_deg, this.elevation_deg] = [-90, STEEPEST_DEG];
  }

  turn(right_deg, up_deg) {
    this.azimuth_deg -= right_deg;
    this.elevation_deg = Math.min(STEEPEST_DEG, Math.max(-STEEPEST_DEG, this.elevation_deg + up_deg));
  }

  scale(factor) {
    this.zoom = Math.min(20, Math.max(0.2, this.zoom * factor));
  }

  /**
   * How the world, in meters, comes onto a page of that size: `at` gives a point's place in pixels, `depth` grows towards the
   * viewer, and `faces` says whether a normal points there. All of `points` are seen while zoom is 1, however the view is
   * turned sideways.
   */
  projection(points, width_px, height_px) {
    const [az, el] = [radians(this.azimuth_deg), radians(this.elevation_deg)];
    const right = [-Math.sin(az), Math.cos(az), 0];
    const up = [-Math.sin(el) * Math.cos(az), -Math.sin(el) * Math.sin(az), Math.cos(el)];
    const towards = [Math.cos(el) * Math.cos(az), Math.cos(el) * Math.sin(az), Math.sin(el)];
    const { middle, radius, half_height } = extent(points);
    const tilt = radians(ELEVATION_DEG);
    const across = 2 * radius;
    const upright = 2 * (radius * Math.sin(tilt) + half_height * Math.cos(tilt));
    const scale = FILLED * this.zoom * Math.min(width_px / across, height_px / upright);
    const from = (point) => point.map((value, k) => value - middle[k]);
    return {
      at: (point) => [width_px / 2 + scale * dot(from(point), right), height_px / 2 - scale * dot(from(point), up)],
      depth: (point) => dot(point, towards),
      faces: (normal) => dot(normal, towards) > 0,
      towards,
      px_per_m: scale,
    };
  }
}

/** The upright cylinder around points. */
function extent(points) {
  const ranges = [0, 1, 2].map((k) => points.map((point) => point[k])).map((along) => [Math.min(...along), Math.max(...along)]);
  const middle = ranges.map(([low, high]) => (low + high) / 2);
  const radius = Math.max(...points.map((point) => Math.hypot(point[0] - middle[0], point[1] - middle[1])));
  return { middle, radius: Math.max(radius, 0.05), half_height: (ranges[2][1] - ranges[2][0]) / 2 };
}

/** Let people turn and zoom `view` in `place`: dragging, arrow keys, + and -, pinching; `changed` is called after each. */
export function steer(place, view, changed) {
  let last = null;
  place.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    last = [event.clientX, event.clientY];
    place.setPointerCapture(event.pointerId);
  });
  place.addEventListener("pointermove", (event) => {
    if (!last) return;
    view.turn((event.clientX - last[0]) / 2, (event.clientY - last[1]) / 2);
    last = [event.clientX, event.clientY];
    changed();
  });
  for (const kind of ["pointerup", "pointercancel"]) place.addEventListener(kind, () => (last = null));
  const STEPS = { ArrowLeft: [-6, 0], ArrowRight: [6, 0], ArrowUp: [0, -6], ArrowDown: [0, 6] };
  place.addEventListener("keydown", (event) => {
    if (STEPS[event.key]) view.turn(...STEPS[event.key]);
    else if ("+=".includes(event.key)) view.scale(1.15);
    else if (event.key === "-") view.scale(1 / 1.15);
    else return;
    event.preventDefault();
    changed();
  });
  // The wheel alone scrolls the page; with Ctrl, as browsers tell of two fingers, it zooms.
  const zoomed = (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    view.scale(Math.exp(-event.deltaY / 300));
    changed();
  };
  place.addEventListener("wheel", zoomed, { passive: false });
}
