"""Pictures of the main pages for the docs, light, 1280 px wide, of a service that serves what `roboprompt demo` taught.

Run: ``python -m benchmarks.screenshots --url http://127.0.0.1:8000 [--task stack_cube] [--out docs/images]``.
"""

import argparse
import io
from pathlib import Path

import httpx
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from benchmarks.web_paint import CHROMIUM

SIZE = {"width": 1280, "height": 900}
QUALITY = 60
SETTLED_MS = 1500  # pictures are loaded and plots are drawn
PLAYED_S = 3.0  # into a motion


def pages(url: str, task: str) -> dict[str, str]:
    """The address of each page by the name of its picture."""
    with httpx.Client(base_url=url) as service:
        episode = service.get("/episodes", params={"task": task, "limit": 1}).json()["episodes"][0]["id"]
        predictions = service.get("/predictions", params={"task": task, "limit": 50}).json()["predictions"]
    solved = next(item["id"] for item in reversed(predictions) if (item["outcome"] or {}).get("success"))
    return {
        "tasks": "/ui/tasks",
        "task": f"/ui/tasks/{task}",
        "episode": f"/ui/episodes/{episode}",
        "predict": f"/ui/predict?task={task}",
        "predictions": "/ui/predictions",
        "prediction": f"/ui/predictions/{solved}",
    }


def shoot(page: Page, address: str) -> bytes:
    """A PNG of what is seen first; of a page that plays a motion, its player within the motion."""
    page.goto(address)
    page.wait_for_timeout(SETTLED_MS)
    if page.locator(".player").count():
        page.get_by_label("Moment of the motion").fill(str(PLAYED_S))
        page.locator("#space").evaluate("heading => heading.scrollIntoView()")
    return page.screenshot()


def main() -> None:
    """Write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--task", default="stack_cube")
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    arguments = parser.parse_args()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport=SIZE, color_scheme="light")  # type: ignore[arg-type]
        for name, path in pages(arguments.url, arguments.task).items():
            picture = Image.open(io.BytesIO(shoot(page, arguments.url + path)))
            picture.save(arguments.out / f"page-{name}.webp", quality=QUALITY, method=6)
        browser.close()


if __name__ == "__main__":
    main()
