"""A real service with seeded episodes, and a real browser that may only talk to it."""

import json
import os
import shutil
import time
from contextlib import contextmanager

import cv2
import httpx
import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Error, expect, sync_playwright

from tests.conftest import NO_BROWSER
from tests.e2e.processes import running_server
from tests.episodes import arrays, camera, metadata, multipart, npz, pick_trajectory

PATIENCE_S = 20
expect.set_options(timeout=PATIENCE_S * 1000)
INSTRUCTION = "pick up the cube"
PLACES_M = [(0.1 + 0.05 * k, 0.02 * k, 0.785) for k in range(4)]
SCRIPTED_REPLY = "I would rather not move today."


def until(page, expression, argument=None):
    """Wait until JavaScript says yes; Playwright's own way needs an `eval` in the page, which its policy forbids."""
    wait_until(lambda: page.evaluate(expression, argument), expression)


def wait_until(condition, what=""):
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, f"still not so: {what}"
        time.sleep(0.05)


def until_pictures_are_there(page):
    """Wait for pictures that load lazily: one whose episode is deleted meanwhile would be refused."""
    until(page, "[...document.images].every((image) => image.complete || !image.checkVisibility())")


def picture(hue):
    """A small scene as a JPEG: a cube on a table."""
    hsv = np.full((48, 64, 3), (20, 60, 190), np.uint8)
    hsv[18:30, 26:38] = (hue, 200, 220)
    return cv2.imencode(".jpg", cv2.cvtColor(hsv, cv2.COLOR_HSV2BGR))[1].tobytes()


def teach(http, task, place_m, hue=0, **more):
    """Upload a pick of a cube with a picture; returns the episode."""
    document = metadata(task, {"cube": place_m}, cameras=[camera()], **more)
    files = multipart(document, npz(**arrays(pick_trajectory(place_m))), rgb_front=picture(hue))
    response = http.post("/episodes", files=files)
    assert response.status_code == 201, response.text
    return response.json()


@pytest.fixture(scope="session")
def data_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("web")


@pytest.fixture(scope="session")
def url(data_folder):
    environment = {
        "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([SCRIPTED_REPLY]),
        "ROBOPROMPT_DEFAULT_MODEL": "regression",
        "ROBOPROMPT_WARM_UP": "false",
    }
    with running_server(data_folder, environment) as address:
        yield address


@pytest.fixture(scope="session")
def http(url):
    with httpx.Client(base_url=url, timeout=60) as client:
        yield client


@pytest.fixture(scope="session")
def seeded(http):
    """The task `pick` with four episodes and two predictions, one failed and one solved; `bare` has no episode."""
    taught = [teach(http, "pick", place_m, hue=30 * k) for k, place_m in enumerate(PLACES_M)]
    http.put("/tasks/bare", json={}).raise_for_status()
    asked = {"task": "pick", "instruction": INSTRUCTION, "objects": [{"name": "cube", "position": PLACES_M[1]}]}
    for success in (False, True):
        prediction = http.post("/predict", json=asked).json()
        http.post(f"/predictions/{prediction['id']}/outcome", json={"success": success}).raise_for_status()
    return taught


# Playwright keeps an event loop running in this thread: it must end before other tests run their own.
@pytest.fixture(scope="package")
def browser():
    with sync_playwright() as playwright:
        # without a path it is Playwright's own headless shell
        path = shutil.which("chromium")
        try:
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        except Error as error:
            (pytest.fail if os.environ.get("CI") else pytest.skip)(f"{NO_BROWSER}: {error.message.splitlines()[0]}")
        yield browser
        browser.close()


@pytest.fixture(scope="package")
def context(browser, url):
    context = browser.new_context(base_url=url)
    yield context
    context.close()


@pytest.fixture(scope="package")
def tab(context):
    """One for all tests: a new one is a process of the browser that compiles every script again."""
    tab = context.new_page()
    yield tab
    tab.close()


@pytest.fixture
def page(tab, url, seeded):
    """See `watched_page`."""
    with watched_page(tab, url) as page:
        yield page


@contextmanager
def watched_page(page, url):
    """`page` as if it were new; its console must stay free of errors, and it must talk to no other host.

    A test that makes the service refuse something on purpose lists the status in `page.expected_refusals`.
    """
    page.set_viewport_size({"width": 1280, "height": 900})
    page.emulate_media(color_scheme="light")
    page.mouse.move(0, 0)
    page.set_default_timeout(PATIENCE_S * 1000)
    page.expected_refusals = []
    said, asked, refused = [], [], []
    listeners = {
        "console": lambda message: said.append(message.text) if message.type == "error" else None,
        "pageerror": lambda error: said.append(str(error)),
        "request": lambda request: asked.append(request.url),
        "response": lambda response: (
            refused.append((response.status, response.url)) if response.status >= 400 else None
        ),
    }
    for event, listener in listeners.items():
        page.on(event, listener)
    yield page
    page.goto("about:blank")
    for event, listener in listeners.items():
        page.remove_listener(event, listener)
    assert [status for status, _ in refused] == page.expected_refusals, refused
    # Chromium itself reports every refused request as an error.
    assert [text for text in said if not text.startswith("Failed to load resource: the server responded")] == []
    assert [address for address in asked if not address.startswith((url, "data:", "blob:", "about:"))] == []


@pytest.fixture
def check_accessibility():
    """Ask axe-core about the page: labels, roles, names, contrast."""

    def check(page):
        found = Axe().run(page, options={"resultTypes": ["violations"]}).response["violations"]
        problems = [f"{item['id']}: {item['help']}: {item['nodes'][0]['html']}" for item in found]
        assert problems == []

    return check
