"""The embedded model's own promises: one start for all, an event loop that goes on, warm prefixes, a clean end."""

import asyncio
import os
import socket
import time
from contextlib import asynccontextmanager

import httpx
import pytest

from app.llm.base import LanguageModelError, ModelProfile, ModelResponseError, ModelUnavailableError
from app.llm.embedded import EmbeddedModel, EmbeddedOptions
from app.llm.llama_process import LlamaOptions, LlamaProcess
from app.llm.weights import find_weights
from tests.llm.texts import asking, object_frame_prompt

PROFILE = ModelProfile("embedded/gemma", "completion", grammar=True, representation="object_frame")
OPTIONS = EmbeddedOptions(threads=1, slots=2, context_tokens=512)


@asynccontextmanager
async def started(settings):
    """A model of its own, and the processes that it starts."""
    model = EmbeddedModel(PROFILE, find_weights("gemma-3-270m", settings), OPTIONS)
    try:
        yield model
    finally:
        await model.aclose()


def child_pids():
    """The llama.cpp processes that this one has started."""
    pids = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/stat") as stat, open(f"/proc/{pid}/cmdline") as command:
                fields = stat.read().rpartition(")")[2].split()
                if int(fields[1]) == os.getpid() and fields[0] != "Z" and "llama_child" in command.read():
                    pids.append(int(pid))
        except OSError:
            continue
    return set(pids)


async def longest_pause_s(while_running):
    """How long the event loop stood still at most while a coroutine ran."""
    task, longest = asyncio.create_task(while_running), 0.0
    while not task.done():
        before = time.perf_counter()
        await asyncio.sleep(0.005)
        longest = max(longest, time.perf_counter() - before)
    await task
    return longest


def test_concurrent_first_requests_share_one_start_and_the_loop_goes_on(settings, capfd):
    others = child_pids()

    async def run():
        async with started(settings) as model:
            assert child_pids() == others
            request = asking(object_frame_prompt(num_demonstrations=1), max_tokens=2)
            pause_s = await longest_pause_s(
                asyncio.wait_for(asyncio.gather(model.warm_up(), *(model.complete(request) for _ in range(3))), 120)
            )
            assert len(child_pids() - others) == 1
            return pause_s

    assert asyncio.run(run()) < 0.5  # the start takes 1.7 s
    assert child_pids() == others
    assert capfd.readouterr() == ("", "")


def test_giving_up_on_the_start_does_not_stop_it_for_others(settings):
    async def run():
        async with started(settings) as model:
            impatient = asyncio.create_task(model.warm_up())
            patient = asyncio.create_task(model.warm_up())
            await asyncio.sleep(0.1)
            impatient.cancel()
            await patient

    asyncio.run(run())


def test_a_model_whose_process_died_is_started_anew(settings):
    others = child_pids()

    async def run():
        async with started(settings) as model:
            await model.warm_up()
            (pid,) = child_pids() - others
            request = asking(object_frame_prompt(num_demonstrations=1, grammar=None), max_tokens=300)
            answer = asyncio.create_task(model.complete(request))
            await asyncio.sleep(0.1)
            os.kill(pid, 9)
            with pytest.raises(LanguageModelError):
                await answer
            assert (await model.complete(asking(object_frame_prompt(), max_tokens=2))).text
            assert child_pids() - others != {pid}

    asyncio.run(run())


def test_closing_ends_the_process_and_refuses_what_comes_later(settings):
    others = child_pids()

    async def run():
        async with started(settings) as model:
            await model.warm_up()
            assert child_pids() != others
            await model.aclose()
            assert child_pids() == others
            with pytest.raises(ModelUnavailableError, match="embedded/gemma is closed"):
                await model.complete(asking(object_frame_prompt()))

    asyncio.run(run())


def test_closing_during_the_start_leaves_nothing(settings):
    others = child_pids()

    async def run():
        async with started(settings) as model:
            start = asyncio.create_task(model.warm_up())
            await asyncio.sleep(0.1)
            await model.aclose()
            await start

    asyncio.run(run())
    assert child_pids() == others


def test_weights_that_llama_cpp_cannot_read_are_named(tmp_path):
    path = tmp_path / "broken.gguf"
    path.write_bytes(b"GGUF" + bytes(1000))

    async def run():
        model = EmbeddedModel(PROFILE, lambda: path, OPTIONS)
        for _ in range(2):  # the second is a start of its own
            with pytest.raises(ModelUnavailableError, match=r"llama\.cpp cannot serve .*broken\.gguf"):
                await model.warm_up()
        await model.aclose()

    asyncio.run(run())


def test_a_prompt_beyond_the_context_says_how_long_it_is_and_may_be(gemma, run):
    prompt = object_frame_prompt(num_demonstrations=60)
    with pytest.raises(ModelResponseError, match=r"request \(\d{4} tokens\) exceeds .* \(2048 tokens\)"):
        run(gemma.complete(asking(prompt)))


def test_a_grammar_that_is_none_is_an_error_and_nothing_is_printed(gemma, run, capfd):
    with pytest.raises(ModelResponseError, match="failed to parse grammar"):
        run(gemma.complete(asking(object_frame_prompt(grammar="root ::= ("))))
    assert capfd.readouterr() == ("", "")


def test_more_tasks_than_slots_keep_their_prefixes(gemma, run):
    """Four slots, six tasks taking turns: the second time round, no demonstration is read again."""

    async def prompt_tokens_read(task, query):
        usage = (await gemma.complete(asking(object_frame_prompt(100 + task, query), max_tokens=1))).usage
        return usage.prompt_tokens - usage.cached_tokens

    async def rounds():
        return [[await prompt_tokens_read(task, query) for task in range(6)] for query in (0, 1)]

    first, second = run(rounds())
    assert min(first) > 80
    assert max(second) < 50


@pytest.fixture
def slots_busy(llama_server):
    """A function that counts the slots which llama.cpp has at work."""
    headers = {"Authorization": f"Bearer {llama_server.api_key}"}
    url = llama_server.base_url.replace("/v1", "/slots")
    with httpx.Client(headers=headers, trust_env=False) as client:
        yield lambda: sum(slot["is_processing"] for slot in client.get(url).raise_for_status().json())


@pytest.mark.parametrize("text", ["a", "a b c d " * 450], ids=["writing", "reading"])
def test_a_cancelled_request_stops_llama_cpp(llama_server, slots_busy, text):
    def post():
        host, port = llama_server.base_url.removeprefix("http://").removesuffix("/v1").split(":")
        body = f'{{"prompt": "{text}", "max_tokens": 1900, "stream": true, "cache_prompt": false}}'
        head = (
            f"POST /v1/completions HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {llama_server.api_key}\r\n"
            f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        connection = socket.create_connection((host, int(port)))
        connection.sendall((head + body).encode())
        return connection

    def wait_for(num_busy, timeout_s):
        deadline = time.monotonic() + timeout_s
        while slots_busy() != num_busy:
            assert time.monotonic() < deadline, f"{slots_busy()} slots are busy, not {num_busy}"
            time.sleep(0.02)

    with post():
        wait_for(1, 10)
    started = time.monotonic()
    wait_for(0, 15)
    # 1900 tokens take 40 s to write; 1800 take 7 s to read, a piece of 128 half a second
    assert time.monotonic() - started < 6


def test_strangers_on_the_machine_are_refused(llama_server):
    answer = httpx.post(f"{llama_server.base_url}/completions", json={"prompt": "a"}, trust_env=False)
    assert answer.status_code == 401


def test_the_server_ends_with_its_parents_input(settings):
    path = find_weights("gemma-3-270m", settings)()
    process = LlamaProcess(LlamaOptions(str(path), slots=1, context_tokens=512, threads=1))
    host, port = process.base_url.removeprefix("http://").removesuffix("/v1").split(":")
    assert process.running
    started = time.monotonic()
    process.stop()
    assert time.monotonic() - started < 2
    assert not process.running
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, int(port)))
