import time

import pytest

from app.llm.base import Completion, ModelResponseError, Usage, complete
from app.llm.computed import ScriptedModel
from app.pipeline.prompt import Prompt
from tests.llm.texts import asking

pytestmark = pytest.mark.anyio


async def test_a_script_replies_in_turn_and_raises_its_errors():
    model = ScriptedModel(["one two", ModelResponseError("no")])
    request = asking(Prompt("s", "p ", "q"))
    assert await complete(model, request) == Completion("one two", Usage(3, 0, 2))
    with pytest.raises(ModelResponseError, match="no"):
        await complete(model, request)
    assert (await complete(model, request)).text == "one two"


async def test_a_script_may_be_a_function_of_the_request_and_slow():
    seen = []
    request = asking(Prompt("s", "p ", "q"))
    model = ScriptedModel(lambda asked: seen.append(asked) or asked.prompt.query, delay_s=0.02)
    started = time.perf_counter()
    assert [(await complete(model, request)).text for _ in range(3)] == ["q"] * 3
    assert time.perf_counter() - started >= 0.06
    assert seen == [request] * 3
