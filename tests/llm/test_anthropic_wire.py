import json

import pytest

from app.llm.anthropic import MODELS, UNKNOWN, EventParser, quirks_of, request_body, request_headers
from app.llm.base import ModelResponseError, Usage
from app.llm.sse import THINKING_TOKENS
from app.pipeline.prompt import Prompt
from tests.llm.claude import BLOCK, PING, STOP, ended, failed, said, started, thought
from tests.llm.texts import asking

PROMPT = Prompt("Be brief.", "a>1, ", "b>", stop=("\n", "{'"), grammar='root ::= "1"')


def body_for(model, prompt=PROMPT, **options):
    return request_body(asking(prompt, **options), model)


def test_one_user_message_in_two_parts_that_make_up_the_papers_string():
    body = body_for("claude-haiku-5-5", max_tokens=9, seed=3, cache_key="task-1")
    assert body == {
        "model": "claude-haiku-5-5",
        "max_tokens": 9,
        "stream": True,
        "system": "Be brief.",
        "messages": [
            {
                "role": "user",
                "content": [
                    {"type": "text", "text": "a>1, ", "cache_control": {"type": "ephemeral"}},
                    {"type": "text", "text": "b>"},
                ],
            }
        ],
        "stop_sequences": ["{'"],
        "thinking": {"type": "disabled"},
    }
    assert "".join(part["text"] for part in body["messages"][0]["content"]) == PROMPT.user


def test_no_part_of_a_message_is_empty():
    body = body_for("claude-haiku-5-5", Prompt("", "", "b>", stop=("\n",)))
    assert body["messages"] == [{"role": "user", "content": [{"type": "text", "text": "b>"}]}]
    assert not {"system", "stop_sequences"} & set(body)


@pytest.mark.parametrize(
    ("model", "fields"),
    [
        ("claude-opus-5-5", {"output_config": {"effort": "low"}}),
        ("claude-fable-5-1", {"output_config": {"effort": "low"}}),
        ("claude-sonnet-5-5", {"thinking": {"type": "between_tools"}}),
        ("claude-opus-5", {"thinking": {"type": "disabled"}}),
        ("claude-sonnet-5", {"thinking": {"type": "disabled"}}),
        ("claude-opus-4-8", {}),
        ("claude-opus-4-7", {}),
        ("claude-opus-4-6", {"temperature": 0.0}),
        ("claude-haiku-4-5-20251001", {"temperature": 0.0}),
        ("claude-next-9", {}),
    ],
)
def test_a_model_gets_the_fields_that_it_takes(model, fields):
    optional = {"thinking", "temperature", "output_config", "top_p", "top_k", "seed"}
    assert {name: value for name, value in body_for(model).items() if name in optional} == fields
    version = "2023-06-01" if "temperature" in fields else "2026-10-21"
    assert request_headers(model, "k") == {"x-api-key": "k", "anthropic-version": version}


@pytest.mark.parametrize(
    ("model", "room"), [("claude-opus-5-5", True), ("claude-x", True), ("claude-haiku-5-5", False)]
)
def test_a_model_that_thinks_has_room_for_it(model, room):
    assert body_for(model, max_tokens=9)["max_tokens"] == 9 + (THINKING_TOKENS if room else 0)


def test_every_row_of_the_table_can_be_reached():
    assert all(quirks_of(f"{start}x") is quirks for start, quirks in MODELS.items())
    assert quirks_of("gpt-4o") is UNKNOWN


def read(*events):
    parse = EventParser()
    return [parse(json.dumps(event)) for event in events]


def test_usage_counts_what_was_read_from_and_written_to_the_cache():
    chunks = read(started(5, read=700), BLOCK, PING, thought("hm"), said("4"), ended("stop_sequence", 3), STOP)
    assert [chunk.text for chunk in chunks[:-1]] == ["", "", "", "", "4", ""]
    assert chunks[0].usage == Usage(705, 700, 1)
    assert chunks[-2].usage == Usage(705, 700, 3)
    assert chunks[-2].finish_reason == "stop"
    assert chunks[-1] is None
    assert read(started(5, written=700))[0].usage == Usage(705, 0, 1)


def test_totals_at_the_end_replace_those_at_the_start():
    end = ended("max_tokens", 8)
    end["usage"] |= {"input_tokens": 6, "cache_read_input_tokens": 700, "cache_creation_input_tokens": 10}
    assert read(started(5, read=700), end)[-1].usage == Usage(716, 700, 8)


def test_events_and_fields_that_the_api_may_add_are_passed_over():
    assert [chunk.text for chunk in read({"type": "new", "delta": {"type": "x", "text": "y"}}, PING)] == ["", ""]


@pytest.mark.parametrize(
    ("kind", "retryable"), [("overloaded_error", True), ("api_error", True), ("invalid_request_error", False)]
)
def test_an_error_within_the_stream_knows_whether_it_may_pass(kind, retryable):
    with pytest.raises(ModelResponseError, match="the reply broke off: Overloaded") as caught:
        read(failed(kind, "Overloaded"))
    assert caught.value.retryable == retryable


@pytest.mark.parametrize("data", ["garbage", "[]", "{}", '{"type": "message_delta", "usage": 3}'])
def test_an_event_in_another_format_is_an_error(data):
    with pytest.raises(ModelResponseError, match="not in Anthropic's format"):
        EventParser()(data)
