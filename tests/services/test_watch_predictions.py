import asyncio
import time

import pytest

from app.llm.base import ModelTimeoutError
from tests.services.conftest import ONE_ACTION, with_options
from tests.services.test_predict_actions import REQUEST, ask
from tests.services.test_upload_episode import respond, upload


@pytest.fixture
def slow(scripted):
    services = scripted(ONE_ACTION, delay_s=0.2)  # 7 words
    services.upload_episode(upload("cube"), respond)
    return services


async def seen_while(services, request):
    """What is under way while the request runs, and afterwards."""
    asked, during = asyncio.create_task(services.predict_actions(request)), ()
    while not during and not asked.done():
        await asyncio.sleep(0.02)
        during = services.store.under_way.all()
    await asyncio.gather(asked, return_exceptions=True)
    return during, services.store.under_way.all(), asked


def test_a_long_prediction_is_seen_until_it_ends(slow):
    (during,), after, asked = asyncio.run(seen_while(slow, REQUEST))
    assert (during.task, during.instruction, during.model) == ("pick", "pick up the cube", "scripted")
    assert time.time() - 10 < during.started_s < during.deadline_s
    assert after == ()
    assert len(asked.result().reply.actions) == 1


def test_one_that_fails_is_forgotten_too(slow):
    request = with_options(REQUEST, timeout_s=1.0)
    during, after, asked = asyncio.run(seen_while(slow, request))
    assert (len(during), len(after)) == (1, 0)
    assert isinstance(asked.exception(), ModelTimeoutError)


def test_a_short_one_writes_nothing(scripted, tmp_path):
    services = scripted(ONE_ACTION)
    services.upload_episode(upload("cube"), respond)
    ask(services)
    assert services.store.under_way.all() == ()
    assert not (tmp_path / "under_way").exists()
