"""From a request's words to the prompt: four buttons, taught by one demonstration each."""

import asyncio
from dataclasses import replace

import pytest
from pydantic import ValidationError

from app.llm.base import ModelProfile
from app.perception.base import ObjectQuery
from app.pipeline.episode import Episode
from app.pipeline.errors import UnfamiliarInstructionError
from app.services.predict.request import PredictOptions, PredictRequest
from app.services.teach.upload_checks import Upload
from app.store import predictions
from roboprompt_client.errors import InvalidInputError
from tests.episodes import pick_trajectory
from tests.services.conftest import ONE_ACTION, with_options, written
from tests.services.test_dialogue import RELATIVE

PLACES_M = {
    "red button": (0.3, 0.3, 0.8), "yellow button": (0.35, 0.1, 0.8), "green button": (0.32, -0.1, 0.8),
    "blue button": (0.45, -0.3, 0.8),
}  # fmt: skip
OBJECTS = tuple(ObjectQuery(name, place_m) for name, place_m in PLACES_M.items())
REQUEST = PredictRequest(
    "push", "push the azure button", OBJECTS, options=PredictOptions(representation="object_frame")
)
PROFILE = ModelProfile("base", "completion", True, "object_frame", "paper", "b")


def teach(services):
    for name, place_m in PLACES_M.items():
        episode = Episode(f"push the {name}", pick_trajectory(place_m))
        services.upload_episode(Upload("push", episode, OBJECTS, {}))


@pytest.fixture
def services(scripted):
    wired = scripted(RELATIVE)
    teach(wired)
    return wired


def question(services, instruction=REQUEST.instruction, objects=OBJECTS, **options):
    request = replace(with_options(REQUEST, **options), instruction=instruction, objects=objects)
    return written(services, PROFILE, request)


def asked(question):
    return question.prompt.query


@pytest.mark.parametrize(
    ("said", "first"),
    [
        ("push the azure button", "A blue button"),
        ("do not push the red button, push the blue one", "A blue button"),
        ("push the leftmost button", "A red button"),
        ("push the button farthest from the robot", "A blue button"),
    ],
)
def test_rows_name_the_object_that_is_meant(services, said, first):
    assert asked(question(services, instruction=said)).startswith(first)


def test_where_the_robot_stands_decides_what_is_near_to_it(services):
    assert "green" in asked(question(services, instruction="push the button closest to you")).split(";")[0]
    services.configure_task("push", {"robot_base": [0.3, 0.6, 0.0]})
    assert "red" in asked(question(services, instruction="push the button closest to you")).split(";")[0]


def test_aliases_hold_as_soon_as_they_are_set(services):
    with pytest.raises(InvalidInputError):
        question(services, instruction="push the emergency stop")
    services.configure_task("push", {"aliases": {"red button": ["emergency stop"]}})
    (phrase,) = question(services, instruction="push the emergency stop").grounded.phrases
    assert phrase.to_json() == {"phrase": "the emergency stop", "object": "red button", "by": "alias"}


@pytest.mark.parametrize(
    "aliases",
    [
        {"lever": ["handle"]},
        {"red button": ["Blue_button"]},
        {"red button": ["stop"], "blue button": ["STOP"]},
        {"red button": ["a;b"]},
        {"red button": [""]},
    ],
)
def test_aliases_belong_to_one_object_of_the_task(services, aliases):
    with pytest.raises((InvalidInputError, ValidationError), match="aliases"):
        services.configure_task("push", {"aliases": aliases})


def test_aliases_of_a_task_without_episodes_are_checked_with_the_first(scripted):
    services = scripted("[]")
    services.configure_task("push", {"aliases": {"lever": ["handle"]}})
    with pytest.raises(InvalidInputError, match=r"aliases\[lever\]"):
        teach(services)


def test_an_unfamiliar_instruction_is_passed_on_with_a_finding(services):
    allowed = question(services, instruction="pull the azure button", unfamiliar="allow")
    assert "pull the blue button" in asked(allowed)
    (finding,) = allowed.findings[:1]
    assert (finding.code, finding.severity, finding.where) == ("new-instruction", "danger", "instruction")
    assert "new-instruction" not in {item.code for item in question(services).findings}


def test_how_the_words_were_understood_is_recorded(services):
    prediction = asyncio.run(services.predict_actions(REQUEST))
    with services.store.read() as connection:
        record = predictions.get(connection, prediction.id)
    assert record.instruction == "push the azure button"
    assert record.grounding == {
        "instruction": "push the blue button",
        "phrases": [{"phrase": "the azure button", "object": "blue button", "by": "color"}],
        "unfamiliar": None,
    }


def test_only_what_the_prompt_shows_is_familiar(scripted):
    services = scripted(ONE_ACTION)
    teach(services)
    pull = Episode("pull the red button", pick_trajectory(PLACES_M["red button"]))
    services.upload_episode(Upload("push", pull, OBJECTS, {}))
    assert "pull the blue button" in asked(question(services, instruction="pull the blue button"))
    with pytest.raises(UnfamiliarInstructionError):
        question(services, instruction="pull the blue button", num_demonstrations=4)
