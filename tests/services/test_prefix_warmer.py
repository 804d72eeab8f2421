"""When prefixes are sent ahead. The model is a scripted one, made to look like an embedded one."""

import asyncio
from contextlib import asynccontextmanager, suppress

import pytest

from app.llm.base import Completion, ModelProfile
from app.services.poses import PoseServers
from app.services.predict import warm
from app.services.predict.known import KnownReader
from app.services.predict.prefix import usual_prefixes
from app.services.predict.warm import PrefixWarmer
from app.store import predictions
from tests.store.drafts import episode_draft, prediction_draft, upload

PROFILE = ModelProfile("slow", "completion", grammar=True, representation="object_frame", system_prompt="none")


class SlowModel:
    """A registry of one model that notes what it reads, and whether it was allowed to finish."""

    def __init__(self) -> None:
        self.begun, self.finished, self.at_once, self.most_at_once = [], [], 0, 0
        self.seconds = 0.02

    def get(self, name=""):
        return self

    async def warm_up(self, name=""):
        return True

    async def stream(self, request):
        self.begun.append(request.prompt.prefix)
        self.at_once += 1
        self.most_at_once = max(self.most_at_once, self.at_once)
        try:
            await asyncio.sleep(self.seconds)
        finally:
            self.at_once -= 1
        self.finished.append(request.prompt.prefix)
        yield Completion("")


@asynccontextmanager
async def running(store, model, num_tasks=4):
    warmer = PrefixWarmer(store, model, KnownReader(store, lambda name: PROFILE, PoseServers()), num_tasks)
    task = asyncio.create_task(warmer.run())
    await asyncio.sleep(0)  # it runs
    try:
        yield warmer
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        assert model.at_once == 0


async def until(condition):
    async with asyncio.timeout(10):
        while not condition():
            await asyncio.sleep(0.005)


@pytest.fixture(autouse=True)
def short_debounce(monkeypatch):
    monkeypatch.setattr(warm, "DEBOUNCE_S", 0.1)


def three_tasks(store):
    for k, task in enumerate(("first", "second", "third")):
        upload(store, episode_draft(seed=k, task=task))
    with store.write() as connection:
        predictions.add(connection, prediction_draft(task="first"))


def test_most_recently_used_tasks_are_warmed_one_at_a_time(store):
    three_tasks(store)

    async def scenario():
        model = SlowModel()
        async with running(store, model, num_tasks=2):
            await until(lambda: len(model.finished) == 2)
            await asyncio.sleep(0.1)
        assert model.most_at_once == 1
        return model.finished

    prefixes = asyncio.run(scenario())
    reader = KnownReader(store, lambda name: PROFILE, PoseServers())
    assert prefixes == [usual_prefixes(*reader.usual(task))[0].template.prefix for task in ("first", "third")]


def test_uploads_in_a_row_are_read_ahead_once(store, monkeypatch):
    monkeypatch.setattr(warm, "DEBOUNCE_S", 0.3)

    async def scenario():
        model = SlowModel()
        async with running(store, model) as warmer:
            for seed in range(5):
                upload(store, episode_draft(seed=seed, task="new"))  # no other coroutine runs in between
                warmer.changed("new")
            await until(lambda: model.finished)
            await asyncio.sleep(0.2)
        return model

    model = asyncio.run(scenario())
    assert len(model.begun) == 1
    usual = KnownReader(store, lambda name: PROFILE, PoseServers()).usual("new")
    assert model.finished[0] == usual_prefixes(*usual)[0].template.prefix


def test_a_prediction_interrupts_and_the_rest_is_made_up_for(store):
    three_tasks(store)

    async def scenario():
        model = SlowModel()
        model.seconds = 0.3
        async with running(store, model, num_tasks=1) as warmer:
            await until(lambda: model.begun)
            with warmer.giving_way():
                await asyncio.sleep(0.5)
                assert (len(model.begun), model.finished, model.at_once) == (1, [], 0)
            await until(lambda: model.finished)
        assert len(model.begun) == 2

    asyncio.run(scenario())


def test_nothing_is_read_ahead_between_predictions_in_quick_succession(store):
    three_tasks(store)

    async def scenario():
        model = SlowModel()
        async with running(store, model, num_tasks=0) as warmer:
            with warmer.giving_way():
                warmer.changed("first")
                await asyncio.sleep(2 * warm.DEBOUNCE_S)
            with warmer.giving_way():  # at once: the warmer has not looked since
                await asyncio.sleep(0.2)
                assert model.begun == []
            await until(lambda: model.finished)

    asyncio.run(scenario())


def test_a_task_without_a_prefix_is_no_failure(store):
    three_tasks(store)

    async def scenario():
        model = SlowModel()
        async with running(store, model, num_tasks=0) as warmer:
            warmer.changed("never heard of")
            warmer.changed("first")
            await until(lambda: model.finished)

    asyncio.run(scenario())


def test_a_change_may_be_reported_from_any_thread_and_before_the_model_starts(store):
    upload(store, episode_draft(seed=0, task="first"))

    async def scenario():
        model = SlowModel()
        async with running(store, model, num_tasks=0) as warmer:
            await asyncio.to_thread(warmer.changed, "first")
            await until(lambda: model.finished)
        warmer.changed("first")  # nobody is there any more
        return model.begun

    assert len(asyncio.run(scenario())) == 1
