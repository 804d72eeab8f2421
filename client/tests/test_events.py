"""Streams of events, cut anywhere."""

import httpx
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceUnreachableError
from roboprompt_client.events import NotEventsError, events
from roboprompt_client.robot import Observation

STREAM = (
    ': a comment\n\nevent: action\ndata: {"a": 1}\n\nid: 7\r\nevent: text\r\ndata: {"t":\r\ndata:  "é\u2028x"}\r\n\r\n'
).encode()
EXPECTED = [("action", {"a": 1}), ("text", {"t": "é\u2028x"})]


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_however_the_bytes_arrive(size):
    pieces = [STREAM[k : k + size] for k in range(0, len(STREAM), size)]
    assert list(events(pieces)) == EXPECTED


def test_an_event_that_is_cut_off_is_none():
    assert list(events([STREAM[:-2]])) == EXPECTED[:1]
    assert list(events([b"event: done\n\n"])) == []


@pytest.mark.parametrize("data", [b"data: [1]\n\n", b"data: {\n\n", b"data: \xff\n\n"])
def test_what_is_no_json_object_is_an_error(data):
    with pytest.raises(NotEventsError):
        list(events([data]))


@pytest.mark.parametrize(
    ("kind", "body"), [("text/html", b"<p>a proxy's page</p>"), ("text/event-stream", b"event: action\ndata: 3\n\n")]
)
def test_a_service_that_streams_something_else_is_none(kind, body):
    answer = httpx.MockTransport(lambda request: httpx.Response(200, content=body, headers={"content-type": kind}))
    connection = httpx.Client(transport=answer, base_url="http://robots")
    with (
        RoboPromptClient(connection=connection) as client,
        pytest.raises(ServiceUnreachableError, match=r"no JSON|not text"),
    ):
        list(client.stream("t", "go", Observation()))
