"""The same question has one answer, to the byte: fresh or warm, alone or in a crowd.

The first question is close to a tie: of README's one demonstration the model repeats either the height above the button
or none. It is decided by differences of the size that the number of tokens computed at once makes in llama.cpp as it
comes. The probabilities show such differences even where no reply turns.
"""

import asyncio

import httpx
import pytest

from app.llm.base import complete
from app.llm.llama.embedded import EmbeddedModel
from app.llm.llama.weights import trimmed_gemma
from app.llm.llm_settings import LlmSettings
from app.pipeline.prompt import Prompt
from tests.llm.test_embedded import PROFILE
from tests.llm.texts import asking, object_frame_prompt

OPTIONS = LlmSettings(embedded_threads=1, embedded_slots=4, embedded_context_tokens=1024)
NUM_FRESH_STARTS = 3
NUM_OTHERS = 7
LONG = 12  # demonstrations, some 600 tokens
ROW = """root ::= " 1 A w: " b "; 2 A w: " b "; 3 A w: " b "\\n"
b ::= d " " d " " d " " r " " r " " r " " [01]
d ::= [+-] ([0-9] | [1-9] [0-9])
r ::= [0-9] | [1-6] [0-9] | "7" [01]
"""
PRESSED = "1 A w: +0 +0 +20 0 36 36 0; 2 A w: +0 +0 +4 0 36 36 0; 3 A w: +0 +0 +20 0 36 36 0\n"


def pressing(x, y):
    """README's example, with the button of the query at `x`, `y`."""
    prefix = f"A red button 39 69 19 36; press the red button > {PRESSED}"
    return Prompt("", prefix, f"A red button {x} {y} 19 36; press the red button >", ("\n",), ROW)


# the near tie, and a prompt long enough for what begins at 64 tokens of a batch and 512 of a context
TIE, BIG = pressing(54, 39), object_frame_prompt(num_demonstrations=LONG)


@pytest.fixture(scope="module", params=[TIE, pytest.param(BIG, marks=pytest.mark.long)], ids=["tie", "big"])
def question(request):
    return asking(request.param, timeout_s=300)


def fresh_model(settings):
    return EmbeddedModel(PROFILE, trimmed_gemma(settings.cache_folder), OPTIONS)


def fresh_answer(settings, question):
    async def scenario():
        model = fresh_model(settings)
        try:
            return (await complete(model, question)).text
        finally:
            await model.aclose()

    return asyncio.run(scenario())


async def in_turn(model, requests):
    return [(await complete(model, request)).text for request in requests]


async def at_once(model, requests):
    return [reply.text for reply in await asyncio.gather(*(complete(model, request) for request in requests))]


@pytest.fixture(scope="module")
def answer(settings, question):
    """Of the first fresh start."""
    return fresh_answer(settings, question)


@pytest.fixture(scope="module")
def model(settings, run, question):
    """One that has been asked another question of the same task."""
    made = fresh_model(settings)
    other = pressing(25, 60) if question.prompt == TIE else object_frame_prompt(0, 5, LONG)
    run(in_turn(made, [asking(other, max_tokens=1)]))
    yield made
    run(made.aclose())


def test_after_every_start(settings, question, answer):
    assert answer
    assert [fresh_answer(settings, question) for _ in range(NUM_FRESH_STARTS - 1)] == [answer] * (NUM_FRESH_STARTS - 1)


def test_asked_again_and_after_another_question_of_the_task(model, run, question, answer):
    assert run(in_turn(model, [question, question])) == [answer, answer]


def test_after_other_tasks_took_the_slots(model, run, question, answer):
    tasks = range(OPTIONS.embedded_slots + 2)
    others = [asking(object_frame_prompt(100 + task, task, 1), max_tokens=5) for task in tasks]
    run(at_once(model, others))
    assert run(in_turn(model, [question])) == [answer]


def test_beside_other_requests(model, run, question, answer):
    others = [
        asking(object_frame_prompt(200 + n, n, 2 + n % 3), max_tokens=16, timeout_s=300) for n in range(NUM_OTHERS)
    ]
    assert run(at_once(model, [*others[:2], question, *others[2:]]))[2] == answer


def next_tokens(llama_server, prompt, **options):
    """The text that follows, one token unless `options` say otherwise, and the most probable tokens after it."""
    body = {"prompt": prompt, "n_predict": 1, "temperature": 0, "n_probs": 20, **options}
    key = {"Authorization": f"Bearer {llama_server.key}"}
    url = llama_server.base_url.replace("/v1", "/completion")
    answer = httpx.post(url, json=body, headers=key, timeout=120, trust_env=False).raise_for_status().json()
    last = answer["completion_probabilities"][-1]
    return answer["content"], [(found["token"], found["logprob"]) for found in last["top_logprobs"]]


PROMPTS = pytest.mark.parametrize(
    "prompt", [TIE.user, pytest.param(BIG.user, marks=pytest.mark.long)], ids=["tie", "big"]
)


@PROMPTS
def test_probabilities_do_not_depend_on_what_was_read_before(llama_server, prompt):
    whole = next_tokens(llama_server, prompt, cache_prompt=False)
    assert len(whole[1]) == 20
    assert next_tokens(llama_server, prompt) == whole  # one token computed
    for rest in (2, 9, 70, len(prompt) - 20):  # characters, somewhat fewer tokens
        next_tokens(llama_server, prompt[:-rest], cache_prompt=False)
        assert next_tokens(llama_server, prompt) == whole


@PROMPTS
def test_probabilities_do_not_depend_on_whether_the_text_was_written_or_read(llama_server, prompt):
    written, _ = next_tokens(llama_server, prompt, n_predict=12)
    after_writing = next_tokens(llama_server, prompt + written)
    assert next_tokens(llama_server, prompt + written, cache_prompt=False) == after_writing
