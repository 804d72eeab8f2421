"""The embedded model's own promises: one start for all, an event loop that goes on, warm prefixes, a clean end."""

import asyncio
import os
import socket
import time
from contextlib import asynccontextmanager
from dataclasses import replace

import httpx
import pytest

from app.llm.base import ModelProfile, ModelResponseError, ModelUnavailableError, Reading, complete
from app.llm.llama.embedded import EmbeddedModel
from app.llm.llama.process import LlamaOptions, LlamaProcess
from app.llm.llama.weights import trimmed_gemma
from app.llm.llm_settings import LlmSettings
from app.llm.openai_compatible import OWN_LLAMA_CPP, OpenAiCompatibleModel
from app.pipeline.prompt import Prompt
from tests.llm.processes import child_pids
from tests.llm.texts import ENDLESS, asking, object_frame_prompt

pytestmark = pytest.mark.anyio

PROFILE = ModelProfile("embedded/gemma", "completion", grammar=True, representation="object_frame")
LONG_PROMPT = Prompt("", "a b c d " * 450, "")
OPTIONS = LlmSettings(embedded_threads=1, embedded_slots=2, embedded_context_tokens=512)


@asynccontextmanager
async def started(settings, profile=PROFILE):
    """A model of its own."""
    model = EmbeddedModel(profile, trimmed_gemma(settings.cache_folder), OPTIONS)
    try:
        yield model
    finally:
        await model.aclose()


async def longest_pause(while_running):
    """How long the event loop stood still at most while a coroutine ran, as a share of the time that this took."""
    begun, task, longest = time.perf_counter(), asyncio.create_task(while_running), 0.0
    while not task.done():
        before = time.perf_counter()
        await asyncio.sleep(0.005)
        longest = max(longest, time.perf_counter() - before)
    await task
    return longest / (time.perf_counter() - begun)


async def test_concurrent_first_requests_share_one_start_and_the_loop_goes_on(settings, capfd):
    others = child_pids()
    async with started(settings) as model:
        assert child_pids() == others
        request = asking(object_frame_prompt(num_demonstrations=1), max_tokens=2)
        first = asyncio.gather(model.warm_up(), *(complete(model, request) for _ in range(3)))
        assert await longest_pause(asyncio.wait_for(first, 120)) < 0.5
        assert len(child_pids() - others) == 1
    assert child_pids() == others
    assert capfd.readouterr() == ("", "")


async def test_a_chat_model_is_asked_with_a_template_and_keeps_to_the_grammar(settings):
    prompt = replace(object_frame_prompt(grammar='root ::= "none"'), system="You are a robot.")
    async with started(settings, replace(PROFILE, style="chat")) as model:
        assert (await complete(model, asking(prompt, max_tokens=8))).text == "none"


async def test_giving_up_on_the_start_does_not_stop_it_for_others(settings):
    async with started(settings) as model:
        impatient = asyncio.create_task(model.warm_up())
        patient = asyncio.create_task(model.warm_up())
        await asyncio.sleep(0.1)
        impatient.cancel()
        await patient


async def test_a_model_whose_process_died_is_started_anew(settings):
    others = child_pids()

    async with started(settings) as model:
        await model.warm_up()
        (pid,) = child_pids() - others
        pieces = model.stream(asking(object_frame_prompt(num_demonstrations=1, grammar=ENDLESS), max_tokens=400))
        await anext(pieces)
        os.kill(pid, 9)
        with pytest.raises(ModelResponseError, match="cannot be read"):
            _ = [piece async for piece in pieces]
        assert (await complete(model, asking(object_frame_prompt(), max_tokens=2))).text
        assert child_pids() - others != {pid}


async def test_closing_ends_the_process_and_refuses_what_comes_later(settings):
    others = child_pids()

    async with started(settings) as model:
        await model.warm_up()
        assert child_pids() != others
        await model.aclose()
        assert child_pids() == others
        with pytest.raises(ModelUnavailableError, match="embedded/gemma is closed"):
            await complete(model, asking(object_frame_prompt()))


async def test_closing_during_the_start_leaves_nothing(settings):
    others = child_pids()
    async with started(settings) as model:
        start = asyncio.create_task(model.warm_up())
        await asyncio.sleep(0.1)
        await model.aclose()
        await start
    assert child_pids() == others


async def test_weights_that_llama_cpp_cannot_read_are_named(tmp_path):
    path = tmp_path / "broken.gguf"
    path.write_bytes(b"GGUF" + bytes(1000))

    model = EmbeddedModel(PROFILE, lambda: path, OPTIONS)
    for _ in range(2):  # the second is a start of its own
        with pytest.raises(ModelUnavailableError, match=r"llama\.cpp cannot serve .*broken\.gguf"):
            await model.warm_up()
    await model.aclose()


def test_a_prompt_beyond_the_context_says_how_long_it_is_and_may_be(gemma, run):
    prompt = object_frame_prompt(num_demonstrations=60)
    with pytest.raises(ModelResponseError, match=r"request \(\d{4} tokens\) exceeds .* \(2048 tokens\)"):
        run(complete(gemma, asking(prompt)))


def test_an_invalid_grammar_is_an_error_and_nothing_is_printed(gemma, run, capfd):
    with pytest.raises(ModelResponseError, match="failed to parse grammar"):
        run(complete(gemma, asking(object_frame_prompt(grammar="root ::= ("))))
    assert capfd.readouterr() == ("", "")


@pytest.mark.long
def test_more_tasks_than_slots_keep_their_prefixes(gemma, run):
    """Four slots, six tasks taking turns: the second time round, no demonstration is read again."""

    async def prompt_tokens_read(task, query):
        usage = (await complete(gemma, asking(object_frame_prompt(100 + task, query), max_tokens=1))).usage
        return usage.prompt_tokens - usage.cached_tokens

    async def rounds():
        return [[await prompt_tokens_read(task, query) for task in range(6)] for query in (0, 1)]

    first, second = run(rounds())
    assert min(first) > 80
    assert max(second) < 50


@asynccontextmanager
async def client_of(llama_server):
    """A model of the server, and a function that tells how many of its slots are at work."""
    profile = ModelProfile("cancelled", "completion", grammar=True, representation="object_frame")
    key = llama_server.key
    model = OpenAiCompatibleModel(profile, llama_server, "x", OWN_LLAMA_CPP)
    url = llama_server.base_url.replace("/v1", "/slots")

    async def num_busy():
        slots = (await http.get(url)).raise_for_status().json()
        return sum(slot["is_processing"] for slot in slots)

    async with httpx.AsyncClient(headers={"Authorization": f"Bearer {key}"}, trust_env=False) as http:
        yield model, num_busy


@pytest.mark.parametrize(
    ("request_", "other_words"),
    [
        pytest.param(asking(object_frame_prompt(grammar=ENDLESS), max_tokens=1500), "e f g h ", id="writing"),
        pytest.param(asking(LONG_PROMPT), "i j k l ", id="reading", marks=pytest.mark.long),
    ],
)
async def test_a_cancelled_request_stops_llama_cpp(llama_server, request_, other_words):
    """1500 tokens take 30 s to write, LONG_PROMPT takes 7 s to read; a piece of it takes half a second.

    How fast a machine is at the time shows in how long it reads a third as much as LONG_PROMPT.
    """

    async with client_of(llama_server) as (model, num_busy):
        began = time.monotonic()
        await complete(model, asking(Prompt("", other_words * 150, ""), max_tokens=1))
        third_s = time.monotonic() - began
        answer = asyncio.create_task(complete(model, request_))
        while not await num_busy():
            await asyncio.sleep(0.02)
        answer.cancel()
        cancelled = time.monotonic()
        while await num_busy():
            await asyncio.sleep(0.02)
        assert (time.monotonic() - cancelled) / third_s < 2


def test_the_server_ends_with_its_parents_input(settings):
    path = trimmed_gemma(settings.cache_folder)()
    process = LlamaProcess(LlamaOptions(str(path), slots=1, context_tokens=512, threads=1))
    host, port = process.server.base_url.removeprefix("http://").removesuffix("/v1").split(":")
    assert process.running
    started = time.monotonic()
    process.stop()
    assert time.monotonic() - started < 2
    assert not process.running
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, int(port)))


def test_progress_of_reading_the_prompt_is_reported(gemma, run):
    async def readings():
        pieces = [piece async for piece in gemma.stream(asking(Prompt("", "a b c d " * 100, ""), max_tokens=1))]
        return [piece for piece in pieces if isinstance(piece, Reading)]

    read = run(readings())
    assert {item.of for item in read} == {read[-1].tokens}
    assert [item.tokens for item in read] == sorted({item.tokens for item in read})
    assert len(read) > 1
