import asyncio
import os
import re
import signal
from contextlib import AsyncExitStack
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from app.llm import backends
from app.llm.backends import BUILT_IN, Backend, all_backends
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
from app.llm.registry import MAX_MODELS, ModelRegistry
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
    assert not await registry.warm_up("regression")
    assert await registry.warm_up()
    (pid,) = child_pids() - before
    os.kill(pid, signal.SIGKILL)
    answer = await complete(registry.get(), asking(PROMPT, max_tokens=1))
    await registry.aclose()
    assert answer.usage.completion_tokens == 1


def test_all_models_are_closed_together():
    closed = []

    class Closing(ScriptedModel):
        async def aclose(self):
            closed.append(self.profile.name)

    def create(model, settings):
        return Closing(["a"], profile=ModelProfile(f"own/{model}", "chat", grammar=False, representation="absolute"))

    registry = ModelRegistry(LlmSettings(), {"own": Backend(create, lambda settings: [SCRIPTED])})
    for name in ("own/a", "own/b", "own/a"):
        registry.get(name)
    asyncio.run(registry.aclose())
    assert sorted(closed) == ["own/a", "own/b"]


def test_names_from_requests_fill_neither_the_memory_nor_the_places(make_registry):
    registry = make_registry(openai_api_key="k")
    first, second = registry.get("openai/0"), registry.get("openai/1")
    for number in range(2, MAX_MODELS):
        registry.get(f"openai/{number}")
    assert registry.get("openai/0") is first
    registry.get("openai/one-more")  # in the place of the one unused for longest
    assert registry.get("openai/0") is first
    assert registry.get("openai/1") is not second


async def test_what_is_in_use_keeps_its_place_and_what_is_not_is_closed():
    class Closable(ScriptedModel):
        closed = False

        async def aclose(self):
            self.closed = True

    made = {}

    def create(model, settings):
        made[model] = Closable([model])
        return made[model]

    registry = ModelRegistry(LlmSettings(default_model="own/default"), {"own": Backend(create, lambda _: [])})
    default = registry.get()
    async with AsyncExitStack() as used:
        for number in range(MAX_MODELS):
            await used.enter_async_context(registry.using(f"own/{number}"))
        with pytest.raises(ModelBusyError, match="32 other models are in use"):
            registry.get("own/one-more")
        assert registry.get() is default
    async with registry.using("own/0"), registry.using("own/one-more"):
        assert {name for name, model in made.items() if model.closed} == {"1"}
    await registry.aclose()
    assert all(model.closed for model in made.values())


def test_a_profile_keeps_nothing_and_what_is_offered_has_a_place_of_its_own(make_registry):
    registry = make_registry(openai_api_key="k", compatible_base_url="http://127.0.0.1:9/v1")
    kept = registry.get("openai/kept")
    for number in range(3 * MAX_MODELS):
        assert registry.profile(f"openai_compatible/{number}").name == f"openai_compatible/{number}"
    for item in registry.profiles():
        if item.available:
            registry.get(item.profile.name)
    for number in range(1, MAX_MODELS):
        registry.get(f"openai/{number}")
    assert registry.get("openai/kept") is kept


own_backend = Backend(lambda model, settings: ScriptedModel([model]), lambda settings: [SCRIPTED])


def test_another_package_adds_a_backend_but_replaces_none(monkeypatch):
    points = [EntryPoint(name, f"{__name__}:own_backend", backends.ENTRY_POINT_GROUP) for name in ("own", "openai")]
    monkeypatch.setattr(backends, "entry_points", lambda group: [p for p in points if p.group == group])
    found = all_backends()
    assert found["own"] is own_backend
    assert found["openai"] is BUILT_IN["openai"]
    registry = ModelRegistry(LlmSettings(), found)
    assert asyncio.run(complete(registry.get("own/hello"), asking(object_frame_prompt()))).text == "hello"
