"""A model that reasons in its reply, behind a real HTTP server: what it only considered moves no robot."""

import asyncio
from contextlib import aclosing

import pytest

from app.llm.backends import BUILT_IN
from app.llm.base import ModelResponseError
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry
from app.services.container import Services
from app.services.errors import RefusedReplyError
from app.services.predict.part_reply import PredictedAction
from tests.llm.loopback import delta, loopback, streamed
from tests.llm.loopback import text as completion_text
from tests.services.test_predict_actions import REQUEST
from tests.services.test_upload_episode import upload

DRAFT = "[[54, 30, 14, 0, 36, 36, 0], [54, 30, 20, 0, 36, 36, 1]]"
FINAL = "[[54, 32, 14, 0, 36, 36, 0], [54, 32, 20, 0, 36, 36, 1]]"
CHECKED = f"Draft: {DRAFT}. Check with {{'cube': [54, 32, 14]}}: y must be 32."


def answering(text):
    """What a server sends that ends a reply at the stop strings that it is given."""

    def sent(body):
        ends = [at for stop in body.get("stop", []) if (at := text.find(stop)) >= 0]
        said = text[: min(ends, default=len(text))]
        make = delta if "messages" in body else completion_text
        return [*(make(said[at : at + 3]) for at in range(0, len(said), 3)), make("", "stop"), "[DONE]"]

    return sent


async def whole(services):
    return (await services.predict_actions(REQUEST)).reply.actions


async def streamed_to(given, services):
    question = await services.predict_actions.prepare(REQUEST)
    async with aclosing(services.predict_actions.stream(question)) as arriving:
        given += [item async for item in arriving if isinstance(item, PredictedAction)]
    return given


async def outcome(answer):
    """The bins of the actions, or the error as text."""
    try:
        return [list(item.discrete.bins) for item in await answer]
    except (ModelResponseError, RefusedReplyError) as error:
        return str(error)


@pytest.fixture
def ask(store):
    """What comes of a whole answer, which is the same as of a streamed one; and how many actions the stream gave."""

    async def of_both(base_url, style):
        settings = LlmSettings(
            default_model="openai_compatible/m", compatible_base_url=base_url, compatible_style=style
        )
        models = ModelRegistry(settings, {"openai_compatible": BUILT_IN["openai_compatible"]})
        services, given = Services(store, models, "openai_compatible/m"), []
        await asyncio.to_thread(services.upload_episode, upload("cube"))
        found = await outcome(whole(services))
        assert await outcome(streamed_to(given, services)) == found
        await models.aclose()
        return found, len(given)

    async def scenario(sent, style):
        async def answer(writer):
            await streamed(*sent(server.requests[-1][1]))(writer)

        async with loopback(answer) as (base_url, server):
            return await of_both(base_url, style)

    return lambda sent, style="chat": asyncio.run(scenario(sent, style))


@pytest.mark.parametrize("opened", ["<think>", ""], ids=["in the reply", "in the template"])
def test_a_draft_moves_nothing_and_the_answer_after_it_does(ask, opened):
    found, num_given = ask(answering(f"{opened}{CHECKED}</think> {FINAL}"))
    assert (str(found), num_given) == (FINAL, 2)


@pytest.mark.parametrize("style", ["chat", "completion"])
def test_reasoning_that_does_not_end_moves_nothing_and_names_the_remedy(ask, style):
    """A server that gets a stop string, as for text to continue, ends the reply where the reasoning has it."""
    text = f"<think>{CHECKED}" + f"</think> {FINAL}" * (style == "completion")
    error, num_given = ask(answering(text), style)
    assert "ended within its reasoning (<think>); ask with a larger max_actions" in error
    assert num_given == 0


def test_a_draft_in_prose_moves_nothing(ask):
    error, num_given = ask(answering(f"First {DRAFT}, but y must be 32: {FINAL}"), style="completion")
    assert "2 lists of actions, expected one" in error
    assert num_given == 0
