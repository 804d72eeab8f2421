"""A service for the pages that predict: yardsticks, and a provider that is slow."""

import json
import threading
import time

import httpx
import pytest

from tests.e2e.processes import llm_saying, running_server
from tests.web.conftest import INSTRUCTION, PLACES_M, SCRIPTED_REPLY, teach, watched_page

PIECE_S = 0.05
FIRST_ROW = 7  # words
FAR_M = (0.55, 0.3, 0.785)


class SlowProvider:
    """An LLM that stops after its first row until `go_on` is set.

    `hung_up` counts the clients that did not wait; `reply` is one that demonstrations support.
    """

    def __init__(self):
        self.reply, self.go_on, self.hung_up = "", threading.Event(), threading.Semaphore(0)

    def pieces(self):
        try:
            for number, word in enumerate(self.reply.split(" ")):
                if number == FIRST_ROW:
                    self.go_on.wait()
                time.sleep(PIECE_S)
                yield f"{word} "
        except GeneratorExit:
            self.hung_up.release()
            raise


@pytest.fixture(scope="session")
def provider():
    return SlowProvider()


@pytest.fixture
def slow_provider(provider):
    provider.go_on.clear()
    yield provider
    provider.go_on.set()


@pytest.fixture(scope="session")
def url(tmp_path_factory, provider):
    environment = {"ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([SCRIPTED_REPLY]), "ROBOPROMPT_WARM_UP": "false"}
    with llm_saying(provider.pieces, "default") as settings:
        environment |= {**settings, "ROBOPROMPT_DEFAULT_MODEL": "regression"}
        with running_server(tmp_path_factory.mktemp("lab"), environment) as address:
            yield address
        provider.go_on.set()


@pytest.fixture(scope="session")
def http(url):
    with httpx.Client(base_url=url, timeout=120) as client:
        yield client


def ask(http, place_m=PLACES_M[1], success=None, note=None, **more):
    """Ask for a prediction of `pick`, and tell its outcome; returns its id."""
    objects = [{"name": "cube", "position": place_m}]
    answer = http.post("/predict", json={"task": "pick", "instruction": INSTRUCTION, "objects": objects, **more}).json()
    id_ = answer["id"] if "id" in answer else answer["prediction_id"]
    if success is not None:
        http.post(f"/predictions/{id_}/outcome", json={"success": success, "note": note}).raise_for_status()
    return id_


@pytest.fixture(scope="session")
def seeded(http, provider):
    """The task `pick` with four episodes, and a prediction of every fate, by fate."""
    for k, place_m in enumerate(PLACES_M):
        teach(http, "pick", place_m, hue=30 * k)
    copied = ask(http, PLACES_M[-1], model="nearest", representation="absolute", prompt_format="paper")
    provider.reply = http.get(f"/predictions/{copied}").json()["reply_text"]
    http.delete(f"/predictions/{copied}").raise_for_status()
    return {
        "failure": ask(http, FAR_M, False, "went beside the cube", model="regression", unsupported="allow"),
        "success": ask(http, success=True, model="regression", representation="object_frame"),
        "refused": ask(http, model="scripted"),
        "unknown": ask(http, model="regression"),
    }


@pytest.fixture(scope="package")
def context(browser, url):
    context = browser.new_context(base_url=url)
    yield context
    context.close()


@pytest.fixture(scope="package")
def tab(context):
    tab = context.new_page()
    yield tab
    tab.close()


@pytest.fixture
def page(tab, url, seeded):
    with watched_page(tab, url) as page:
        yield page
