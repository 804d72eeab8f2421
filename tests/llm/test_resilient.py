"""The wrapper around clients of a real server on loopback that fails in every way; nothing sleeps for long."""

import asyncio
import random
import socket
from contextlib import aclosing, asynccontextmanager

import pytest

from app.llm import resilient
from app.llm.base import (
    Completion,
    LanguageModelError,
    ModelBusyError,
    ModelProfile,
    ModelResponseError,
    ModelTimeoutError,
    ModelUnavailableError,
    TextDelta,
    complete,
)
from app.llm.computed import ScriptedModel
from app.llm.openai_compatible import OpenAiCompatibleModel
from app.llm.resilient import Places, ProviderLimits, ResilientModel
from app.llm.sse import Server
from app.pipeline.prompt import Prompt
from tests.llm.loopback import after, hang_up, in_turn, loopback, status, streamed, text
from tests.llm.texts import as_asked, asking

pytestmark = pytest.mark.anyio

PROMPT = Prompt("Be brief.", "a>1, ", "b>")
LIMITS = ProviderLimits(concurrent=4, queued=4, retries=2, backoff_s=0.5)
OK = streamed(text("4"), text("2", "stop"), "[DONE]")


class Provider:
    """A resilient model of a loopback server.

    Attributes:
        waits_s: its waits between tries, which take no time.
    """

    def __init__(self, model, limits=LIMITS):
        self.waits_s = []
        self.model = ResilientModel(model, Places("some", limits), sleep=self._sleep, jitter=random.Random(0).random)

    async def _sleep(self, wait_s):
        self.waits_s.append(wait_s)

    async def ask(self, **options):
        return await complete(self.model, asking(PROMPT, **options))


@asynccontextmanager
async def provider_at(answer, limits=LIMITS):
    async with loopback(answer) as (base_url, server):
        profile = ModelProfile("some/model", "completion", grammar=False, representation="absolute")
        yield Provider(OpenAiCompatibleModel(profile, Server(base_url, "k"), "little"), limits), server


def ask(answer, limits=LIMITS, **options):
    """The outcome, how often the server was asked, and the waits between."""

    async def run():
        async with provider_at(answer, limits) as (provider, server):
            try:
                outcome = await provider.ask(**options)
            except LanguageModelError as error:
                outcome = error
            return outcome, len(server.requests), provider.waits_s

    return asyncio.run(run())


@pytest.mark.parametrize("fault", [status(429), status(500), hang_up, streamed()])
def test_what_may_pass_is_tried_again(fault):
    outcome, num_asked, waits_s = ask(in_turn(fault, fault, OK))
    assert outcome == Completion("42")
    assert num_asked == 3
    assert 0.25 <= waits_s[0] <= 0.5 <= waits_s[1] <= 1.0


@pytest.mark.parametrize(
    ("fault", "error_type"),
    [
        (status(400), ModelResponseError),
        (status(401), ModelUnavailableError),
        (streamed("garbage"), ModelResponseError),
    ],
)
def test_what_will_not_pass_is_not_tried_again(fault, error_type):
    outcome, num_asked, waits_s = ask(in_turn(fault, OK))
    assert type(outcome) is error_type
    assert (num_asked, waits_s) == (1, [])


def test_the_last_error_is_raised_when_the_tries_are_used_up():
    outcome, num_asked, _ = ask(in_turn(status(429), status(500), status(503, b"{}", Retry_After="2"), OK))
    assert "HTTP 503" in str(outcome)
    assert outcome.retry_after_s == 2.0
    assert num_asked == 3


def test_the_server_says_how_long_to_wait_at_least():
    _, _, waits_s = ask(in_turn(status(429, Retry_After="7"), status(503, Retry_After="0.01"), OK))
    assert waits_s[0] == 7.0
    assert 0.5 <= waits_s[1] <= 1.0


def test_a_wait_beyond_the_deadline_is_not_begun():
    outcome, num_asked, waits_s = ask(in_turn(status(429, Retry_After="7"), OK), timeout_s=5.0)
    assert isinstance(outcome, ModelBusyError)
    assert outcome.retry_after_s == 7.0
    assert (num_asked, waits_s) == (1, [])


def test_waits_grow_to_a_limit():
    _, _, waits_s = ask(status(500), ProviderLimits(1, 0, retries=12, backoff_s=0.5), timeout_s=600.0)
    assert [wait_s > 4.0 for wait_s in waits_s] == [False] * 4 + [True] * 8
    assert max(waits_s) <= resilient.MAX_BACKOFF_S


async def test_nothing_is_tried_again_once_a_piece_has_come():
    async with provider_at(in_turn(streamed(text("4"), end=b"400\r\ndata: {"), OK)) as (provider, server):
        async with aclosing(provider.model.stream(asking(PROMPT))) as pieces:
            assert await anext(pieces) == TextDelta("4")
            with pytest.raises(ModelResponseError, match="cannot be read"):
                await anext(pieces)
        assert len(server.requests) == 1


def test_a_refused_connection_is_tried_again_and_then_named():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound and not listening: refused

        async def run():
            profile = ModelProfile("some/model", "chat", grammar=False, representation="absolute")
            address = f"http://127.0.0.1:{taken.getsockname()[1]}/v1"
            provider = Provider(OpenAiCompatibleModel(profile, Server(address), "x"))
            with pytest.raises(ModelUnavailableError, match="cannot reach some/model"):
                await provider.ask()
            return len(provider.waits_s)

        assert asyncio.run(run()) == 2


@pytest.mark.parametrize(
    "slow", [after(30, OK), streamed(*[text("a")] * 100, delay_s=0.05)], ids=["first byte", "drip"]
)
async def test_a_slow_server_meets_the_deadline_and_is_left(slow):
    async with provider_at(slow) as (provider, server):
        with pytest.raises(ModelTimeoutError, match=r"within 1 s"):
            await provider.ask(timeout_s=1.0)
        await asyncio.wait_for(server.gone.wait(), 2)
        assert len(server.requests) == 1


async def test_robots_at_once_take_turns_and_too_many_are_refused():
    most, now = 0, 0

    async def answer(writer):
        nonlocal most, now
        now += 1
        most = max(most, now)
        await asyncio.sleep(0.05)
        await OK(writer)
        now -= 1

    async with provider_at(answer, ProviderLimits(concurrent=2, queued=3)) as (provider, server):
        outcomes = await asyncio.gather(*(provider.ask() for _ in range(8)), return_exceptions=True)
        assert outcomes[:5] == [Completion("42")] * 5
        assert all(isinstance(outcome, ModelBusyError) and outcome.retry_after_s for outcome in outcomes[5:])
        assert (most, len(server.requests)) == (2, 5)
        assert (await provider.ask()).text == "42"


async def test_a_cancelled_request_makes_room_in_the_queue():
    async with provider_at(after(0.2, OK), ProviderLimits(concurrent=1, queued=1)) as (provider, _):
        first, waiting = (asyncio.create_task(provider.ask()) for _ in range(2))
        await asyncio.sleep(0)
        waiting.cancel()
        await asyncio.wait([waiting])
        assert (await provider.ask()).text == (await first).text == "42"


async def test_waiting_for_a_place_counts_against_the_deadline():
    async with provider_at(after(0.5, OK), ProviderLimits(concurrent=1, queued=1)) as (provider, server):
        first = asyncio.create_task(provider.ask())
        await asyncio.sleep(0)
        with pytest.raises(ModelTimeoutError, match=r"some/model did not answer within 0\.1 s"):
            await provider.ask(timeout_s=0.1)
        assert (await first).text == "42"
        assert len(server.requests) == 1


async def test_an_abandoned_reply_frees_its_place():
    async with provider_at(streamed(text("4"), text("2", "stop"), delay_s=0.3), ProviderLimits(1, 0)) as (provider, _):
        async with aclosing(provider.model.stream(asking(PROMPT))) as pieces:
            await anext(pieces)
        assert (await provider.ask()).text == "42"


async def test_the_deadline_counts_while_the_consumer_thinks():
    model = as_asked(ScriptedModel(["a b c d"], delay_s=0.05))
    pieces = model.stream(asking(Prompt("", "", ""), timeout_s=0.2))
    await anext(pieces)
    await asyncio.sleep(0.3)
    with pytest.raises(ModelTimeoutError):
        await anext(pieces)
