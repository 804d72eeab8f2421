"""A service that a test may kill, and an LLM that takes its time."""

import json
import time
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import httpx

from app.evaluation.server import WITHOUT_KEYS, free_port
from tests.forked import Forked


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


@contextmanager
def slow_llm(reply, pause_s):
    """An OpenAI-compatible server that says `reply`, row by row; yields the service's settings for it."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            self.end_headers()
            for piece in reply.replace("], ", "], \0").split("\0"):
                self.say({"choices": [{"text": piece, "finish_reason": None}]})
                time.sleep(pause_s)
            self.say({"choices": [{"text": "", "finish_reason": "stop"}]})
            self.wfile.write(b"data: [DONE]\n\n")

        def say(self, document):
            self.wfile.write(f"data: {json.dumps(document)}\n\n".encode())
            self.wfile.flush()

        def handle(self):
            with suppress(ConnectionError):  # who asked is gone, as the test wants it
                super().handle()

        def log_message(self, *arguments):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield {
            "ROBOPROMPT_COMPATIBLE_BASE_URL": f"http://127.0.0.1:{server.server_port}/v1",
            "ROBOPROMPT_COMPATIBLE_STYLE": "completion",
            "ROBOPROMPT_DEFAULT_MODEL": "openai_compatible/slow",
        }
        server.shutdown()
