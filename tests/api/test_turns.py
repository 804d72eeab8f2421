"""What computes for long takes one of few turns: of forty threads at once the event loop would get a fortieth."""

import asyncio
from types import SimpleNamespace

import anyio
import pytest

from app.api.body import Body
from app.api.image_work import ImageWork, _Room
from app.api.routes import episodes, objects
from app.api.schemas.objects import LearnLabelsBody
from app.api.schemas.requests import EpisodeEdit

MODEL = {"estimator": "registered", "views": ["a"]}


@pytest.fixture
def services():
    return SimpleNamespace(teaching=anyio.CapacityLimiter(4), store=None, configure_task=None, limits=None, turns=[])


def taking_a_turn(services, answer):
    """A use case that notes how many turns are taken while it works."""
    services.prefix_warmer = SimpleNamespace(changed=lambda task: None)
    return lambda *args, **options: services.turns.append(services.teaching.borrowed_tokens) or answer


def test_objects_are_learned_from_labels_in_turn(services, monkeypatch):
    monkeypatch.setattr(objects.learn, "learn_from_labels", taking_a_turn(services, MODEL))
    asyncio.run(objects.learn_from_labels(services, "task", LearnLabelsBody(object="mug")))
    assert services.turns == [1]


def test_an_episode_that_is_shown_again_is_extracted_in_turn(services, monkeypatch):
    monkeypatch.setattr(episodes, "_edited", taking_a_turn(services, {"task": "task"}))
    asyncio.run(episodes.edit(services, "id", EpisodeEdit(left_out=False)))
    assert services.turns == [1]


def test_no_more_trajectories_are_unpacked_than_episodes_are_taken_in(services, monkeypatch):
    """A .npz of 0.1 MB may hold 100 MB: those of requests that wait for a turn stay packed."""
    monkeypatch.setattr(episodes, "_read_upload", taking_a_turn(services, SimpleNamespace(task="task")))
    monkeypatch.setattr(episodes, "read_body", given(Body({}, {})))
    monkeypatch.setattr(episodes, "image_work", lambda request: ImageWork())
    monkeypatch.setattr(episodes, "_uploaded", lambda services, upload: {"id": "1", "task": "task"})

    async def uploads():
        async with asyncio.TaskGroup() as group, services.teaching:
            services.teaching.total_tokens = 1
            waiting = group.create_task(episodes.upload_episode(None, services))
            await asyncio.sleep(0.05)
            assert services.turns == []
        assert waiting.result().status_code == 201

    asyncio.run(uploads())
    assert services.turns == [1]


def test_requests_with_images_get_room_in_the_order_in_which_they_ask():
    """A large request is not overtaken by small ones, and one that leaves lets the next one in."""

    async def ask():
        room, served = _Room(), []

        async def take(name, amount):
            await room.take(amount, 10)
            served.append(name)

        await room.take(8, 10)
        async with asyncio.TaskGroup() as group:
            for name, amount in (("large", 10), ("leaves", 9), ("small", 1), ("also small", 1)):
                waiting = group.create_task(take(name, amount))
                if name == "leaves":
                    leaving = waiting
            await asyncio.sleep(0.01)
            leaving.cancel()
            await asyncio.sleep(0.01)
            assert served == []
            room.give_back(8)
            await asyncio.sleep(0.01)
            assert served == ["large"]
            room.give_back(10)
        return served

    assert asyncio.run(ask()) == ["large", "small", "also small"]


def given(value):
    async def read(request):
        return value

    return read
