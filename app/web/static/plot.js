// plotly.js, loaded when something is to be drawn, in the page's colors.

let loading;

/** Plotly; the page's `data-plotly` says where it is. */
export function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = document.querySelector("[data-plotly]").dataset.plotly;
    script.onload = () => resolve(window.Plotly);
    script.onerror = () => reject(new Error("plotly.js could not be loaded"));
    document.head.append(script);
  });
  return loading;
}

/** The value of a custom property of the style sheet: color("curve"). */
export const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** What every figure has in common. */
export function layout(more = {}) {
  return {
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: color("text"), family: "system-ui, sans-serif", size: 13 },
    margin: { l: 56, r: 16, t: 24, b: 52 },
    ...more,
  };
}

export const CONFIG = { displayModeBar: false, responsive: true }; // a toolbar would cover the last keyframe

/** Call `draw` now and whenever the browser changes between light and dark. */
export function inBothModes(draw) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  return draw();
}

/** Call `draw` as soon as `place` comes near the part of the page that is seen. */
export function whenNear(place, draw) {
  const watcher = new IntersectionObserver(
    (entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      watcher.disconnect();
      draw();
    },
    { rootMargin: "300px" },
  );
  watcher.observe(place);
}
