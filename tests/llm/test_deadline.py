"""The one deadline, `resilient.within_deadline`."""

import asyncio

import pytest

from app.llm.base import ModelTimeoutError, TextDelta
from app.llm.computed import ScriptedModel
from app.llm.resilient import within_deadline
from app.pipeline.prompt import Prompt
from tests.llm.texts import as_asked, asking


def test_the_deadline_counts_while_the_consumer_thinks():
    async def run():
        model = as_asked(ScriptedModel(["a b c d"], delay_s=0.05))
        pieces = model.stream(asking(Prompt("", "", ""), timeout_s=0.2))
        await anext(pieces)
        await asyncio.sleep(0.3)
        with pytest.raises(ModelTimeoutError):
            await anext(pieces)

    asyncio.run(run())


def test_a_timeout_closes_what_it_waits_for():
    closed = []

    async def endless():
        try:
            await asyncio.sleep(60)
            yield TextDelta("late")
        finally:
            closed.append(True)

    with pytest.raises(ModelTimeoutError, match=r"slow did not answer within 0\.05 s"):
        asyncio.run(anext(within_deadline(endless(), 0.05, "slow")))
    assert closed == [True]
