"""A service that a test may kill, servers of a test's own, and an LLM that takes its time."""

import json
import time
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import httpx
from httpx_sse import connect_sse

from app.evaluation.server import WITHOUT_KEYS, free_port
from roboprompt_client.encoding import scene_json
from tests.forked import Forked

EVENTS = "text/event-stream"


@contextmanager
def killable_server(data, environment=None, *options):
    """Runs `roboprompt serve`; yields its process and its URL."""
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    data.mkdir(parents=True, exist_ok=True)
    command = ["app.cli", "serve", "--port", str(port), "--data", str(data), *options]
    with (data / "server.log").open("wb") as log:
        process = Forked(command, {"ROBOPROMPT_WARM_UP": "false", **(environment or {})}, log)
    try:
        wait_until_alive(process, url)
        yield process, url
    finally:
        process.terminate()
        process.wait(15)


@contextmanager
def running_server(data, environment=None):
    """What `app.evaluation.server.running_server` does, in a forked process; no LLM reads what is uploaded."""
    with killable_server(data, {**WITHOUT_KEYS, **(environment or {})}) as (_, url):
        yield url


def wait_until_alive(process, url, timeout_s=60):
    deadline = time.monotonic() + timeout_s
    with httpx.Client() as http:
        while time.monotonic() < deadline and process.poll() is None:
            try:
                if http.get(f"{url}/healthz").is_success:
                    return
            except httpx.TransportError:
                time.sleep(0.02)
    raise AssertionError("the service did not start")


def streamed(url, task, instruction, observation, **options):
    """Yield the name and the document of each event of a prediction's stream."""
    document = {"task": task, "instruction": instruction, **scene_json(observation), **options}
    if (pose := observation.end_effector) is not None:
        document["end_effector"] = {"position": pose.position_m, "quaternion_xyzw": pose.quaternion_xyzw}
    with (
        httpx.Client(base_url=url, timeout=60) as http,
        connect_sse(http, "POST", "/predict", json=document) as source,
    ):
        assert source.response.headers["content-type"].startswith("text/event-stream")
        for event in source.iter_sse():
            yield event.event, json.loads(event.data)


@contextmanager
def answering(answer):
    """A server on loopback; yields its URL.

    Args:
        answer: of a request's handler and body the status, content type, and text or bytes, or pieces of text.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            status, kind, content = answer(self, self.rfile.read(int(self.headers.get("Content-Length", 0))))
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.end_headers()
            pieces = [content] if isinstance(content, str | bytes) else content
            with suppress(ConnectionError):  # who asked is gone, as the test wants it
                for piece in pieces:
                    self.wfile.write(piece.encode() if isinstance(piece, str) else piece)
                    self.wfile.flush()

        do_POST = do_GET  # noqa: N815

        def log_message(self, *arguments):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@contextmanager
def llm_saying(pieces, name):
    """An OpenAI-compatible server that says what `pieces()` yields; yields the service's settings for it."""

    def events():
        for piece in pieces():
            yield f"data: {json.dumps({'choices': [{'text': piece, 'finish_reason': None}]})}\n\n"
        yield f"data: {json.dumps({'choices': [{'text': '', 'finish_reason': 'stop'}]})}\n\ndata: [DONE]\n\n"

    with answering(lambda *_: (200, EVENTS, events())) as url:
        yield {
            "ROBOPROMPT_COMPATIBLE_BASE_URL": f"{url}/v1",
            "ROBOPROMPT_COMPATIBLE_STYLE": "completion",
            "ROBOPROMPT_DEFAULT_MODEL": f"openai_compatible/{name}",
        }
