"""The client against a server that answers badly in every way."""

import asyncio
import json
import re

import httpx
import pytest

from app.llm.base import (
    Completion,
    ModelBusyError,
    ModelProfile,
    ModelResponseError,
    ModelUnavailableError,
    Usage,
    complete,
)
from app.llm.openai_compatible import OpenAiCompatibleModel
from app.llm.sse import Server
from app.llm.streaming import MAX_REPLY_CHARACTERS
from app.pipeline.prompt import Prompt
from tests.llm.loopback import delta, hang_up, loopback, status, streamed, text, usage
from tests.llm.texts import asking

pytestmark = pytest.mark.anyio

KEY = "sk-very-secret"
PROMPT = Prompt("Be brief.", "a>1, ", "b>", stop=("\n",), grammar='root ::= "1"')


def model_at(base_url, style="completion", quirks=None):
    profile = ModelProfile(f"some/{style}", style, grammar=False, representation="absolute")
    server = Server(base_url, KEY, "ROBOPROMPT_SOME_KEY", "ROBOPROMPT_SOME_URL")
    return OpenAiCompatibleModel(profile, server, "little", quirks)


def ask(answer, style="completion", quirks=None, **options):
    """The completion of one request, and the server that was asked."""

    async def run():
        async with loopback(answer) as (base_url, server):
            return await complete(model_at(base_url, style, quirks), asking(PROMPT, **options)), server

    return asyncio.run(run())


def test_chat_sends_messages_and_reads_deltas():
    answer = streamed(delta(""), delta("4"), delta("2", None), delta(None, "stop"), usage(20, 16, 2), "[DONE]")
    completion, server = ask(answer, style="chat", max_tokens=7, seed=3)
    assert completion == Completion("42", Usage(20, 16, 2), "stop")
    head, body = server.requests[0]
    assert head.startswith("POST /v1/chat/completions")
    assert f"Authorization: Bearer {KEY}" in head
    assert body == {
        "model": "little",
        "messages": [{"role": "system", "content": "Be brief."}, {"role": "user", "content": "a>1, b>"}],
        "max_tokens": 7,
        "temperature": 0.0,
        "seed": 3,
        "stream": True,
        "stream_options": {"include_usage": True},
    }


def test_completion_sends_raw_text():
    completion, server = ask(streamed(text("4"), text("2", "length"), "[DONE]"))
    assert completion == Completion("42", Usage(), "length")
    head, body = server.requests[0]
    assert head.startswith("POST /v1/completions")
    assert body["prompt"] == "Be brief.\na>1, b>"


def test_the_reply_ends_at_a_stop_string_that_the_server_ignores():
    completion, _ = ask(streamed(text("4"), text("2\nand"), text(" more", "length")))
    assert completion == Completion("42", Usage(), "stop")


def refusal(message):
    return json.dumps({"error": {"message": message}}).encode()


NO_EVENT, EARLY = "not in OpenAI's format", "ended before it was complete"


@pytest.mark.parametrize(
    ("answer", "error_type", "said", "retryable"),
    [
        (
            status(401, refusal(f"Bad key: {KEY}")),
            ModelUnavailableError,
            "Bad key: [key]; set ROBOPROMPT_SOME_K",
            False,
        ),
        (status(403), ModelUnavailableError, "set ROBOPROMPT_SOME_KEY", False),
        (status(404), ModelUnavailableError, "there is no some/completion (http://127.0.0.1:", False),
        (status(404, b'{"error": "not here"}'), ModelUnavailableError, "HTTP 404: not here", False),
        (status(500, b"<html>\n  oh no</html>"), ModelResponseError, "HTTP 500: <html> oh no</html>", True),
        (status(500, refusal("half: \ud800")), ModelResponseError, 'HTTP 500: {"error": {"message": "half: ', True),
        (status(503, Retry_After="2"), ModelResponseError, "HTTP 503: no message", True),
        (status(529), ModelResponseError, "HTTP 529", True),
        (status(408), ModelResponseError, "HTTP 408", True),
        (status(400), ModelResponseError, "HTTP 400", False),
        (status(302), ModelResponseError, "HTTP 302", False),
        (status(200, b'{"choices": []}'), ModelResponseError, "Content-Type", False),
        (hang_up, ModelResponseError, "cannot be read", True),
        *((streamed(data), ModelResponseError, NO_EVENT, False) for data in ("garbage", "[]", '{"choices": 3}')),
        (streamed('{"choices": [{"text": 5}]}'), ModelResponseError, NO_EVENT, False),
        (streamed(text("4"), {"error": {"message": f"no {KEY}"}}), ModelResponseError, "broke off: no [key]", False),
        (streamed(text("4", "content_filter")), ModelResponseError, "'content_filter'", False),
        (streamed(text("4", "tool_calls")), ModelResponseError, "'tool_calls'", False),
        (streamed(text("4"), end=b"400\r\ndata: {"), ModelResponseError, "cannot be read", True),
        (streamed(), ModelResponseError, EARLY, True),
        (streamed(text("4")), ModelResponseError, EARLY, True),
        (streamed(*[text("a" * (MAX_REPLY_CHARACTERS // 4))] * 5), ModelResponseError, "replied with more than", False),
    ],
)
def test_what_goes_wrong_is_named(answer, error_type, said, retryable):
    with pytest.raises(error_type, match=re.escape(said)) as caught:
        ask(answer)
    assert caught.value.retryable == retryable
    assert KEY not in str(caught.value)


@pytest.mark.parametrize(
    ("headers", "wait_s"),
    [
        ({"Retry_After": "7"}, 7.0),
        ({"Retry_After": "0.25"}, 0.25),
        ({"Retry_After": "-3"}, 0.0),
        ({"Retry_After": "soon"}, None),
        ({"Retry_After": "nan"}, None),
        ({}, None),
    ],
)
def test_a_server_that_wants_fewer_requests_says_when_to_come_back(headers, wait_s):
    with pytest.raises(ModelBusyError, match="HTTP 429: slow down") as caught:
        ask(status(429, b'{"error": {"message": "slow down"}}', **headers))
    assert caught.value.retryable
    assert caught.value.retry_after_s == wait_s


@pytest.mark.parametrize(
    "body",
    [
        b'{"error": {"message": "no money", "code": "insufficient_quota"}}',
        b'{"error": {"message": "no money", "details": {"error_code": "enforced_spend_limit_reached"}}}',
    ],
)
def test_an_account_that_is_used_up_is_not_asked_again(body):
    with pytest.raises(ModelUnavailableError, match="is used up: HTTP 429: no money") as caught:
        ask(status(429, body))
    assert not caught.value.retryable


def test_a_key_with_a_stray_line_break_is_not_shown():
    async def run():
        async with loopback(streamed(text("4", "stop"))) as (base_url, _):
            profile = ModelProfile("some/model", "chat", grammar=False, representation="absolute")
            await complete(OpenAiCompatibleModel(profile, Server(base_url, f"{KEY}\n"), "little"), asking(PROMPT))

    with pytest.raises(ModelResponseError, match=r"Illegal header value .*\[key\]") as caught:
        asyncio.run(run())
    assert KEY not in str(caught.value)


async def test_an_abandoned_stream_leaves_the_server():
    async with loopback(streamed(text("a"), text("b"), delay_s=30)) as (base_url, server):
        model = model_at(base_url)
        pieces = model.stream(asking(PROMPT))
        await anext(pieces)
        await pieces.aclose()
        await asyncio.wait_for(server.gone.wait(), 2)


@pytest.mark.parametrize(
    "base_url", ["http://127.0.0.1:9/v1", "http://user:password@127.0.0.1:9/v1", "ftp://127.0.0.1/v1", "nonsense"]
)
def test_an_unreachable_server_names_the_url_and_the_variable(base_url):
    with pytest.raises(ModelUnavailableError, match=r"cannot reach some/completion .*ROBOPROMPT_SOME_URL") as caught:
        asyncio.run(complete(model_at(base_url), asking(PROMPT)))
    assert "password" not in str(caught.value)


def test_a_connection_that_breaks_as_soon_as_it_is_made_may_be_tried_again(monkeypatch):
    """As httpcore has it with uvloop when the server is killed at this moment."""

    async def broken(transport, request):
        raise AttributeError("'NoneType' object has no attribute 'getpeername'")

    monkeypatch.setattr(httpx.AsyncHTTPTransport, "handle_async_request", broken)
    with pytest.raises(ModelUnavailableError, match="broke as soon as it was made") as caught:
        ask(streamed(text("4"), "[DONE]"))
    assert caught.value.retryable
