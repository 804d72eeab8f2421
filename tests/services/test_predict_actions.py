import asyncio
from dataclasses import replace

import pytest

from app.llm.base import ModelTimeoutError, ModelUnavailableError
from app.llm.computed import SCRIPTED
from app.perception.base import ObjectQuery
from app.services.errors import RefusedReplyError
from app.services.predict import demonstrations
from app.services.predict.demonstrations import skills_of
from app.services.predict.request import PredictOptions, PredictRequest
from app.store import predictions
from tests.services.conftest import ONE_ACTION, with_options
from tests.services.test_upload_episode import upload

CUBE = (ObjectQuery("cube", (0.2, 0.1, 0.8)),)
REQUEST = PredictRequest("pick", "pick up the cube", CUBE, options=PredictOptions(unsupported="allow"))


def ask(services, request=REQUEST):
    return asyncio.run(services.predict_actions(request))


def recorded(store):
    with store.read() as connection:
        return predictions.list_page(connection).items


@pytest.fixture
def taught(store, scripted):
    def wire(*replies, **options):
        services = scripted(*replies, **options)
        services.upload_episode(upload("cube"))
        return services

    return wire


def test_actions_are_decoded_and_recorded(store, taught):
    prediction = ask(taught(ONE_ACTION))
    (action,) = prediction.reply.actions
    assert action.discrete.bins == (50, 50, 20, 0, 36, 36, 1)
    (record,) = recorded(store)
    assert (record.id, record.status, record.reply_text) == (prediction.id, "ok", ONE_ACTION)
    assert record.actions[0]["bins"] == [50, 50, 20, 0, 36, 36, 1]


def test_a_reply_cut_off_between_actions_is_not_taken_for_a_whole_one(store, taught):
    services = taught("[[50, 50, 20, 0, 36, 36, 1]] " + "and so on " * 200)
    with pytest.raises(RefusedReplyError, match="cut off"):
        ask(services, with_options(REQUEST, max_actions=1))
    assert recorded(store)[0].status == "parse_error"


def test_a_model_that_fails_is_recorded(store, taught, unavailable):
    with pytest.raises(ModelUnavailableError, match="the dog"):
        ask(taught(unavailable))
    (record,) = recorded(store)
    assert (record.status, record.reply_text, record.actions) == ("model_error", None, None)
    assert "the dog" in record.error


def test_the_deadline_is_the_requests_or_else_the_models(taught):
    for profile, options in ((SCRIPTED, {"timeout_s": 0.1}), (replace(SCRIPTED, timeout_s=0.1), {})):
        with pytest.raises(ModelTimeoutError):
            ask(taught(ONE_ACTION, delay_s=5.0, profile=profile), with_options(REQUEST, **options))


def prefix(services, request=REQUEST):
    question = asyncio.run(services.predict_actions.prepare(request))
    return question.prefix


def test_template_is_made_once_per_task_version(taught):
    services = taught(ONE_ACTION)
    first = prefix(services)
    assert prefix(services) is first
    services.configure_task("pick", {"num_demonstrations": 3})
    changed = prefix(services)
    assert changed is not first
    assert changed.cache_key == first.cache_key
    services.upload_episode(upload("cube"))
    assert prefix(services).cache_key != first.cache_key


def test_recordings_are_read_once_per_task_version(taught, monkeypatch):
    """Though a prompt shows them and an answer is held against them."""
    services, read = taught(ONE_ACTION), []
    monkeypatch.setattr(demonstrations, "skills_of", lambda *given: read.append(given) or skills_of(*given))
    for _ in range(2):
        prefix(services)
    assert len(read) == 1


def test_settings_follow_request_then_task_then_model(taught):
    services = taught(ONE_ACTION)

    def style(request=REQUEST):
        return asyncio.run(services.predict_actions.prepare(request)).known.style

    assert (style().representation, style().system_prompt) == ("absolute", "a")
    services.configure_task("pick", {"representation": "object_frame", "system_prompt": "b"})
    assert (style().representation, style().system_prompt) == ("object_frame", "b")
    wished = with_options(REQUEST, representation="absolute")
    assert style(wished).representation == "absolute"
