"""What every backend promises, held against each that can run here."""

import asyncio
import json
import re
from contextlib import aclosing

import pytest

from app.llm.base import (
    Completion,
    ModelProfile,
    ModelResponseError,
    ModelTimeoutError,
    Reading,
    TextDelta,
    complete,
)
from app.llm.computed import ScriptedModel, nearest, regression
from app.llm.openai_compatible import OWN_LLAMA_CPP, SERVERS, OpenAiCompatibleModel
from app.pipeline.prompt import Prompt
from app.pipeline.representation.absolute import Column, list_schema
from tests.llm.texts import ENDLESS, REPLY, absolute_prompt, as_asked, asking, object_frame_prompt

LLMS = ("embedded", "completion", "chat")


@pytest.fixture(scope="session")
def models(gemma, llama_server):
    profiles = {style: ModelProfile(style, style, grammar=True, representation="object_frame") for style in LLMS[1:]}
    made = {
        style: OpenAiCompatibleModel(profile, llama_server, "gemma", OWN_LLAMA_CPP)
        for style, profile in profiles.items()
    }
    made |= {
        "embedded": gemma,
        "nearest": nearest(),
        "regression": regression(),
        "scripted": ScriptedModel([REPLY + "\nand more"]),
    }
    return {name: as_asked(model) for name, model in made.items()}


# `completion` and `chat` are one client that asks llama.cpp in two ways: most of what they promise, one of them shows.
BY_MAKE_LONG = [pytest.param("completion", marks=pytest.mark.long)]


@pytest.fixture(params=["embedded", *BY_MAKE_LONG, "chat", "nearest", "regression", "scripted"])
def model(request, models):
    return models[request.param]


async def pieces_of(model, request):
    async with aclosing(model.stream(request)) as pieces:
        return [piece async for piece in pieces]


def test_pieces_joined_are_the_completion(model, run):
    pieces = run(pieces_of(model, asking(object_frame_prompt())))
    *deltas, completion = [piece for piece in pieces if not isinstance(piece, Reading)]
    assert all(isinstance(piece, TextDelta) for piece in deltas)
    assert len(deltas) > 5
    assert isinstance(completion, Completion)
    assert "".join(piece.text for piece in deltas) == completion.text
    assert run(complete(model, asking(object_frame_prompt()))).text == completion.text


def test_the_reply_is_the_pattern_up_to_the_stop_string_and_usage_counts(model, run):
    completion = run(complete(model, asking(object_frame_prompt(query_seed=1))))
    assert completion.finish_reason == "stop"
    assert re.fullmatch(r" 1 (red|blue) cube w: \+0 \+0 \+20 0 36 36 1", completion.text)
    usage = completion.usage
    assert 50 < usage.prompt_tokens < 300
    assert 9 < usage.completion_tokens < 60
    assert 0 <= usage.cached_tokens < usage.prompt_tokens


def test_max_tokens_cuts_the_reply(model, run):
    completion = run(complete(model, asking(object_frame_prompt(), max_tokens=3)))
    assert completion.finish_reason == "length"
    assert completion.usage.completion_tokens == 3
    assert len(completion.text) < len(REPLY)


def test_concurrent_requests_are_all_answered(model, run):
    async def ask_all():
        requests = [asking(object_frame_prompt(query_seed=query)) for query in range(3)]
        return await asyncio.gather(*(complete(model, request) for request in requests))

    assert [completion.finish_reason for completion in run(ask_all())] == ["stop"] * 3


@pytest.mark.parametrize("backend", LLMS)
def test_a_repeated_prefix_is_not_read_again(backend, models, run):
    seed = 1 + LLMS.index(backend)
    first, second = (
        run(complete(models[backend], asking(object_frame_prompt(seed, query), max_tokens=2))).usage for query in (3, 4)
    )
    assert first.prompt_tokens - first.cached_tokens > 70
    assert second.prompt_tokens - second.cached_tokens < 60


@pytest.mark.parametrize("backend", [*LLMS, "scripted"])
def test_a_late_reply_is_a_timeout(backend, models, run):
    model = as_asked(ScriptedModel(["a " * 100], delay_s=0.1)) if backend == "scripted" else models[backend]
    run(complete(model, asking(object_frame_prompt(), max_tokens=1)))  # started
    endless = asking(object_frame_prompt(grammar=ENDLESS), max_tokens=1500, timeout_s=0.4)
    with pytest.raises(ModelTimeoutError, match=r"did not answer within 0\.4 s"):
        run(complete(model, endless))


def test_the_papers_format_is_answered(model, run):
    assert run(complete(model, asking(absolute_prompt(), max_tokens=5))).text


class Cut(ScriptedModel):
    async def stream(self, request):
        yield TextDelta("4")


def test_a_reply_without_an_end_is_an_error(run):
    with pytest.raises(ModelResponseError, match="before it was complete"):
        run(complete(as_asked(Cut(["4"])), asking(absolute_prompt())))
    with pytest.raises(ModelResponseError, match="before it was complete"):
        run(pieces_of(as_asked(Cut(["4"])), asking(absolute_prompt())))


def test_a_chat_reply_keeps_to_a_schema(llama_server, run):
    """llama.cpp takes `response_format` just as Ollama does."""
    profile = ModelProfile("chat", "chat", grammar=False, representation="absolute")
    schema = list_schema([Column("number", 3, 9)] * 4, fewest=2, most=3)
    prompt = Prompt("", "", "Tell me about lists in Python.", (), None, schema)
    model = OpenAiCompatibleModel(profile, llama_server, "gemma", SERVERS["ollama"])
    text = run(complete(model, asking(prompt))).text
    rows = json.loads(text)
    assert 2 <= len(rows) <= 3, text
    assert all(len(row) == 4 and all(3 <= number <= 9 for number in row) for row in rows), text
