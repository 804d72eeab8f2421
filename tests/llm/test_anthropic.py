"""The client against llama.cpp's own Messages API, and against a server that answers badly."""

import asyncio
import json
from contextlib import aclosing

import pytest

from app.llm.base import (
    Completion,
    ModelBusyError,
    ModelResponseError,
    ModelTimeoutError,
    ModelUnavailableError,
    TextDelta,
    Usage,
    complete,
)
from app.pipeline.prompt import Prompt
from tests.llm.claude import BLOCK, KEY, PING, STOP, claude_at, ended, failed, said, started, thought
from tests.llm.loopback import after, loopback, status, streamed
from tests.llm.texts import absolute_prompt, as_asked, asking

PROMPT = Prompt("Be brief.", "a>1, ", "b>", stop=("\n",))


@pytest.fixture(scope="module")
def claude(llama_server, run):
    model = claude_at(llama_server.base_url, "claude-haiku-4-5", llama_server.key)
    yield model
    run(model.aclose())


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


def test_llama_cpp_refuses_another_key(llama_server, run):
    with pytest.raises(ModelUnavailableError, match="set ROBOPROMPT_ANTHROPIC_API_KEY to a valid key") as caught:
        run(complete(claude_at(llama_server.base_url), asking(PROMPT)))
    assert KEY not in str(caught.value)


def ask(answer, **options):
    """The completion of one request, and the server that was asked."""

    async def run():
        async with loopback(answer) as (base_url, server):
            model = as_asked(claude_at(base_url))
            try:
                return await complete(model, asking(PROMPT, **options)), server
            finally:
                await model.aclose()

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


def test_a_late_first_byte_meets_the_deadline():
    with pytest.raises(ModelTimeoutError, match=r"within 0\.1 s"):
        ask(after(30, streamed(started())), timeout_s=0.1)
