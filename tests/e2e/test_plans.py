"""Sentences about several tasks, and predictions that name none, over HTTP."""

import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.encoding import scene_json
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.runs.loop import run_plan
from roboprompt_client.types.poses import ObjectPose
from tests.episodes import pick_trajectory

PLACES_M = {"crate": (0.1, 0.2, 0.78), "melon": (0.1, -0.2, 0.78)}
CRATE, MELON = (ObjectPose(name, place_m) for name, place_m in PLACES_M.items())
SCENE = Observation((CRATE, MELON))
OPEN, PICK = "open the crate", "pick up the melon"


@pytest.fixture(scope="module")
def client(url):
    with RoboPromptClient(url) as connected:
        connected.upload("open_crate", OPEN, pick_trajectory(PLACES_M["crate"]), Observation(CRATE))
        connected.upload("pick_melon", PICK, pick_trajectory(PLACES_M["melon"]), SCENE)
        yield connected


class Robot:
    """Sees both objects, and counts its commands."""

    moved = 0

    def observe(self):
        return SCENE

    def execute(self, action):
        self.moved += 1

    def stop(self):
        raise AssertionError("nothing goes wrong")


def test_a_sentence_is_carried_out_by_tasks_that_were_taught_apart(client):
    assert client.plan("open the crate and pick the melon up", PLACES_M) == (
        ("open_crate", OPEN),
        ("pick_melon", PICK),
    )
    robot = Robot()
    steps = run_plan(client, robot, "pick up the melon after opening the crate", model="nearest")
    assert [step.response["task"] for step in steps] == ["open_crate", "pick_melon"]
    assert robot.moved == sum(len(step.actions) for step in steps) > 0


def test_a_prediction_without_a_task_says_whose_it_is(client):
    answer = client.predict(None, "open up the crate", Observation(CRATE), model="nearest").response
    assert (answer["task"], answer["canonical_instruction"]) == ("open_crate", OPEN)
    assert client.get(f"/predictions/{answer['id']}")["task"] == "open_crate"
    named = client.predict("open_crate", "open up the crate", Observation(CRATE), model="nearest").response
    assert named["actions"] == answer["actions"]
    asked = {"instruction": OPEN, **scene_json(Observation(CRATE)), "dry_run": True}
    assert client.post("/predict", asked)["task"] == "open_crate"


@pytest.mark.parametrize(
    ("said", "seen", "field", "message"),
    [
        ("open the crate, then paint it", SCENE, "instruction", "paint"),
        ("open the crate", Observation(ObjectPose("mango", (0, 0, 0))), "objects", "no task is about these objects"),
        (" ", SCENE, "instruction", ""),
    ],
)
def test_what_no_task_does_is_a_problem_that_names_the_part(client, said, seen, field, message):
    for ask in (lambda: client.plan(said, seen.objects), lambda: client.predict(None, said, seen)):
        with pytest.raises(ServiceProblemError) as refused:
            ask()
        (entry,) = refused.value.problem["errors"]
        assert (refused.value.status, entry["field"]) == (422, field)
        assert message in entry["message"]
