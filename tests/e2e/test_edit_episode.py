"""Episodes are corrected: their instruction, whether prompts show them, and what people note."""

import json

import numpy as np
import pytest

from app.api.schemas.responses import EpisodeOut
from app.datasets.parcel import Parcel
from roboprompt_client import RoboPromptClient
from tests.e2e.test_pose_sources import given
from tests.e2e.vision import MODELS, PLACES, episode, frames
from tests.episodes import arrays, metadata, multipart, npz, pick_trajectory, refused

PLACES_M = [(0.10, 0.00, 0.785), (0.15, 0.05, 0.785), (0.70, 0.02, 0.785)]
INSTRUCTION = "pick up the cube"


def teach(http, task, place_m, **more):
    document = metadata(task, {"cube": place_m}, instruction=INSTRUCTION, **more)
    answer = http.post("/episodes", files=multipart(document, npz(**arrays(pick_trajectory(place_m)))))
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


@pytest.fixture
def taught(http):
    """A task with three episodes, the oldest first; deleted afterwards."""
    yield [teach(http, "edited", place_m) for place_m in PLACES_M]
    http.delete("/tasks/edited")


def edit(http, id_, **changes):
    answer = http.patch(f"/episodes/{id_}", json=changes)
    assert answer.status_code == 200, answer.text
    EpisodeOut.model_validate_json(answer.content)
    return answer.json()


def ask(http, **how):
    scene = [{"name": "cube", "position": PLACES_M[1]}]
    body = {"task": "edited", "instruction": INSTRUCTION, "objects": scene, "dry_run": True, **how}
    return http.post("/predict", json=body)


def version(http):
    return http.get("/tasks/edited").json()["version"]


def test_an_instruction_is_corrected_in_prompts_at_once_and_the_first_is_kept(http, taught):
    ask(http)
    before = version(http)
    assert edit(http, taught[0], instruction="lift the cube")["uploaded_instruction"] == INSTRUCTION
    assert version(http) > before
    assert "lift the cube" in json.dumps(ask(http).json()["prompt"])
    restored = edit(http, taught[0], instruction=INSTRUCTION)
    assert (restored["instruction"], restored["uploaded_instruction"]) == (INSTRUCTION, None)
    assert "lift the cube" not in json.dumps(ask(http).json()["prompt"])


def test_an_episode_is_left_out_of_prompts_and_of_the_workspace_and_comes_back(http, taught):
    assert ask(http).json()["demonstration_ids"] == taught
    workspace = http.get("/tasks/edited").json()["workspace"]
    edit(http, taught[2], left_out=True)
    assert ask(http).json()["demonstration_ids"] == taught[:2]
    assert http.get("/tasks/edited").json()["workspace"]["max"][0] < workspace["max"][0]
    for left_out, ids in ((True, taught[2:]), (False, taught[:2])):
        listed = http.get("/episodes", params={"task": "edited", "left_out": left_out}).json()["episodes"]
        assert sorted(item["id"] for item in listed) == sorted(ids)
    assert http.get("/tasks/edited/check").json()["num_episodes"] == 2
    for selection in ("recent", "random", "nearest"):
        assert taught[2] not in ask(http, selection=selection).json()["demonstration_ids"]
    refused(ask(http, episode_ids=[taught[0], taught[2]]), "episode_ids[1]")
    edit(http, taught[2], left_out=False)
    assert ask(http).json()["demonstration_ids"] == taught
    assert http.get("/tasks/edited").json()["workspace"] == workspace


def test_a_task_that_leaves_out_everything_has_no_demonstrations(http, taught):
    for id_ in taught:
        edit(http, id_, left_out=True)
    answer = ask(http)
    assert answer.status_code == 409
    assert "left out" in answer.json()["detail"]
    assert http.get("/tasks/edited/check").status_code == 409


def test_a_note_changes_no_prompt(http, taught):
    before = version(http)
    assert edit(http, taught[0], note="the cube slipped")["note"] == "the cube slipped"
    assert version(http) == before
    assert edit(http, taught[0])["note"] == "the cube slipped"
    assert edit(http, taught[0], note="")["note"] == ""


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        ({"instruction": "pick up the spoon"}, "instruction", "spoon"),
        ({"instruction": " "}, "instruction", "not a valid instruction"),
        ({"left_out": "yes"}, "left_out", ""),
        ({"note": "n" * 501}, "note", "500"),
        ({"task": "other"}, "task", ""),
    ],
)
def test_a_wrong_correction_is_refused_by_its_field_and_changes_nothing(http, taught, change, field, words):
    before = http.get(f"/episodes/{taught[0]}").json()
    answer = http.patch(f"/episodes/{taught[0]}", json={"note": "half", **change})
    refused(answer, field, words)
    assert http.get(f"/episodes/{taught[0]}").json() == before


def test_an_unknown_episode_is_not_found(http):
    assert http.patch("/episodes/none", json={"note": "x"}).status_code == 404


def test_an_export_has_what_was_corrected_and_the_key_of_the_first_upload(http, taught):
    def parcel():
        return Parcel(http.get(f"/episodes/{taught[0]}/metadata").json(), {})

    key = parcel().key
    edit(http, taught[0], instruction="lift the cube", left_out=True, note="slow")
    exported = parcel()
    assert (exported.metadata["instruction"], exported.metadata["left_out"]) == ("lift the cube", True)
    assert exported.key == key
    noted = http.get("/episodes", params={"task": "edited", "q": "SLOW"}).json()["episodes"]
    assert [item["id"] for item in noted] == [taught[0]]
    document = {**exported.metadata, "task": "copied"}
    answer = http.post("/episodes", files=multipart(document, npz(**arrays(pick_trajectory(PLACES_M[0])))))
    assert answer.status_code == 201, answer.text
    copied = answer.json()
    assert (copied["left_out"], copied["note"], copied["uploaded_instruction"]) == (True, "slow", INSTRUCTION)
    http.delete("/tasks/copied")


def test_the_client_edits(http, taught):
    with RoboPromptClient(str(http.base_url)) as client:
        assert client.edit_episode(taught[1], left_out=True, note="twice")["left_out"] is True
        assert client.edit_episode(taught[1], left_out=False)["note"] == "twice"


def test_what_cannot_be_extracted_does_not_hold_a_task_back_while_it_is_left_out(http):
    """A model that does not find its object in an episode is an error of what needs the episode, which names it."""
    ids = []
    for solids in PLACES:
        files = episode("blurred", frames(solids), solids[0].position_m, given(solids))
        ids.append(http.post("/episodes", files=files).raise_for_status().json()["id"])
    id_ = ids[-1]
    green_only = {**MODELS, "red cube": {**MODELS["red cube"], "color": "green"}}
    http.put("/tasks/blurred", json={"object_models": green_only}).raise_for_status()
    for address in (f"/episodes/{id_}", "/tasks/blurred/check"):
        answer = http.get(address)
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["field"].startswith("episode ")
    for each in ids:
        edit(http, each, left_out=True)
    assert http.get(f"/episodes/{id_}").json()["left_out"] is True
    refused(http.patch(f"/episodes/{id_}", json={"left_out": False}), f"episode {id_}: objects[red cube]")
    http.put("/tasks/blurred", json={"object_models": MODELS}).raise_for_status()
    found = edit(http, id_, left_out=False)["objects"]
    np.testing.assert_allclose(found[0]["position"], PLACES[-1][0].position_m, atol=0.004)
    http.delete("/tasks/blurred")
