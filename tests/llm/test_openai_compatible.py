"""The client against a server that answers badly in every way."""

import asyncio
import json
import time

import httpx
import pytest

from app.llm import sse
from app.llm.base import (
    Completion,
    LanguageModelError,
    ModelBusyError,
    ModelProfile,
    ModelResponseError,
    ModelTimeoutError,
    ModelUnavailableError,
    Usage,
    complete,
)
from app.llm.openai_compatible import LLAMA_CPP, OpenAiCompatibleModel
from app.llm.sse import MAX_WIRE_BYTES, Server
from app.llm.streaming import MAX_REPLY_CHARACTERS
from app.pipeline.prompt import Prompt
from tests.llm.loopback import SSE_HEAD, chunk, delta, event, hang_up, loopback, status, streamed, text, usage
from tests.llm.texts import as_asked, asking

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
            model = model_at(base_url, style, quirks)
            try:
                return await complete(model, asking(PROMPT, **options)), server
            finally:
                await model.aclose()

    return asyncio.run(run())


def failure(answer, error_type, **options):
    with pytest.raises(error_type) as caught:
        ask(answer, **options)
    assert KEY not in str(caught.value)
    return str(caught.value)


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
        "stop": ["\n"],
        "stream": True,
        "stream_options": {"include_usage": True},
    }


def test_completion_sends_raw_text():
    completion, server = ask(streamed(text("4"), text("2", "length"), "[DONE]"))
    assert completion == Completion("42", Usage(), "length")
    head, body = server.requests[0]
    assert head.startswith("POST /v1/completions")
    assert body["prompt"] == "Be brief.\na>1, b>"


def test_llama_cpp_gets_the_grammar_and_keeps_the_prompt():
    _, server = ask(streamed(text("1", "stop")), quirks=LLAMA_CPP)
    assert server.requests[0][1]["grammar"] == 'root ::= "1"'
    assert server.requests[0][1]["cache_prompt"] is True


def test_the_reply_ends_at_a_stop_string_that_the_server_ignores():
    completion, _ = ask(streamed(text("4"), text("2\nand"), text(" more", "length")))
    assert completion == Completion("42", Usage(), "stop")


@pytest.mark.parametrize("code", [401, 403])
def test_a_refused_key_says_which_variable_to_set(code):
    body = json.dumps({"error": {"message": f"Incorrect API key provided: {KEY}"}}).encode()
    message = failure(status(code, body), ModelUnavailableError)
    assert "Incorrect API key provided: [key]" in message
    assert "set ROBOPROMPT_SOME_KEY" in message


def test_an_unknown_model_is_named_with_the_url():
    message = failure(status(404, b'{"error": "model little not found"}'), ModelUnavailableError)
    assert message.startswith("there is no some/completion (http://127.0.0.1:")
    assert "model little not found" in message


@pytest.mark.parametrize(
    ("code", "body", "said"),
    [
        (500, b"<html>\n  oh no</html>", "HTTP 500: <html> oh no</html>"),
        (
            500,
            b'{"error": {"message": "half a pair: \\ud800"}}',
            'HTTP 500: {"error": {"message": "half a pair: \\ud800"}}',
        ),
        (503, b"", "HTTP 503: no message"),
        (302, b"", "HTTP 302"),
    ],
)
def test_a_bad_status_carries_the_servers_message(code, body, said):
    assert said in failure(status(code, body), ModelResponseError)


@pytest.mark.parametrize(
    ("headers", "wait_s"),
    [
        ({"Retry_After": "7"}, 7.0),
        ({"Retry_After": "0.25"}, 0.25),
        ({"Retry_After": "Wed, 21 Oct 2015 07:28:00 GMT"}, 0.0),
        ({"Retry_After": "Wed, 21 Oct 2015 07:28:00 -0000"}, 0.0),
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


@pytest.mark.parametrize(
    ("answer", "retryable"),
    [
        (status(500), True),
        (status(503, Retry_After="2"), True),
        (status(529), True),
        (status(408), True),
        (status(400), False),
        (status(401), False),
        (status(404), False),
        (status(200, b'{"choices": []}'), False),
        (hang_up, True),
        (streamed("garbage"), False),
        (streamed(text("4", "content_filter")), False),
        (streamed(end=b"400\r\ndata: {"), True),
        (streamed(), True),
    ],
)
def test_an_error_knows_whether_asking_again_may_help(answer, retryable):
    with pytest.raises(LanguageModelError) as caught:
        ask(answer)
    assert caught.value.retryable == retryable


def test_a_key_with_a_stray_line_break_is_not_shown():
    async def run():
        async with loopback(streamed(text("4", "stop"))) as (base_url, _):
            profile = ModelProfile("some/model", "chat", grammar=False, representation="absolute")
            await complete(OpenAiCompatibleModel(profile, Server(base_url, f"{KEY}\n"), "little"), asking(PROMPT))

    with pytest.raises(ModelResponseError, match=r"Illegal header value .*\[key\]") as caught:
        asyncio.run(run())
    assert KEY not in str(caught.value)


def test_a_server_that_does_not_stream_is_an_error():
    assert "Content-Type" in failure(status(200, b'{"choices": []}'), ModelResponseError)


@pytest.mark.parametrize("data", ["garbage", "[]", '{"choices": 3}', '{"choices": [{"text": 5}]}'])
def test_an_event_in_another_format_is_an_error(data):
    assert "not in OpenAI's format" in failure(streamed(data), ModelResponseError)


def test_an_error_within_the_stream_is_an_error():
    answer = streamed(text("4"), {"error": {"message": f"out of memory {KEY}"}})
    assert "the reply broke off: out of memory [key]" in failure(answer, ModelResponseError)


@pytest.mark.parametrize("reason", ["content_filter", "tool_calls"])
def test_a_withheld_reply_is_an_error(reason):
    assert repr(reason) in failure(streamed(text("4", reason)), ModelResponseError)


def test_a_stream_cut_within_a_chunk_is_an_error():
    answer = streamed(text("4"), end=b"400\r\ndata: {")
    assert "cannot be read" in failure(answer, ModelResponseError)


def test_a_stream_that_ends_early_is_an_error():
    assert "ended before it was complete" in failure(streamed(text("4")), ModelResponseError)


def test_a_slow_drip_meets_the_deadline_and_the_server_is_left():
    async def run():
        async with loopback(streamed(*[text("a")] * 100, delay_s=0.05)) as (base_url, server):
            model = as_asked(model_at(base_url))
            started = time.perf_counter()
            with pytest.raises(ModelTimeoutError, match=r"within 0\.3 s"):
                await complete(model, asking(PROMPT, timeout_s=0.3))
            assert 0.2 < time.perf_counter() - started < 2
            await asyncio.wait_for(server.gone.wait(), 2)
            await model.aclose()

    asyncio.run(run())


def test_a_cancelled_request_leaves_the_server():
    async def run():
        async with loopback(streamed(text("a"), delay_s=30)) as (base_url, server):
            model = model_at(base_url)
            task = asyncio.create_task(complete(model, asking(PROMPT)))
            while not server.requests:
                await asyncio.sleep(0.01)
            task.cancel()
            await asyncio.wait_for(server.gone.wait(), 2)
            await model.aclose()

    asyncio.run(run())


def test_an_abandoned_stream_leaves_the_server():
    async def run():
        async with loopback(streamed(text("a"), text("b"), delay_s=30)) as (base_url, server):
            model = model_at(base_url)
            pieces = model.stream(asking(PROMPT))
            await anext(pieces)
            await pieces.aclose()
            await asyncio.wait_for(server.gone.wait(), 2)
            await model.aclose()

    asyncio.run(run())


def test_a_long_reply_is_an_error():
    piece = "a" * (MAX_REPLY_CHARACTERS // 4)
    assert "replied with more than" in failure(streamed(*[text(piece)] * 5), ModelResponseError)


async def one_endless_line(writer):
    writer.write(SSE_HEAD + chunk(b"data: "))
    for _ in range(10):
        writer.write(chunk(b"a" * 2**20))
        await writer.drain()


@pytest.mark.parametrize(
    "answer", [one_endless_line, status(500, b"a" * 10 * 2**20)], ids=["one line of 10 MB", "an error of 10 MB"]
)
def test_no_more_is_read_than_a_reply_can_need(answer):
    assert f"more than {MAX_WIRE_BYTES} bytes" in failure(answer, ModelResponseError)


@pytest.mark.parametrize(
    "base_url", ["http://127.0.0.1:9/v1", "http://user:password@127.0.0.1:9/v1", "ftp://127.0.0.1/v1", "nonsense"]
)
def test_an_unreachable_server_names_the_url_and_the_variable(base_url):
    async def run():
        model = model_at(base_url)
        try:
            await complete(model, asking(PROMPT))
        finally:
            await model.aclose()

    with pytest.raises(ModelUnavailableError, match=r"cannot reach some/completion .*ROBOPROMPT_SOME_URL") as caught:
        asyncio.run(run())
    assert "password" not in str(caught.value)


def test_a_connection_that_breaks_as_soon_as_it_is_made_may_be_tried_again(monkeypatch):
    """As httpcore has it with uvloop when the server is killed at this moment."""

    async def broken(transport, request):
        raise AttributeError("'NoneType' object has no attribute 'getpeername'")

    monkeypatch.setattr(httpx.AsyncHTTPTransport, "handle_async_request", broken)
    with pytest.raises(ModelUnavailableError, match="broke as soon as it was made") as caught:
        ask(streamed(text("4"), "[DONE]"))
    assert caught.value.retryable


def test_text_in_many_events_of_one_packet_arrives_in_pieces():
    async def answer(writer):
        writer.write(SSE_HEAD + event(text("4")) + event(text("2", "stop")) + chunk(b""))
        await writer.drain()

    assert ask(answer)[0].text == "42"


@pytest.mark.parametrize(("num_kept", "num_connections"), [(20, 1), (0, 4)])
@pytest.mark.parametrize("delay_s", [0.0, 0.01])
def test_a_kept_connection_serves_one_request_after_the_other(monkeypatch, num_kept, num_connections, delay_s):
    """As over TLS, where a handshake takes longer than all else that is not the model's."""
    monkeypatch.setitem(sse.KEPT_CONNECTIONS, "http", num_kept)
    answer = streamed(text("4"), text("2", "stop"), "[DONE]", delay_s=delay_s)

    async def run():
        async with loopback(answer, keep_alive=True) as (base_url, server):
            model = model_at(base_url)
            replies = [(await complete(model, asking(PROMPT))).text for _ in range(4)]
            await model.aclose()
            return replies, server.num_connections

    assert asyncio.run(run()) == (["42"] * 4, num_connections)


def test_a_server_that_does_not_end_its_message_does_not_hold_up_the_reply(monkeypatch):
    monkeypatch.setitem(sse.KEPT_CONNECTIONS, "http", 20)

    async def never_ending(writer):
        await streamed(text("42", "stop"), "[DONE]", end=b"")(writer)
        await asyncio.sleep(30)

    started = time.perf_counter()
    assert ask(never_ending)[0].text == "42"
    assert time.perf_counter() - started < 5
