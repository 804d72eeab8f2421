"""A proxy of the environment is not for this machine: it would see images, prompts and keys."""

import asyncio
import json
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import httpx
import pytest

from app.llm.base import CompletionRequest, ModelProfile, complete
from app.llm.openai_compatible import OpenAiCompatibleModel
from app.llm.sse import Server
from app.perception.remote import PoseServer, PoseServerReplyError
from app.pipeline.prompt import Prompt
from roboprompt_client.client import RoboPromptClient

REPLY = {"choices": [{"text": "[[1]]", "finish_reason": "stop"}]}


def server(answer):
    """A loopback server that keeps the request lines it was sent."""
    seen = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            seen.append(self.requestline)
            body, kind = answer
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        do_GET = do_POST  # noqa: N815

        def log_message(self, *arguments):
            pass

    running = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    Thread(target=running.serve_forever, daemon=True).start()
    return running, seen


@pytest.fixture
def proxy(monkeypatch):
    """Named by every variable there is; what it is sent."""
    running, seen = server((b"{}", "application/json"))
    for name in ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.setenv(name, f"http://127.0.0.1:{running.server_port}")
    for name in ("NO_PROXY", "no_proxy"):
        monkeypatch.delenv(name, raising=False)
    yield seen
    running.shutdown()
    running.server_close()


@pytest.fixture(params=["127.0.0.1", "localhost"])
def target(request):
    body = f"data: {json.dumps(REPLY)}\n\ndata: [DONE]\n\n".encode()
    running, seen = server((body, "text/event-stream"))
    yield f"http://{request.param}:{running.server_port}", seen
    running.shutdown()
    running.server_close()


def test_a_client_without_the_rule_would_use_the_proxy(proxy, target):
    url, seen = target
    httpx.get(url)
    assert (len(proxy), len(seen)) == (1, 0)


def test_llm(proxy, target):
    url, seen = target
    profile = ModelProfile("openai_compatible/x", "completion", grammar=False, representation="absolute")

    model = OpenAiCompatibleModel(profile, Server(f"{url}/v1", "secret-key"), "x")
    asked = CompletionRequest(Prompt("system", "prefix", "query"), 10, 5.0)
    assert asyncio.run(complete(model, asked)).text == "[[1]]"
    assert (len(proxy), len(seen)) == (0, 1)


def test_pose_server(proxy, target):
    url, seen = target
    with pytest.raises(PoseServerReplyError):  # it is none, but it was asked
        asyncio.run(PoseServer(f"{url}/poses", 5.0).ask({"objects": ("o", b"[]", "application/json")}))
    assert (len(proxy), len(seen)) == (0, 1)


def test_the_robots_client(proxy, target):
    url, seen = target
    with RoboPromptClient(url, api_key="rp_secret") as client:
        client.get_bytes("/episodes/1/trajectory")
    assert (len(proxy), len(seen)) == (0, 1)


def test_elsewhere_the_proxy_is_used(proxy):
    with RoboPromptClient("http://robot.example", api_key="rp_secret") as client:
        client.get("/tasks")
    assert len(proxy) == 1
