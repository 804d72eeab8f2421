import asyncio

import pytest

from app.llm.backends import BUILT_IN
from app.llm.llama.process import LlamaOptions, LlamaProcess
from app.llm.llama.weights import trimmed_gemma
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry


@pytest.fixture
def anyio_backend():
    """Of tests that are coroutines, each in an event loop of its own."""
    return "asyncio"


@pytest.fixture(scope="session")
def run():
    """Runs a coroutine; all of a session's in one event loop, to which started models belong."""
    with asyncio.Runner() as runner:
        yield runner.run


@pytest.fixture(scope="session")
def settings(tmp_path_factory):
    # one thread: two that wait for each other crawl when other work shares the cores
    return LlmSettings(cache_folder=tmp_path_factory.mktemp("cache"), embedded_threads=1, embedded_context_tokens=2048)


@pytest.fixture(scope="session")
def registry(settings, run):
    registry = ModelRegistry(settings, BUILT_IN)
    yield registry
    run(registry.aclose())


@pytest.fixture(scope="session")
def gemma(registry):
    return registry.get("embedded/gemma-3-270m")


@pytest.fixture(scope="session")
def llama_server(settings):
    """A real server that speaks OpenAI's API, with the tokens that the service's own model has."""
    path = trimmed_gemma(settings.cache_folder)()
    options = LlamaOptions(str(path), slots=2, context_tokens=2048, threads=1)
    process = LlamaProcess(options)
    yield process.server
    process.stop()
