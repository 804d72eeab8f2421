"""Use cases on a store of their own, with scripted models."""

from dataclasses import replace
from itertools import cycle

import pytest

from app.llm.backends import BUILT_IN, Backend
from app.llm.base import ModelUnavailableError
from app.llm.computed import SCRIPTED, ScriptedModel
from app.llm.llm_settings import LlmSettings
from app.llm.registry import ModelRegistry
from app.services.container import Services
from app.services.poses import PoseServers
from app.services.predict.known import KnownReader
from app.services.predict.question import question_of
from app.services.predict.request import PredictOptions
from tests.stores import opened

ONE_ACTION = "[[50, 50, 20, 0, 36, 36, 1]]"


@pytest.fixture
def store(tmp_path, migrated_database):
    store = opened(tmp_path, migrated_database)
    yield store
    store.close()


@pytest.fixture
def scripted(store):
    """Services whose only model replies what the test says, and keeps in the list `asked` what it was asked.

    Replies that are exceptions are raised.
    """

    def wire(*replies, asked=None, profile=SCRIPTED, **options):
        turns, kept = cycle(replies), [] if asked is None else asked

        def script(request):
            kept.append(request)
            return next(turns)

        backend = Backend(
            lambda model, settings: ScriptedModel(script, profile=profile, **options), lambda settings: [profile]
        )
        registry = ModelRegistry(LlmSettings(default_model="scripted"), {"scripted": backend})
        return Services(store, registry, "scripted")

    return wire


@pytest.fixture
def nearest(store):
    """Services that copy the nearest demonstration."""
    models = ModelRegistry(LlmSettings(default_model="nearest"), {"nearest": BUILT_IN["nearest"]})
    return Services(store, models, "nearest")


@pytest.fixture
def unavailable():
    return ModelUnavailableError("the dog ate the weights")


def with_options(request, **changes):
    """The request with these options, which are checked, and the others as they are."""
    return replace(request, options=PredictOptions.model_validate(request.options.model_dump() | changes))


def written(services, profile, request):
    """The question to a model of that profile."""
    return question_of(request, KnownReader(services.store, lambda name: profile, PoseServers()))
