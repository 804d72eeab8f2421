"""Instructions over HTTP: understood, or refused with what the task knows."""

import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import ObjectPose
from tests.episodes import pick_trajectory

PLACES_M = {"red button": (0.1, 0.2, 0.78), "blue button": (0.1, -0.2, 0.78)}
SEEN = Observation(tuple(ObjectPose(name, place_m) for name, place_m in PLACES_M.items()))


@pytest.fixture(scope="module")
def client(url):
    with RoboPromptClient(url) as connected:
        for name, place_m in PLACES_M.items():
            connected.upload("words", f"push the {name}", pick_trajectory(place_m), SEEN)
        yield connected


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        ("push the purple button", "ungrounded-instruction"),
        ("dance", "unfamiliar-instruction"),
    ],
)
def test_what_is_not_clear_is_a_problem_that_lists_what_the_task_knows(client, said, kind):
    client.configure_task("words", aliases={"red button": ["stop"]})
    with pytest.raises(ServiceProblemError) as refused:
        client.predict("words", said, SEEN, model="regression")
    assert (refused.value.status, refused.value.problem["type"]) == (422, f"/problems/{kind}")
    (entry,) = refused.value.problem["errors"]
    assert entry["field"] == "instruction"
    assert entry["valid"].startswith("objects red button (or stop), blue button; taught 'push the red button'")
