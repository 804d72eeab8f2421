"""Many requests on few slots: all are answered, each as if it were alone.

Replies copy the prompt's rows, so that every slot drafts as much as it may: with a batch smaller than the next token
and the draft of every slot, llama.cpp ends its process here.
"""

import asyncio

import pytest

from app.llm.base import complete
from app.llm.llama.embedded import EmbeddedModel, EmbeddedOptions
from app.llm.llama.weights import find_trimmed_weights
from tests.llm.test_embedded import PROFILE
from tests.llm.texts import asking, object_frame_prompt

NUM_REQUESTS, NUM_TASKS, SLOTS = 5, 3, 4
NUM_ALONE = 2  # of them asked once more, one after the other


@pytest.fixture(scope="module")
def model(settings, run):
    options = EmbeddedOptions(threads=1, slots=SLOTS, context_tokens=512)
    made = EmbeddedModel(PROFILE, find_trimmed_weights("gemma-3-270m", settings), options)
    yield made
    run(made.aclose())


def prompt(k):
    """One of several tasks' prefixes, with a query of its own."""
    return object_frame_prompt(seed=k % NUM_TASKS, query_seed=k)


def test_replies_at_once_are_those_in_turn(model, run):
    requests = [asking(prompt(k), timeout_s=300) for k in range(NUM_REQUESTS)]

    async def at_once():
        return await asyncio.gather(*(complete(model, request) for request in requests))

    async def in_turn():
        return [await complete(model, request) for request in requests[:NUM_ALONE]]

    together, alone = run(at_once()), run(in_turn())
    assert [reply.text for reply in together[:NUM_ALONE]] == [reply.text for reply in alone]
    assert all(reply.finish_reason == "stop" for reply in together)
