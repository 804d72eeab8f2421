"""Whom a client reaches without a proxy, and streams of events, cut anywhere."""

import httpx
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.connection import Connection, is_own_machine, without_proxy
from roboprompt_client.errors import ServiceUnreachableError
from roboprompt_client.requests import ask
from roboprompt_client.robot import Observation


@pytest.mark.parametrize(
    "url",
    [
        "http://127.0.0.1:8000/v1",
        "http://127.1.2.3",
        "https://localhost",
        "http://[::1]:9000/poses",
        "http://a.localhost",
    ],
)
def test_this_machine(url):
    assert is_own_machine(url)
    assert without_proxy(url) == {"http://": None, "https://": None}


@pytest.mark.parametrize(
    "url",
    ["http://gpu-box:8000", "http://127.0.0.1.example", "http://127.0.0.1@example", "", "http://[", "http://0.0.0.0"],
)
def test_another(url):
    assert not is_own_machine(url)
    assert without_proxy(url) is None


STREAM = (
    ': a comment\n\nevent: action\ndata: {"a": 1}\n\nid: 7\r\nevent: text\r\ndata: {"t":\r\ndata:  "é\u2028x"}\r\n\r\n'
).encode()
EXPECTED = [("action", {"a": 1}), ("text", {"t": "é\u2028x"})]


def events(pieces, kind="text/event-stream"):
    """The events of an answer that arrives in these pieces."""
    answer = httpx.MockTransport(lambda _: httpx.Response(200, content=iter(pieces), headers={"content-type": kind}))
    return Connection(httpx.Client(transport=answer, base_url="http://robots")).events(ask("POST", "/predict"))


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_however_the_bytes_arrive(size):
    pieces = [STREAM[k : k + size] for k in range(0, len(STREAM), size)]
    assert list(events(pieces)) == EXPECTED


def test_an_event_comes_as_soon_as_it_is_complete():
    arrived = []

    def pieces():
        for k in range(0, len(STREAM), 4):
            arrived.append(k)
            yield STREAM[k : k + 4]

    assert next(events(pieces())) == EXPECTED[0]
    assert arrived[-1] <= STREAM.index(b"id: 7")


def test_an_event_that_is_cut_off_is_none():
    assert list(events([STREAM[:-2]])) == EXPECTED[:1]
    assert list(events([b"event: done\n\n"])) == []


@pytest.mark.parametrize("data", [b"data: [1]\n\n", b"data: {\n\n", b"data: \xff\n\n"])
def test_data_that_are_no_json_object_are_an_error(data):
    with pytest.raises(ServiceUnreachableError, match="no JSON object"):
        list(events([data]))


@pytest.mark.parametrize(
    ("kind", "body"), [("text/html", b"<p>a proxy's page</p>"), ("text/event-stream", b"event: action\ndata: 3\n\n")]
)
def test_a_service_that_streams_something_else_is_none(kind, body):
    answer = httpx.MockTransport(lambda _: httpx.Response(200, content=body, headers={"content-type": kind}))
    connection = httpx.Client(transport=answer, base_url="http://robots")
    with (
        RoboPromptClient(connection=connection) as client,
        pytest.raises(ServiceUnreachableError, match=r"no JSON|Expected response header Content-Type"),
    ):
        list(client.stream("t", "go", Observation()))
