"""Who waits for whom. Nothing here takes longer than the patience that is set."""

import asyncio

import pytest

from app.llm.llama import embedded
from app.llm.llama.embedded import WarmSlots

pytestmark = pytest.mark.anyio


class Requests:
    """Requests that go on until they may end."""

    def __init__(self, slots=4):
        self.slots = WarmSlots(slots)
        self.inside = []
        self._ends = {}
        self._tasks = {}

    async def begin(self, name, prefix="a"):
        self._ends[name] = asyncio.Event()
        self._tasks[name] = asyncio.create_task(self._run(name, prefix))
        await settled()

    async def _run(self, name, prefix):
        async with self.slots.turn(prefix):
            self.inside.append(name)
            await self._ends[name].wait()
        self.inside.remove(name)

    async def end(self, name):
        self._ends[name].set()
        await settled()

    async def cancel(self, name):
        self._tasks[name].cancel()
        await asyncio.gather(self._tasks[name], return_exceptions=True)
        await settled()


async def settled():
    for _ in range(5):
        await asyncio.sleep(0)


@pytest.fixture
def patience(monkeypatch):
    monkeypatch.setattr(embedded, "PATIENCE_S", 0.1)


async def test_one_after_the_other_in_the_order_of_coming():
    requests = Requests()
    for name in "123":
        await requests.begin(name)
    assert requests.inside == ["1"]
    await requests.end("1")
    assert requests.inside == ["2"]
    await requests.end("2")
    assert requests.inside == ["3"]
    await requests.end("3")
    await requests.begin("4")
    assert requests.inside == ["4"]


async def test_other_prefixes_and_requests_without_one_do_not_wait():
    requests = Requests()
    for name, prefix in zip("12345", ["a", "b", "", "", "a"], strict=True):
        await requests.begin(name, prefix)
    assert requests.inside == ["1", "2", "3", "4"]


async def test_a_long_wait_takes_a_further_slot_if_one_is_free(patience):
    requests = Requests(slots=2)
    for name in "123":
        await requests.begin(name)
    assert requests.inside == ["1"]
    await asyncio.sleep(0.2)
    assert requests.inside == ["1", "2"]
    await requests.end("2")
    assert requests.inside == ["1", "3"]
    await requests.end("3")
    await requests.begin("4")
    assert requests.inside == ["1", "4"]  # two slots know the prefix by now


async def test_a_cancelled_request_loses_its_turn():
    requests = Requests()
    for name in "123":
        await requests.begin(name)
    await requests.cancel("2")
    await requests.cancel("1")
    assert "3" in requests.inside


async def test_a_turn_that_comes_as_its_request_is_cancelled_goes_to_the_next():
    requests = Requests()
    for name in "123":
        await requests.begin(name)
    requests._ends["1"].set()
    await asyncio.sleep(0)  # the first leaves and hands over
    await requests.cancel("2")
    assert requests.inside == ["3"]


async def test_only_as_many_prefixes_as_slots_are_remembered():
    slots = WarmSlots(2)
    for prefix in "abcd":
        async with slots.turn(prefix):
            pass
    assert list(slots._lanes) == ["c", "d"]
