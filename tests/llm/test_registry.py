import asyncio
import os
import re
import signal
from pathlib import Path

import pytest

from app.llm import backends
from app.llm.backends import BUILT_IN, Backend
from app.llm.base import (
    ModelBusyError,
    ModelProfile,
    ModelResponseError,
    ModelUnavailableError,
    UnknownModelError,
    complete,
)
from app.llm.computed import SCRIPTED, ScriptedModel
from app.llm.llm_settings import LlmSettings, variable
from app.llm.registry import ModelRegistry
from tests.llm.loopback import after, loopback, status
from tests.llm.processes import child_pids
from tests.llm.texts import asking, object_frame_prompt

pytestmark = pytest.mark.anyio


@pytest.fixture
def make_registry(tmp_path):
    def make(**options):
        return ModelRegistry(LlmSettings(cache_folder=tmp_path, **options), BUILT_IN)

    return make


def test_a_model_is_made_once_and_the_default_answers_for_no_name(make_registry):
    registry = make_registry(default_model="regression")
    assert registry.get("regression") is registry.get() is registry.get("")


def test_an_unknown_backend_lists_the_models(make_registry):
    with pytest.raises(
        UnknownModelError, match=r"no model 'gpt-4o'; there are embedded/gemma-3-270m, .*, nearest, regression$"
    ):
        make_registry().get("gpt-4o")


@pytest.mark.parametrize(
    "name", ["embedded/none", "embedded", "anthropic", "openai", "openai_compatible/", "regression/big"]
)
def test_an_unknown_model_of_a_backend_is_refused(make_registry, name):
    with pytest.raises(UnknownModelError):
        make_registry(openai_api_key="k", compatible_base_url="http://127.0.0.1:9/v1").get(name)


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("openai/gpt-4o", "set ROBOPROMPT_OPENAI_API_KEY"),
        ("anthropic/claude-haiku-5-5", "set ROBOPROMPT_ANTHROPIC_API_KEY"),
        ("openai_compatible/llama", "set ROBOPROMPT_COMPATIBLE_BASE_URL"),
        ("scripted", "set ROBOPROMPT_SCRIPTED_REPLIES"),
        ("embedded//no/such.gguf", "not a GGUF file"),
    ],
)
def test_missing_requirements_of_a_model_are_named(make_registry, name, remedy):
    with pytest.raises(ModelUnavailableError, match=remedy):
        make_registry().get(name)


def test_every_variable_that_a_message_names_is_a_setting():
    assert variable("openai_api_key") == "ROBOPROMPT_OPENAI_API_KEY"
    sources = [path.read_text() for path in Path(backends.__file__).parent.rglob("*.py")]
    named = {name for source in sources for name in re.findall(r"variable\([\"'](\w+)", source)}
    assert {"cache_folder", "scripted_replies"} <= named
    assert named <= set(LlmSettings.model_fields)


def test_profiles_say_what_is_available_and_start_nothing(make_registry):
    offered = {item.profile.name: item for item in make_registry().profiles()}
    assert offered["embedded/gemma-3-270m"].available
    assert offered["regression"].available
    assert offered["openai/gpt-4o"].reason == "openai/gpt-4o needs a key: set ROBOPROMPT_OPENAI_API_KEY"
    assert "scripted" not in offered


def test_a_default_model_that_is_not_offered_is_listed(make_registry):
    registry = make_registry(default_model="openai/o3", openai_api_key="k", scripted_replies=("a",))
    names = [item.profile.name for item in registry.profiles()]
    assert names[-2:] == ["scripted", "openai/o3"]


def test_profiles_suit_the_models(make_registry):
    registry = make_registry(openai_api_key="k", compatible_base_url="http://127.0.0.1:9/v1")
    assert registry.get("embedded/gemma-3-270m").profile == ModelProfile(
        "embedded/gemma-3-270m",
        "completion",
        grammar=True,
        representation="object_frame",
        prompt_format="paper",
        system_prompt="none",
        description="Gemma 3 270M base, Q4_K_M, on this machine",
    )
    chat = registry.get("openai_compatible/meta/llama").profile
    assert (chat.style, chat.grammar, chat.representation, chat.system_prompt) == ("chat", False, "absolute", "a")
    assert registry.get("regression").profile.representation == "absolute"


@pytest.mark.parametrize("server", ["llama_cpp", "vllm", "sglang", "other"])
def test_a_server_that_takes_grammars_is_asked_like_an_embedded_model(make_registry, server):
    address = {"compatible_base_url": "http://127.0.0.1:9/v1", "compatible_style": "completion"}
    profile = make_registry(**address, compatible_server=server).get("openai_compatible/x").profile
    expected = (False, "absolute") if server == "other" else (True, "object_frame")
    assert (profile.grammar, profile.representation, profile.system_prompt) == (*expected, "none")


PROMPT = object_frame_prompt()


async def test_models_of_one_account_share_its_limits(make_registry):
    async with loopback(after(0.2, status(400))) as (base_url, server):
        registry = make_registry(openai_api_key="k", openai_base_url=base_url)
        models = [registry.get("openai/gpt-4o"), registry.get("openai/gpt-4o-mini")] * 21
        outcomes = await asyncio.gather(*(complete(model, asking(PROMPT)) for model in models), return_exceptions=True)
        await registry.aclose()
    assert [type(outcome) for outcome in outcomes] == [ModelResponseError] * 40 + [ModelBusyError] * 2
    assert str(outcomes[-1]) == "openai is busy: 8 requests are under way and 32 wait"
    assert len(server.requests) == 40


async def test_an_embedded_model_has_as_many_places_as_slots(make_registry, monkeypatch):
    monkeypatch.setattr(backends, "QUEUED", 1)
    registry = make_registry(embedded_threads=1, embedded_slots=1)
    asked = [complete(registry.get(), asking(PROMPT, max_tokens=1)) for _ in range(3)]
    *answered, refused = await asyncio.gather(*asked, return_exceptions=True)
    await registry.aclose()
    assert ([item.usage.completion_tokens for item in answered], type(refused)) == ([1, 1], ModelBusyError)


async def test_a_request_survives_the_death_of_an_embedded_models_process(make_registry):
    registry = make_registry(embedded_threads=1, embedded_slots=1, embedded_context_tokens=512)
    before = child_pids()
    assert await registry.warm_up()
    (pid,) = child_pids() - before
    os.kill(pid, signal.SIGKILL)
    answer = await complete(registry.get(), asking(PROMPT, max_tokens=1))
    await registry.aclose()
    assert answer.usage.completion_tokens == 1


async def test_of_the_names_in_requests_only_what_is_offered_or_starts_is_kept(tmp_path):
    closed = []

    class Closing(ScriptedModel):
        async def aclose(self):
            closed.append(self.profile.name)

    class Starting(Closing):
        async def warm_up(self):
            pass

    def create(model, settings):
        profile = ModelProfile(f"own/{model}", "chat", grammar=False, representation="absolute")
        return (Starting if model == "starts" else Closing)(["a"], profile=profile)

    registry = ModelRegistry(LlmSettings(default_model="own/default"), {"own": Backend(create, lambda _: [SCRIPTED])})
    for name in ("own/starts", "own/default", "own/x"):
        async with registry.using(name) as model:
            assert (registry.get(name) is model) == (name != "own/x")
    assert closed == ["own/x"]
    assert not await registry.warm_up()
    await registry.aclose()
    assert closed == ["own/x", "own/starts", "own/default"]
