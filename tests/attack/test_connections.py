"""Connections that cost the service more than those who open them."""

import json
import socket
import threading
import time
from contextlib import ExitStack
from urllib.parse import urlsplit

import httpx
import pytest
import uvicorn

from app.api.bounded_protocol import BODY_TIMEOUT_S, HEAD_TIMEOUT_S, SLOWEST_BYTES_PER_S, BoundedProtocol
from app.evaluation.server import free_port
from tests.attack.conftest import FULL
from tests.e2e.processes import killable_server

LATE_S = 8.0
FORM = "Content-Type: application/x-www-form-urlencoded"


def connect(url):
    place = urlsplit(url)
    return socket.create_connection((place.hostname, place.port), timeout=BODY_TIMEOUT_S + HEAD_TIMEOUT_S + LATE_S)


def head(line, *more):
    return "\r\n".join([line, "Host: 127.0.0.1", *more, "", ""]).encode()


def ended_after_s(connection, trickle=b"", every_s=0.5):
    """How long until the service closes the connection, into which a byte is sent now and then."""
    begun = time.monotonic()
    connection.settimeout(every_s)
    try:
        while True:
            try:
                if connection.recv(65_536) == b"":
                    break
            except TimeoutError:
                connection.sendall(trickle)
    except ConnectionError:
        pass
    return time.monotonic() - begun


@pytest.mark.long
def test_a_login_sent_byte_by_byte_times_out(service):
    with connect(service.url) as connection:
        connection.sendall(head("POST /ui/login HTTP/1.1", FORM, "Content-Length: 9000"))
        assert BODY_TIMEOUT_S - 1 < ended_after_s(connection, b"x") < BODY_TIMEOUT_S + LATE_S


@pytest.mark.long
def test_line_breaks_instead_of_a_second_request(service):
    with connect(service.url) as connection:
        connection.sendall(head("GET /healthz HTTP/1.1"))
        assert b"200 OK" in connection.recv(65_536)
        assert ended_after_s(connection, b"\r\n", every_s=1.0) < HEAD_TIMEOUT_S + LATE_S


def test_a_slow_body_that_is_fast_enough_passes(service):
    body = json.dumps({"task": "pick", "junk": "a" * 60_000}).encode()
    pieces = [body[at : at + 2000] for at in range(0, len(body), 2000)]

    def slowly():
        for piece in pieces:
            yield piece
            time.sleep(2000 / SLOWEST_BYTES_PER_S)

    headers = {"content-type": "application/json"}
    assert httpx.post(f"{service.url}/predict", content=slowly(), headers=headers).status_code == 422


@pytest.mark.long
def test_more_connections_than_there_is_room_for(tmp_path):
    most = 200 if FULL else 40
    environment = {"ROBOPROMPT_MAX_CONNECTIONS": str(most), "ROBOPROMPT_DEFAULT_MODEL": "nearest"}
    with killable_server(tmp_path / "data", environment) as (_, url), ExitStack() as open_ones:
        for _ in range(most + 20):
            open_ones.enter_context(connect(url)).sendall(b"GET /healthz HTTP/1.1\r\n")
        refused = httpx.get(f"{url}/tasks")
        assert (refused.status_code, refused.headers["connection"]) == (503, "close")
        with ExitStack() as beyond:
            aborted = [beyond.enter_context(connect(url)) for _ in range(150)]
            ended = [ended_after_s(connection) < 1 for connection in aborted[-10:]]
            assert all(ended)
        open_ones.close()
        assert _answers(url)


def _answers(url):
    deadline = time.monotonic() + LATE_S
    while time.monotonic() < deadline:
        if httpx.get(f"{url}/tasks").status_code == 200:
            return True
        time.sleep(0.1)
    return False


class Hasty(BoundedProtocol):
    head_timeout_s = body_timeout_s = reader_timeout_s = 0.5


@pytest.fixture
def hasty():
    """A server that waits for nothing long; its answers are too long for the kernel's buffers."""

    async def answer(scope, receive, send):
        while (await receive()).get("more_body"):
            pass
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"a" * (20_000_000 if scope["path"] == "/long" else 10_000)})

    server = uvicorn.Server(
        uvicorn.Config(answer, port=free_port(), http=Hasty, lifespan="off", log_level="error", timeout_keep_alive=1)
    )
    serving = threading.Thread(target=server.run)
    serving.start()
    while not server.started:
        time.sleep(0.01)
    yield server
    server.should_exit = True
    serving.join()


@pytest.mark.parametrize("path", ["/long", "/short"])
def test_answers_that_are_not_read_are_abandoned(hasty, path):
    """Also those that fit into buffers, after which a graceful end would wait for their reader for good."""
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        connection.connect(("127.0.0.1", hasty.config.port))
        connection.sendall(head(f"GET {path} HTTP/1.1"))
        state = hasty.server_state
        assert become(lambda: bool(state.connections) or state.total_requests > 0, True)
        assert become(lambda: len(state.connections), 0)


def test_requests_that_do_not_go_on_are_given_up(hasty):
    beginnings = [b"", b"GET / HT", head("POST / HTTP/1.1", "Content-Length: 10"), head("GET / HTTP/1.1") + b"\r\n"]
    with ExitStack() as opened:
        connections = [opened.enter_context(connect(hasty_url(hasty))) for _ in beginnings]
        for connection, sent in zip(connections, beginnings, strict=True):
            connection.sendall(sent)
        assert all(ended_after_s(connection) < LATE_S for connection in connections)


def hasty_url(server):
    return f"http://127.0.0.1:{server.config.port}"


def become(count, wanted):
    deadline = time.monotonic() + LATE_S
    while time.monotonic() < deadline:
        if count() == wanted:
            return True
        time.sleep(0.02)
    return False


@pytest.mark.parametrize("host", ["[::1", "[", "]", ":80", "[::1]]", "a[b"])
def test_invalid_hosts_are_refused(service, host):
    for path in ("/tasks", "/ui", "/healthz", "/predict"):
        assert httpx.get(f"{service.url}{path}", headers={"host": host}).status_code == 400


@pytest.mark.parametrize("origin", ["http://[::1", "http://[", "null", "//", "http://]"])
def test_invalid_origins_are_refused(service, origin):
    answer = httpx.post(f"{service.url}/predict", json={}, headers={"origin": origin})
    assert answer.status_code == 403
