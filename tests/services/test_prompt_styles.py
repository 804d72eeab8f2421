"""Which representation, prompt format and system prompt go together."""

import pytest
from pydantic import ValidationError

from app.api.documents import episode_document
from app.llm.base import ModelProfile
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.filters import EpisodeFilter
from roboprompt_client.errors import InvalidInputError
from tests.services.conftest import with_options, written
from tests.services.test_predict_actions import REQUEST
from tests.services.test_upload_episode import upload

CHAT = ModelProfile("chat", "chat", False, "absolute", "paper", "b")
BASE = ModelProfile("base", "completion", True, "absolute", "paper", "b")


@pytest.fixture
def taught(scripted):
    services = scripted("[]")
    services.upload_episode(upload("cube"))
    return services


def question(services, profile=CHAT, **options):
    return written(services, profile, with_options(REQUEST, **options))


@pytest.mark.parametrize(
    ("representation", "prompt_format", "profile", "expected"),
    [
        ("absolute", "paper", CHAT, "b"),
        ("action_tokens", "paper", CHAT, "b"),
        ("object_frame", "paper", CHAT, "none"),
        ("parts", "paper", CHAT, "none"),
        ("absolute", "paper", BASE, "none"),
    ],
)
def test_the_system_prompt_describes_the_prompt(taught, representation, prompt_format, profile, expected):
    style = question(taught, profile, representation=representation, prompt_format=prompt_format).known.style
    assert style.system_prompt == expected


def test_a_system_prompt_that_is_asked_for_goes_first(taught):
    style = question(taught, system_prompt="a").known.style
    assert style.system_prompt == "a"


SMALL = ModelProfile("small", "chat", True, "object_frame", "sums")


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({}, ("object_frame", "paper", "none")),
        ({"representation": "absolute"}, ("absolute", "sums", "a")),
        ({"representation": "absolute", "prompt_format": "paper"}, ("absolute", "paper", "a")),
        ({"representation": "action_tokens"}, ("action_tokens", "paper", "a")),
    ],
)
def test_a_models_format_counts_where_the_representation_has_it(taught, options, expected):
    style = question(taught, SMALL, **options).known.style
    assert (style.representation, style.prompt_format, style.system_prompt) == expected


def test_sums_are_of_absolute_rows(taught):
    assert " [1 open cube +0" in question(taught, representation="absolute", prompt_format="sums").prompt.user
    with pytest.raises(InvalidInputError, match=r"prompt_format: is 'sums' with .*'object_frame'.*sums with absolute"):
        question(taught, representation="object_frame", prompt_format="sums")


def test_a_task_cannot_be_set_to_what_cannot_be_written(taught):
    assert TaskSettings(prompt_format="sums").prompt_format == "sums"  # the request may name the representation
    taught.configure_task("pick", {"representation": "absolute", "prompt_format": "sums"})
    with pytest.raises(ValidationError, match=r"prompt_format\n.*'object_frame'"):
        taught.configure_task("pick", {"representation": "object_frame"})
    assert question(taught).known.style.representation == "absolute"


def test_episodes_are_shown_in_the_papers_representation_whatever_the_prompts_are(taught):
    taught.configure_task("pick", {"representation": "action_tokens"})
    with taught.store.read() as connection:
        task = tasks.get(connection, "pick")
        (record,) = episodes.list_page(connection, EpisodeFilter(task="pick")).items
    assert episode_document(record, TaskSettings.model_validate(task.settings))["observation_text"].startswith(
        "{'cube': ["
    )
