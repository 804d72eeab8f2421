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


def test_the_embedded_llm_moves_to_what_was_meant(client):
    literal = client.predict("words", "push the blue button", SEEN)
    meant = client.predict("words", "hit the azure one, not the red one", SEEN)
    assert meant.response["prompt"] == literal.response["prompt"]
    assert [a.position_m.tolist() for a in meant.actions] == [a.position_m.tolist() for a in literal.actions]
    assert meant.actions[1].position_m[1] < 0
    assert meant.response["canonical_instruction"] == "push the blue button"
    assert meant.response["grounding"] == [{"phrase": "the azure one", "object": "blue button", "by": "color"}]
    stored = client.get(f"/predictions/{meant.id}")
    described = ("canonical_instruction", "grounding")
    assert [stored[name] for name in described] == [meant.response[name] for name in described]
    assert stored["instruction"] == "hit the azure one, not the red one"


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
