"""Use cases on a store of their own, with scripted models."""

import pytest

from app.llm.backends import Backend
from app.llm.base import ModelUnavailableError
from app.llm.registry import ModelRegistry
from app.llm.scripted import PROFILE, ScriptedModel
from app.llm.settings import LlmSettings
from app.services.container import Services
from app.store.store import Store

ONE_ACTION = "[[50, 50, 20, 0, 36, 36, 1]]"


@pytest.fixture
def store(tmp_path):
    store = Store.open(tmp_path)
    yield store
    store.close()


@pytest.fixture
def scripted(store):
    """Services whose only model replies what the test says; replies that are exceptions are raised."""

    def wire(*replies, **options):
        backend = Backend(lambda model, settings: ScriptedModel(replies, **options), lambda settings: [PROFILE])
        registry = ModelRegistry(LlmSettings(default_model="scripted"), {"scripted": backend})
        return Services.wire(store, registry, "scripted")

    return wire


@pytest.fixture
def unavailable():
    return ModelUnavailableError("the dog ate the weights")
