import asyncio
import json
from contextlib import aclosing
from dataclasses import replace

import pytest

from app.llm.backends import BUILT_IN
from app.llm.base import (
    Completion,
    CompletionRequest,
    ModelProfile,
    ModelResponseError,
    ModelUnavailableError,
    TextDelta,
    Usage,
    complete,
)
from app.llm.computed import ScriptedModel
from app.llm.llm_settings import LlmSettings
from app.llm.recorded import RecordingModel, ReplayedModel, hash_of, question_of
from app.llm.registry import ModelRegistry
from app.pipeline.prompt import Prompt
from tests.llm import claude
from tests.llm.loopback import in_turn, loopback, status, streamed
from tests.llm.texts import asking

PROFILE = ModelProfile("own/model", "chat", grammar=True, representation="absolute", description="Ünïcode")
REQUEST = asking(Prompt("Be brief.", "a>1, ", "b>", stop=("\n",), grammar='root ::= "1"'))


async def pieces_of(model, request=REQUEST):
    async with aclosing(model.stream(request)) as pieces:
        return [piece async for piece in pieces]


def record(folder, script, request=REQUEST):
    return asyncio.run(pieces_of(RecordingModel(ScriptedModel(script, profile=PROFILE), folder), request))


def replay(folder, request=REQUEST):
    return asyncio.run(pieces_of(ReplayedModel("own/model", folder), request))


def reply_files(folder):
    return [path for path in folder.iterdir() if not path.name.startswith("model-")]


def test_a_reply_is_repeated_in_the_same_pieces(tmp_path):
    folder = tmp_path / "new" / "folder"
    asked = record(folder, ["[[1, 2], «3»]"])
    assert len(asked) == 4
    assert replay(folder) == asked
    assert asyncio.run(complete(ReplayedModel("own/model", folder), REQUEST)) == asked[-1]
    assert ReplayedModel("own/model", folder).profile == PROFILE


def test_a_file_tells_people_what_was_asked_and_answered(tmp_path):
    record(tmp_path, ["4 2"])
    (path,) = reply_files(tmp_path)
    assert path.stem == hash_of(question_of("own/model", REQUEST))
    content = json.loads(path.read_text())
    assert content["question"]["user"] == "a>1, b>"
    assert content["pieces"] == ["4 ", "2"]
    assert content["completion"]["text"] == "4 2"


DIFFERENT = [
    replace(REQUEST, prompt=replace(REQUEST.prompt, **{field: value}))
    for field, value in [("system", "Be."), ("prefix", "a>2, "), ("query", "c>"), ("stop", ()), ("grammar", None)]
] + [replace(REQUEST, **{field: value}) for field, value in [("max_tokens", 9), ("temperature", 0.5), ("seed", 1)]]


@pytest.mark.parametrize("request_", DIFFERENT)
def test_another_question_is_not_answered_and_its_hash_is_named(tmp_path, request_):
    record(tmp_path, ["4 2"])
    with pytest.raises(ModelUnavailableError, match=hash_of(question_of("own/model", request_))) as caught:
        replay(tmp_path, request_)
    assert "ROBOPROMPT_RECORD_LLM" in str(caught.value)


def test_what_cannot_change_the_reply_does_not_change_the_question(tmp_path):
    asked = record(tmp_path, ["4 2"])
    moved = replace(REQUEST.prompt, prefix="a>1, b", query=">")
    assert replay(tmp_path, CompletionRequest(moved, max_tokens=60, timeout_s=1.0, cache_key="other")) == asked


def test_another_model_has_recordings_of_its_own(tmp_path):
    record(tmp_path, ["4 2"])
    with pytest.raises(ModelUnavailableError, match="nothing is recorded of own/other in"):
        ReplayedModel("own/other", tmp_path)


def test_the_latest_reply_counts(tmp_path):
    record(tmp_path, ["one"])
    record(tmp_path, ["two"])
    assert replay(tmp_path)[-1].text == "two"


def test_an_error_is_not_recorded(tmp_path):
    with pytest.raises(ModelResponseError):
        record(tmp_path, [ModelResponseError("no")])
    assert list(tmp_path.iterdir()) == []


def break_off(folder, script):
    async def run():
        async with aclosing(RecordingModel(ScriptedModel(script, profile=PROFILE), folder).stream(REQUEST)) as pieces:
            return await anext(pieces)

    return asyncio.run(run())


def test_a_reply_that_was_broken_off_is_repeated_up_to_there(tmp_path):
    """As when a reply is seen to be wrong before it is complete."""
    assert break_off(tmp_path, ["[[x, 2]"]) == TextDelta("[[x, ")

    async def run():
        async with aclosing(ReplayedModel("own/model", tmp_path).stream(REQUEST)) as pieces:
            assert await anext(pieces) == TextDelta("[[x, ")
            with pytest.raises(ModelResponseError, match="was broken off here"):
                await anext(pieces)

    asyncio.run(run())


def test_a_reply_that_was_broken_off_replaces_no_whole_one(tmp_path):
    record(tmp_path, ["4 2"])
    break_off(tmp_path, ["5 3"])
    assert replay(tmp_path)[-1].text == "4 2"


@pytest.mark.parametrize("content", ["", "{", "[]", '{"question": {}, "pieces": [3], "completion": null}'])
def test_a_damaged_file_is_named(tmp_path, content):
    record(tmp_path, ["4 2"])
    (path,) = reply_files(tmp_path)
    path.write_text(content)
    with pytest.raises(ModelUnavailableError, match=f"{path} cannot be read"):
        replay(tmp_path)


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ModelUnavailableError, match=r"cannot be recorded in .* check ROBOPROMPT_RECORD_LLM"):
        record(tmp_path / "file", ["4 2"])


def test_replies_recorded_at_once_are_all_whole(tmp_path):
    async def run():
        model = RecordingModel(ScriptedModel(lambda request: request.prompt.query, profile=PROFILE), tmp_path)
        requests = [asking(Prompt("", "p ", f"query {number % 10}")) for number in range(40)]
        asked = await asyncio.gather(*(complete(model, request) for request in requests))
        replayed = ReplayedModel("own/model", tmp_path)
        assert await asyncio.gather(*(complete(replayed, request) for request in requests)) == asked
        assert len(list(tmp_path.iterdir())) == 11

    asyncio.run(run())


def test_a_paid_run_is_repeated_offline_without_a_key(tmp_path):
    answer = in_turn(
        status(529),
        streamed(claude.started(5, written=700), claude.said("4"), claude.said("2"), claude.ended(), claude.STOP),
    )

    async def paid():
        async with loopback(answer) as (base_url, _):
            settings = LlmSettings(
                anthropic_api_key=claude.KEY, anthropic_base_url=base_url, record_llm=tmp_path, llm_backoff_s=0.0
            )
            registry = ModelRegistry(settings, BUILT_IN)
            pieces = await pieces_of(registry.get("anthropic/claude-haiku-5-5"))
            await registry.aclose()
            return pieces

    async def repeated():
        registry = ModelRegistry(LlmSettings(replay_llm=tmp_path), BUILT_IN)
        offered = {item.profile.name: item for item in registry.profiles()}
        assert offered["anthropic/claude-haiku-5-5"].available
        assert "nothing is recorded of openai/gpt-4o" in offered["openai/gpt-4o"].reason
        assert not await registry.warm_up("anthropic/claude-haiku-5-5")
        return await pieces_of(registry.get("anthropic/claude-haiku-5-5"))

    pieces = asyncio.run(paid())
    assert pieces == [TextDelta("4"), TextDelta("2"), Completion("42", Usage(705, 0, 15))]
    assert asyncio.run(repeated()) == pieces
    assert not any(claude.KEY in path.read_text() for path in tmp_path.iterdir())
