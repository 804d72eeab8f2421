"""The pictures of pages in docs/images, of what a demo and docs/why-it-failed.md leave in a service of their own.

Run: `python -m benchmarks.screenshots`; two minutes.
"""

import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import httpx
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from app.evaluation.server import running_server

DOCS = Path("docs")
CHROMIUM = "/usr/bin/chromium"
SIZE = {"width": 1280, "height": 800}
QUALITY = 60
SETTLED_MS = 1500  # pictures are loaded and plots are drawn
PLAYED_S = 3.0  # into a motion
DEMO = ("--task", "push_button", "--task", "stack_cube", "--episodes", "4", "--no-compare")
FAILING = "example_press"
SHEET = "pages"  # one picture of all pages
SMALL, ACROSS, GAP = (520, 325), 3, 8  # pixels


def teach(data: Path) -> None:
    """The data of a demo."""
    subprocess.run([sys.executable, "-m", "app.cli", "demo", *DEMO, "--data", data], check=True)


def fail(url: str) -> None:
    """A prediction that fails, as docs/why-it-failed.md makes it."""
    environment = {**os.environ, "ROBOPROMPT_URL": url}
    block = re.search(r"^```python\n(.*?)^```", (DOCS / "why-it-failed.md").read_text(), re.MULTILINE | re.DOTALL)
    assert block is not None
    code = block[1].replace("http://127.0.0.1:8000", url)
    for arguments in (["-m", "roboprompt_client.example"], ["-c", code]):
        subprocess.run([sys.executable, *arguments], check=True, env=environment, stdout=subprocess.DEVNULL)


def addresses(url: str) -> Iterator[tuple[str, str]]:
    """The name of each picture, and the address of its page."""

    def newest(what: str, task: str, number: int = 1) -> list[str]:
        found = httpx.get(f"{url}/{what}", params={"task": task, "limit": number}).json()
        return [item["id"] for item in found[what]]

    (solved,), (failed,) = newest("predictions", "stack_cube"), newest("predictions", FAILING)
    yield "page-prediction", f"/ui/predictions/{solved}#space"
    yield "why-1-tasks", "/ui/tasks"
    yield "why-2-failures", f"/ui/predictions?task={FAILING}&outcome=failure"
    yield "why-3-prediction", f"/ui/predictions/{failed}"
    yield "why-4-space", f"/ui/predictions/{failed}#space"
    (episode,) = newest("episodes", "stack_cube")
    for number, address in enumerate((
        "tasks", "episodes?task=stack_cube", f"episodes/{episode}#space",
        f"episodes/{episode}#keyframes", f"episodes/{episode}/texts", f"episodes/{episode}/object",
        "tasks/stack_cube", "tasks/stack_cube/check",
        "predict?task=stack_cube", "predictions",
        f"predictions/{solved}#space",
    )):  # fmt: skip
        yield f"{SHEET}{number}", f"/ui/{address}"


def shoot(page: Page, address: str) -> Image.Image:
    """What is seen first; of a motion in space, a moment within it."""
    page.goto(address)
    page.wait_for_timeout(SETTLED_MS)
    if address.endswith("#space"):
        page.get_by_label("Moment of the motion").fill(str(PLAYED_S))
    if "#" in address:
        page.locator(f"#{address.split('#')[1]}").evaluate("heading => heading.scrollIntoView()")
    return Image.open(io.BytesIO(page.screenshot()))


def sheet(shots: Sequence[Image.Image]) -> Image.Image:
    """All of them small, in rows of `ACROSS`."""
    width, height = SMALL
    together = Image.new("RGB", (ACROSS * (width + GAP) - GAP, -(-len(shots) // ACROSS) * (height + GAP) - GAP), "gray")
    for number, shot in enumerate(shots):
        row, column = divmod(number, ACROSS)
        small = shot.convert("RGB").resize(SMALL, Image.Resampling.LANCZOS)
        together.paste(small, (column * (width + GAP), row * (height + GAP)))
    return together


def main() -> None:
    """Write them."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        teach(Path(folder) / "data")
        with running_server(Path(folder) / "data") as url:
            fail(url)
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
            page = browser.new_page(viewport=SIZE, color_scheme="light")  # type: ignore[arg-type]
            shots = {name: shoot(page, url + address) for name, address in addresses(url)}
            whole = {name: shot for name, shot in shots.items() if not name.startswith(SHEET)}
            whole[SHEET] = sheet([shot for name, shot in shots.items() if name.startswith(SHEET)])
            for name, shot in whole.items():
                shot.save(DOCS / f"images/{name}.webp", quality=QUALITY, method=6)
            browser.close()


if __name__ == "__main__":
    main()
