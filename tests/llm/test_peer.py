"""The embedded llama.cpp as a server of its own, asked as any lab's: `openai_compatible`, chat and completion."""

import json

import pytest

from app.llm.backends import BUILT_IN
from app.llm.base import Completion, Reading, TextDelta, complete
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry
from app.pipeline.prompt import Prompt
from app.pipeline.representation.absolute import Column, list_schema
from tests.llm.texts import REPLY, asking, object_frame_prompt

NAME = "openai_compatible/gemma"


@pytest.fixture(scope="module")
def peer(llama_server, run):
    """A registry whose compatible server is the llama.cpp, by style of asking."""
    made = []

    def registry(style, server="llama_cpp"):
        settings = LlmSettings(
            compatible_base_url=llama_server.base_url,
            compatible_api_key=llama_server.key,
            compatible_style=style,
            compatible_server=server,
        )
        made.append(ModelRegistry(settings, BUILT_IN))
        return made[-1]

    yield registry
    for item in made:
        run(item.aclose())


def test_completion_within_the_grammar_streamed_and_cached(peer, run):
    model = peer("completion").get(NAME)
    assert (model.profile.representation, model.profile.grammar) == ("object_frame", True)

    async def ask(query_seed):
        return [piece async for piece in model.stream(asking(object_frame_prompt(query_seed=query_seed)))]

    *deltas, completion = run(ask(1))
    assert isinstance(completion, Completion)
    assert all(isinstance(delta, TextDelta | Reading) for delta in deltas)
    assert len(deltas) > 3
    assert completion.text.rstrip() == REPLY
    usage = run(ask(2))[-1].usage
    assert usage.cached_tokens > 0.5 * usage.prompt_tokens


def test_chat(peer, run):
    model = peer("chat").get(NAME)
    assert (model.profile.representation, model.profile.system_prompt) == ("absolute", "a")
    completion = run(complete(model, asking(object_frame_prompt(), max_tokens=60)))
    assert completion.text.rstrip() == completion.text.rstrip().splitlines()[0]
    assert completion.text.startswith((" 1 red cube w: ", " 1 blue cube w: "))
    assert completion.usage.completion_tokens > 5


def test_chat_within_a_schema(peer, run):
    """llama.cpp takes `response_format` just as Ollama does."""
    schema = list_schema([Column("number", 3, 9)] * 4, fewest=2, most=3)
    prompt = Prompt("", "", "Tell me about lists in Python.", (), None, schema)
    text = run(complete(peer("chat", "ollama").get(NAME), asking(prompt))).text
    rows = json.loads(text)
    assert 2 <= len(rows) <= 3, text
    assert all(len(row) == 4 and all(3 <= number <= 9 for number in row) for row in rows), text
