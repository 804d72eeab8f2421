"""Whom a client reaches without a proxy, and streams of events, cut anywhere."""

import httpx
import pytest
from arms import client_of

from roboprompt_client.answers import PredictedActions
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError, ServiceUnreachableError
from roboprompt_client.http import is_own_machine, without_proxy
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


@pytest.mark.parametrize("key", ["ключ", "rp_1 2", "rp_1\n"])
def test_a_key_that_no_header_can_have_is_named(key):
    with pytest.raises(InvalidInputError, match="api_key: has blanks, or letters outside ASCII"):
        RoboPromptClient("http://robots", api_key=key)


STREAM = (
    ': a comment\n\nevent: action\ndata: {"position": [0, 0, 1], "quaternion_xyzw": [1, 0, 0, 0], '
    '"gripper_open": true}\n\nevent: done\n\nid: 7\r\nevent: done\r\ndata: {"actions":\r\n'
    'data:  [], "id": "é\u2028x"}\r\n\r\n'
).encode()


def streamed(pieces, kind="text/event-stream"):
    """What a prediction's stream gives that arrives in these pieces."""
    answer = httpx.Response(200, content=iter(pieces), headers={"content-type": kind})
    return client_of(answer).stream("t", "go", Observation())


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_however_the_bytes_arrive(size):
    action, whole = streamed([STREAM[k : k + size] for k in range(0, len(STREAM), size)])
    assert (action.position_m[2], action.gripper_open) == (1.0, True)
    assert isinstance(whole, PredictedActions)
    assert whole.id == "é\u2028x"


def test_an_event_comes_as_soon_as_it_is_complete():
    arrived = []

    def pieces():
        for k in range(0, len(STREAM), 4):
            arrived.append(k)
            yield STREAM[k : k + 4]

    assert next(streamed(pieces())).gripper_open
    assert arrived[-1] <= STREAM.index(b"id: 7")


@pytest.mark.parametrize("rest", [b"", STREAM[:-2], b"event: done\n\n"])
def test_an_answer_that_is_cut_off_is_none(rest):
    with pytest.raises(ServiceUnreachableError, match="ended before it was complete"):
        list(streamed([rest]))


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        ("text/html", b"<p>a proxy's page</p>"),
        *(("text/event-stream", b"event: action\ndata: " + data + b"\n\n") for data in (b"3", b"[1]", b"{", b"\xff")),
    ],
)
def test_a_service_that_streams_something_else_is_none(kind, body):
    with pytest.raises(ServiceUnreachableError, match=r"not a JSON object|Expected response header Content-Type"):
        list(streamed([body], kind))
