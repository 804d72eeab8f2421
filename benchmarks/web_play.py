"""How often a page redraws the hand while it plays a minute recorded at 100 Hz: Chromium, drawn in software.

Run: ``python -m benchmarks.web_play``.
"""

import tempfile
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from app.evaluation.server import running_server
from benchmarks.web_paint import CHROMIUM
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import ObjectPose, Trajectory

DURATION_S, FREQUENCY_HZ = 60, 100
WATCHED_MS = 5000
NUM_JOINTS = 7
# A moment that is shown replaces what the group has.
COUNT = """() => {
  window.shown = 0;
  new MutationObserver(() => window.shown++).observe(document.querySelector(".moving"), { childList: true });
}"""


def recording() -> Trajectory:
    """A Panda that sweeps to and fro over a table, and closes its gripper halfway."""
    times_s = np.arange(DURATION_S * FREQUENCY_HZ) / FREQUENCY_HZ
    swing = np.sin(times_s / 3)
    positions = np.stack([0.4 + 0.1 * swing, 0.3 * swing, 0.3 + 0.05 * np.cos(times_s)], axis=1)
    joints = np.tile([0.0, -0.8, 0.0, -2.3, 0.0, 1.6, 0.8], (len(times_s), 1))
    joints[:, 0] = 0.7 * swing
    return Trajectory(
        np.gradient(joints, 1 / FREQUENCY_HZ, axis=0),
        positions,
        np.tile([1.0, 0.0, 0.0, 0.0], (len(times_s), 1)),
        times_s < DURATION_S / 2,
        times_s,
        joints,
    )


def moments_per_second(page: Page, address: str) -> float:
    """How many moments a second are shown while it plays."""
    page.goto(address)
    page.locator(".player").wait_for()
    page.evaluate(COUNT)
    page.get_by_role("button", name="Play", exact=True).click()
    before, started_ms = page.evaluate("[window.shown, performance.now()]")
    page.wait_for_timeout(WATCHED_MS)
    after, ended_ms = page.evaluate("[window.shown, performance.now()]")
    return float(1000 * (after - before) / (ended_ms - started_ms))


def main() -> None:
    """Print it."""
    with tempfile.TemporaryDirectory() as data, running_server(Path(data)) as url, sync_playwright() as playwright:
        with RoboPromptClient(url) as client:
            client.configure_task("sweep", arm="panda", keyframes={"rule": "waypoints"})
            seen = Observation((ObjectPose("cube", np.array([0.4, 0.1, 0.05])),))
            id_ = client.upload("sweep", "sweep the table", recording(), seen, control_frequency_hz=FREQUENCY_HZ)["id"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        rate = moments_per_second(browser.new_page(), f"{url}/ui/episodes/{id_}")
        print(f"{rate:.1f} moments a second")  # noqa: T201
        browser.close()


if __name__ == "__main__":
    main()
