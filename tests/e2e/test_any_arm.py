"""Arms of other than seven joints, through upload, check and predict."""

import numpy as np
import pytest

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import ServiceProblemError
from roboprompt_client.robot import Observation
from roboprompt_client.types.poses import ObjectPose
from tests.episodes import arrays, metadata, multipart, npz, pick_trajectory, refused

PLACES_M = [(0.11, 0.02, 0.78), (0.21, -0.13, 0.78), (0.3, 0.2, 0.78), (0.05, -0.2, 0.78)]
INSTRUCTION = "pick up the cube"


def recording(place_m, num_joints):
    """As a driver has it: joint angles and times, and how far the fingers are apart."""
    named = arrays(pick_trajectory(place_m))
    speeds, is_open = named.pop("joint_velocities")[:, :1], named.pop("gripper_open")
    joints = np.cumsum(speeds, axis=0) / 20 * np.ones(num_joints)
    times_s = np.arange(len(speeds)) / 20
    return {**named, "joint_positions": joints, "timestamps": times_s, "gripper_width": np.where(is_open, 0.08, 0.03)}


def teach(http, task, recordings):
    for place_m, named in zip(PLACES_M, recordings, strict=True):
        answer = http.post("/episodes", files=multipart(metadata(task, {"cube": place_m}), npz(**named)))
        assert answer.status_code == 201, answer.text
        yield answer.json()


def ask(url, task):
    place_m = np.array([0.17, 0.08, 0.78])
    with RoboPromptClient(url) as client:
        predicted = client.predict(task, INSTRUCTION, Observation((ObjectPose("cube", place_m),)), model="regression")
    grasp = next(action for action in predicted.actions if not action.gripper_open)
    np.testing.assert_allclose(grasp.position_m, place_m, atol=0.02)
    return predicted


@pytest.mark.parametrize("num_joints", [5, 6])
def test_upload_check_and_predict(http, url, num_joints):
    task = f"arm_{num_joints}"
    taught = list(teach(http, task, (recording(place_m, num_joints) for place_m in PLACES_M)))
    assert [len(item["keyframes"]) for item in taught] == [3] * 4
    assert http.get(f"/tasks/{task}").json()["num_joints"] == num_joints
    checked = http.get(f"/tasks/{task}/check").json()
    assert [len(plan["episodes"]) for plan in checked["plans"]] == [4], checked
    assert not [item for item in checked["findings"] if item["severity"] == "danger"]
    assert [action.gripper_open for action in ask(url, task).actions] == [True, False, False]


def test_the_task_s_arm_has_the_first_episode_s_joints(http):
    list(teach(http, "six", (recording(place_m, 6) for place_m in PLACES_M)))
    document = metadata("six", {"cube": PLACES_M[0]})
    answer = http.post("/episodes", files=multipart(document, npz(**recording(PLACES_M[0], 7))))
    error = refused(answer, "trajectory.joint_velocities", "has 7 joints, but the task's arm has 6")
    assert error["valid"] == "shape (T, 6)"


def test_a_hand_without_known_joints_goes_by_its_path(http, url):
    recordings = [recording(place_m, 6) for place_m in PLACES_M]
    for named in recordings:
        del named["joint_positions"]
    taught = list(teach(http, "hand", recordings))
    assert all(item["keyframes"] for item in taught)
    assert http.get("/tasks/hand").json()["num_joints"] is None
    ask(url, "hand")
    assert http.get(f"/ui/episodes/{taught[0]['id']}/motion").status_code == 200
    assert http.put("/tasks/hand", json={"keyframes": {"rule": "merged"}}).status_code == 200
    answer = http.get(f"/episodes/{taught[0]['id']}")
    assert answer.status_code == 422
    assert "by which the rule merged finds rests" in answer.text


def test_the_width_above_which_fingers_are_open_is_the_task_s(http, url):
    first, *_ = teach(http, "fingers", [recording(place_m, 6) for place_m in PLACES_M])
    assert [frame["gripper_open"] for frame in first["keyframes"]] == [True, False, False]
    assert http.put("/tasks/fingers", json={"gripper_open_above_m": 0.02}).status_code == 200
    frames = http.get(f"/episodes/{first['id']}").json()["keyframes"]
    assert all(frame["gripper_open"] for frame in frames)
    cube = Observation((ObjectPose("cube", np.array([0.17, 0.08, 0.78])),))
    with RoboPromptClient(url) as client:
        predicted = client.predict("fingers", INSTRUCTION, cube, model="regression")
        assert all(action.gripper_open for action in predicted.actions)
        with pytest.raises(ServiceProblemError, match="gripper_open_above_m"):
            client.configure_task("fingers", gripper_open_above_m=80)
