"""The client for asyncio asks and reads as the one that waits."""

import asyncio
import inspect

import httpx
import numpy as np
import pytest

from roboprompt_client import AsyncRoboPromptClient, ObjectPose, Observation, RoboPromptClient
from roboprompt_client.answers import PredictedActions
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError

SEEN = Observation(ObjectPose("cube", np.zeros(3)))
ACTION = {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": [1, 0, 0, 0], "gripper_open": True}
ANSWER = {"id": "p1", "actions": [ACTION], "findings": []}
EVENTS = (
    b'event: findings\ndata: {"findings": []}\n\n'
    b'event: action\ndata: {"position": [0.1, 0.2, 0.9], "quaternion_xyzw": [1, 0, 0, 0], "gripper_open": true}\n\n'
)
DONE = b'event: done\ndata: {"id": "p1", "actions": [], "findings": []}\n\n'
STREAM = {"content-type": "text/event-stream"}


def asked_of(answer):
    """A client of a service that answers so, and what it is asked."""
    asked = []

    def handle(request):
        asked.append((request.method, str(request.url), dict(request.headers), request.content))
        return answer(request)

    transport = httpx.MockTransport(handle)
    return asked, {"base_url": "http://robots", "transport": transport}


CALLS = {
    "predict": (("lift", "lift the cube", SEEN), {"timeout_s": 5.0, "model": "nearest"}),
    "plan": (("lift the cube", ["cube"]), {}),
    "motion_limits": (("lift",), {}),
    "record_outcome": (("p1", False, "fell"), {}),
    "edit_episode": (("e1",), {"left_out": True}),
    "get": (("/episodes",), {"task": "lift"}),
    "get_bytes": (("/episodes/e1/trajectory",), {}),
    "ping": ((), {}),
}
BOUNDS = {"keep_out": [], "max_step_m": None, "max_step_rotation_deg": None}
EVERYTHING = {
    **ANSWER,
    "checks": {},
    "steps": [{"task": "lift", "instruction": "lift the cube"}],
    "workspace": {"min": [-1, -1, 0], "max": [1, 1, 2]},
    "motion_limits": BOUNDS,
}


@pytest.mark.parametrize("name", CALLS)
def test_both_ask_the_same_and_read_the_same(name):
    arguments, options = CALLS[name]
    asked, how = asked_of(lambda _: httpx.Response(200, json=EVERYTHING))
    with RoboPromptClient(connection=httpx.Client(**how)) as client:
        waited = getattr(client, name)(*arguments, **options)

    async def run():
        async with AsyncRoboPromptClient(connection=httpx.AsyncClient(**how)) as client:
            return await getattr(client, name)(*arguments, **options)

    awaited = asyncio.run(run())
    assert asked[0] == asked[1]
    if isinstance(waited, PredictedActions):
        waited, awaited = waited.response, awaited.response
    assert awaited == waited


def test_both_have_the_same_methods():
    def of(kind):
        return {
            name: str(inspect.signature(method)).partition(" ->")[0]
            for name, method in vars(kind).items()
            if not name.startswith("_") and callable(method)
        }

    assert of(AsyncRoboPromptClient) == of(RoboPromptClient)


async def _streamed(how):
    async with AsyncRoboPromptClient(connection=httpx.AsyncClient(**how)) as client:
        found = []
        return [item async for item in client.stream("t", "go", SEEN, on_findings=found.append)], found


def test_actions_come_one_by_one():
    _, how = asked_of(lambda _: httpx.Response(200, content=EVENTS + DONE, headers=STREAM))
    (action, whole), found = asyncio.run(_streamed(how))
    np.testing.assert_array_equal(action.position_m, [0.1, 0.2, 0.9])
    assert (whole.id, found) == ("p1", [()])


@pytest.mark.parametrize(
    ("answer", "kind", "message"),
    [
        (httpx.Response(200, content=EVENTS, headers=STREAM), ServiceUnreachableError, "ended before it was complete"),
        (httpx.Response(422, json={"title": "no", "detail": "no cube"}), ServiceProblemError, "no cube"),
        (httpx.Response(200, text="<p>a proxy</p>"), ServiceUnreachableError, "Content-Type"),
        (httpx.ConnectError("refused"), ServiceUnreachableError, "POST http://robots/predict: refused"),
    ],
)
def test_a_stream_that_goes_wrong(answer, kind, message):
    def give(_):
        if isinstance(answer, Exception):
            raise answer
        return answer

    _, how = asked_of(give)
    with pytest.raises(kind, match=message):
        asyncio.run(_streamed(how))
