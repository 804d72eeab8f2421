"""A stream that has begun says in itself what went wrong."""

import asyncio
import json
from types import SimpleNamespace

import pytest
from starlette.requests import Request

from app.api.routes import predict
from app.pipeline.order.order import Order
from app.services.predict.part_reply import PredictedAction
from app.store.errors import StoreUnavailableError


def events_of(error, number=3):
    actions = [PredictedAction.__new__(PredictedAction) for _ in range(number)]
    for action in actions:
        action.__dict__["document"] = {"position": [0, 0, 1]}

    async def answer():
        for action in actions[1:]:
            yield action
        raise error

    async def collect():
        request = Request({"type": "http", "method": "POST", "path": "/predict", "headers": []})
        question = SimpleNamespace(findings=(), grounded=Order("press the button", ()))
        stream = predict._events(request, question, actions[0], answer())
        return b"".join([piece async for piece in stream]).decode()

    return asyncio.run(collect())


def last_event(text):
    return json.loads(text.rpartition("event: error")[2].partition("data: ")[2].strip())


def test_actions_that_cannot_be_recorded_are_counted():
    text = events_of(StoreUnavailableError("database: disk is full"))
    document = last_event(text)
    assert text.count("event: action") == 3
    assert (document["status"], document["actions_sent"], document["recorded"]) == (503, 3, False)


@pytest.mark.parametrize("error", [OverflowError("too large"), ValueError("nan"), RuntimeError("x")])
def test_an_unexpected_error_is_an_event_too(error):
    document = last_event(events_of(error))
    assert document["type"] == "/problems/internal-error"


@pytest.mark.parametrize(
    ("accept", "wanted"),
    [
        ("text/event-stream", True),
        ("TEXT/Event-Stream; q=0.1, */*", True),
        ("text/event-stream;q=0, application/json", False),
        ("text/event-stream ; q = 0.000, */*", False),
        ("text/event-streams", False),
        (",;,q=1,text/*;" * 700, False),
    ],
)
def test_a_stream_comes_only_where_it_is_accepted(accept, wanted):
    assert predict._wants_events(accept) is wanted
