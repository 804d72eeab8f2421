"""A service for the pages that predict: yardsticks, and a provider that is slow."""

import json
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import httpx
import pytest

from tests.e2e.processes import running_server
from tests.web.conftest import INSTRUCTION, PLACES_M, SCRIPTED_REPLY, teach, watched_page

PIECE_S = 0.05
FIRST_ROW = 7  # words
FAR_M = (0.55, 0.3, 0.785)


class _SlowProvider(BaseHTTPRequestHandler):
    """An OpenAI-compatible server that stops after its first row until `go_on` is set.

    `hung_up` counts the clients that did not wait; `reply` is one that demonstrations support.
    """

    reply = ""
    go_on = threading.Event()
    hung_up = threading.Semaphore(0)

    def do_POST(self):
        self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        try:
            for number, word in enumerate(self.reply.split(" ")):
                if number == FIRST_ROW:
                    self.go_on.wait()
                time.sleep(PIECE_S)
                self._say({"choices": [{"text": f"{word} ", "finish_reason": None}]})
            self._say({"choices": [{"text": "", "finish_reason": "stop"}]})
            self.wfile.write(b"data: [DONE]\n\n")
        except OSError:
            self.hung_up.release()

    def _say(self, chunk):
        self.wfile.write(f"data: {json.dumps(chunk)}\n\n".encode())
        self.wfile.flush()

    def log_message(self, *arguments):
        pass


@pytest.fixture(scope="session")
def provider_address():
    with ThreadingHTTPServer(("127.0.0.1", 0), _SlowProvider) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/v1"
        _SlowProvider.go_on.set()
        server.shutdown()


@pytest.fixture
def slow_provider():
    """The provider, whose replies stop after their first row."""
    _SlowProvider.go_on.clear()
    yield _SlowProvider
    _SlowProvider.go_on.set()


@pytest.fixture(scope="session")
def url(tmp_path_factory, provider_address):
    environment = {
        "ROBOPROMPT_SCRIPTED_REPLIES": json.dumps([SCRIPTED_REPLY]),
        "ROBOPROMPT_DEFAULT_MODEL": "regression",
        "ROBOPROMPT_WARM_UP": "false",
        "ROBOPROMPT_COMPATIBLE_BASE_URL": provider_address,
        "ROBOPROMPT_COMPATIBLE_STYLE": "completion",
    }
    with running_server(tmp_path_factory.mktemp("lab"), environment) as address:
        yield address


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
def seeded(http):
    """The task `pick` with four episodes, and a prediction of every fate, by fate."""
    for k, place_m in enumerate(PLACES_M):
        teach(http, "pick", place_m, hue=30 * k)
    copied = ask(http, PLACES_M[-1], model="nearest", representation="absolute", prompt_format="paper")
    _SlowProvider.reply = http.get(f"/predictions/{copied}").json()["reply_text"]
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
