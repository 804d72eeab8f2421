"""Claude's Messages API: what is sent and read, llama.cpp's own server of it, and a server that answers badly.

Events are what Anthropic's servers send, as its documentation ("Streaming Messages") shows it.
"""

import asyncio
import json
from contextlib import aclosing

import pytest

from app.llm.anthropic import MODELS, UNKNOWN, AnthropicModel, EventParser, quirks_of, request_body, request_headers
from app.llm.base import Completion, ModelBusyError, ModelProfile, ModelResponseError, TextDelta, Usage, complete
from app.llm.sse import THINKING_TOKENS, Server
from app.pipeline.prompt import Prompt
from tests.llm.loopback import loopback, status, streamed
from tests.llm.texts import absolute_prompt, as_asked, asking

KEY = "sk-ant-very-secret"


def claude_at(base_url, model="claude-haiku-5-5", key=KEY):
    profile = ModelProfile(f"anthropic/{model}", "chat", grammar=False, representation="absolute")
    server = Server(base_url, key, "ROBOPROMPT_ANTHROPIC_API_KEY", "ROBOPROMPT_ANTHROPIC_BASE_URL")
    return AnthropicModel(profile, server, model)


def started(input_tokens=25, read=0, written=0):
    usage = {"input_tokens": input_tokens, "output_tokens": 1}
    usage |= {"cache_read_input_tokens": read, "cache_creation_input_tokens": written}
    message = {"id": "msg_1", "type": "message", "role": "assistant", "content": [], "model": "claude", "usage": usage}
    return {"type": "message_start", "message": message | {"stop_reason": None, "stop_sequence": None}}


def said(text, index=0):
    return {"type": "content_block_delta", "index": index, "delta": {"type": "text_delta", "text": text}}


def thought(text):
    return {"type": "content_block_delta", "index": 0, "delta": {"type": "thinking_delta", "thinking": text}}


def ended(stop_reason="end_turn", output_tokens=15):
    delta = {"stop_reason": stop_reason, "stop_sequence": None}
    return {"type": "message_delta", "delta": delta, "usage": {"output_tokens": output_tokens}}


BLOCK = {"type": "content_block_start", "index": 0, "content_block": {"type": "text", "text": ""}}
PING = {"type": "ping"}
STOP = {"type": "message_stop"}


def failed(kind, message):
    return {"type": "error", "error": {"type": kind, "message": message}}


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
def test_a_model_that_thinks_has_room_for_it_and_no_stop_string_that_would_end_it(model, room):
    body = body_for(model, max_tokens=9)
    assert body["max_tokens"] == 9 + (THINKING_TOKENS if room else 0)
    assert ("stop_sequences" in body) == (not room)


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


@pytest.fixture(scope="module")
def claude(llama_server):
    return claude_at(llama_server.base_url, "claude-haiku-4-5", llama_server.key)


def test_llama_cpp_understands_and_is_understood(claude, run):
    async def pieces():
        async with aclosing(claude.stream(asking(absolute_prompt(), max_tokens=6))) as arriving:
            return [piece async for piece in arriving]

    *deltas, completion = run(pieces())
    assert all(isinstance(piece, TextDelta) for piece in deltas)
    assert "".join(piece.text for piece in deltas) == completion.text != ""
    assert completion.finish_reason == "length"
    assert completion.usage.completion_tokens == 6
    assert completion.usage.prompt_tokens > 300


def test_llama_cpp_reads_a_repeated_prefix_from_its_cache(claude, run):
    _, again = (run(complete(claude, asking(absolute_prompt(5), max_tokens=1))).usage for _ in range(2))
    assert again.cached_tokens >= again.prompt_tokens - 2 > 250


def ask(answer, **options):
    """The completion of one request, and the server that was asked."""

    async def run():
        async with loopback(answer) as (base_url, server):
            return await complete(as_asked(claude_at(base_url)), asking(PROMPT, **options)), server

    return asyncio.run(run())


def test_a_question_and_its_reply():
    events = [started(5, read=700), PING, BLOCK, thought("hm"), said("4"), said("2", 1), ended("end_turn", 9), STOP]
    completion, server = ask(streamed(*events))
    assert completion == Completion("42", Usage(705, 700, 9), "stop")
    head, body = server.requests[0]
    assert head.startswith("POST /v1/messages ")
    assert f"x-api-key: {KEY}" in head
    assert "anthropic-version: 2026-10-21" in head
    assert body["model"] == "claude-haiku-5-5"


def test_the_reply_ends_at_a_stop_string_that_the_api_does_not_take():
    completion, _ = ask(streamed(started(), said("4"), said("2\nand"), said(" more"), ended("max_tokens"), STOP))
    assert completion == Completion("42", Usage(25, 0, 15), "stop")


@pytest.mark.parametrize("reason", ["max_tokens", "model_context_window_exceeded"])
def test_a_truncated_reply_has_the_finish_reason_length(reason):
    assert ask(streamed(started(), said("4"), ended(reason), STOP))[0].finish_reason == "length"


@pytest.mark.parametrize(
    ("answer", "error_type", "message", "retryable"),
    [
        (streamed(started(), said("4"), ended("refusal"), STOP), ModelResponseError, "'refusal'", False),
        (
            streamed(started(), said("4"), failed("overloaded_error", "Overloaded")),
            ModelResponseError,
            "broke off",
            True,
        ),
        (streamed(started(), said("4")), ModelResponseError, "ended before it was complete", True),
        (streamed("garbage"), ModelResponseError, "not in Anthropic's format", False),
        (status(400, b'{"error": {"message": "bad"}}'), ModelResponseError, "HTTP 400: bad", False),
        (status(429, Retry_After="3"), ModelBusyError, "HTTP 429", True),
        (status(529, json.dumps(failed("overloaded_error", "Full")).encode()), ModelResponseError, "529: Full", True),
    ],
)
def test_what_goes_wrong_is_named(answer, error_type, message, retryable):
    with pytest.raises(error_type, match=message) as caught:
        ask(answer)
    assert caught.value.retryable == retryable
    assert KEY not in str(caught.value)
