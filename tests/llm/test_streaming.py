import asyncio
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.llm.base import Completion, ModelResponseError, ModelTimeoutError, TextDelta, Usage
from app.llm.computed import ScriptedModel
from app.llm.streaming import StopStrings, whole, within_deadline
from app.pipeline.prompt import Prompt
from tests.llm.texts import asking


@given(st.text("abc", max_size=30), st.lists(st.text("abc", max_size=3), max_size=3), st.data())
def test_where_a_text_stops_does_not_depend_on_its_pieces(text, stop, data):
    cuts = sorted(data.draw(st.lists(st.integers(0, len(text)), max_size=6)))
    pieces = [text[a:b] for a, b in zip([0, *cuts], [*cuts, len(text)], strict=True)]
    stops = StopStrings(stop)
    said = "".join(map(stops.feed, pieces)) + stops.flush()
    ends = [at + len(s) for s in stop if s and (at := text.find(s)) >= 0]
    assert stops.stopped == bool(ends)
    if not ends:
        assert said == text
    else:
        stopped_by = [s for s in stop if s and text[: min(ends)].endswith(s)]
        assert said == text[: min(ends) - max(map(len, stopped_by))]


def test_text_that_cannot_begin_a_stop_string_is_not_held_back():
    stops = StopStrings(["]]"])
    assert [stops.feed(piece) for piece in ("[[1", "], ", "[2]", "]", " more")] == ["[[1", "], ", "[2", "", ""]


def test_the_deadline_counts_while_the_consumer_thinks():
    async def run():
        model = ScriptedModel(["a b c d"], delay_s=0.05)
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
        asyncio.run(whole(within_deadline(endless(), 0.05, "slow")))
    assert closed == [True]


def test_a_stream_without_an_end_is_an_error():
    async def cut():
        yield TextDelta("a")

    with pytest.raises(ModelResponseError, match="before it was complete"):
        asyncio.run(whole(cut()))


def test_a_script_replies_in_turn_and_raises_its_errors():
    async def run():
        model = ScriptedModel(["one two", ModelResponseError("no")])
        request = asking(Prompt("s", "p ", "q"))
        assert await model.complete(request) == Completion("one two", Usage(3, 0, 2))
        with pytest.raises(ModelResponseError, match="no"):
            await model.complete(request)
        assert (await model.complete(request)).text == "one two"

    asyncio.run(run())


def test_a_script_may_be_a_function_of_the_request():
    async def run():
        seen = []
        request = asking(Prompt("s", "p ", "q"))
        model = ScriptedModel(lambda asked: seen.append(asked) or asked.prompt.query)
        assert [(await model.complete(request)).text for _ in range(3)] == ["q"] * 3
        assert seen == [request] * 3

    asyncio.run(run())


def test_a_script_can_be_a_function_and_slow():
    async def run():
        model = ScriptedModel(lambda request: request.prompt.query.upper(), delay_s=0.02)
        started = time.perf_counter()
        assert (await model.complete(asking(Prompt("", "", "a b c")))).text == "A B C"
        assert time.perf_counter() - started >= 0.06

    asyncio.run(run())
