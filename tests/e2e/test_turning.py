"""A hand of which only the place, or only the rotation, turns with an object, over HTTP: a rim, a hook on one side."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.robot import Observation
from roboprompt_client.runs.reanchoring import reanchored
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import Trajectory
from tests.episodes import DWELL, hand_arrays, metadata, multipart, npz, one_joint
from tests.pipeline.scenes import DOWN_DEG, rotated

INSTRUCTION = "press the mug"
OFFSET_M = np.array([0.045, 0.01, 0.03])
HOME_M, HOVER_M = np.array([0.1, 0.0, 1.2]), np.array([0, 0, 0.1])
ASKED = [((0.22, -0.11, 0.78), 50), ((0.05, 0.2, 0.78), -65), ((0.35, 0.02, 0.78), 5)]
FRAMES = {"ow": (True, False), "wo": (False, True)}
REST_STEPS, FLOW_STEPS = 4, 12


def pressed(position_m, yaw_deg, frame):
    """Where the hand presses: (3,) and its rotation."""
    place_turns, hand_turns = FRAMES[frame]
    turn = rotated(0, 0, yaw_deg)
    place_m = np.asarray(position_m) + (turn.apply(OFFSET_M) if place_turns else OFFSET_M)
    return place_m, (turn if hand_turns else Rotation.identity()) * rotated(*DOWN_DEG)


def recording(position_m, yaw_deg, frame, flows):
    """Home, above the place, down, up again; at rest there, or without a rest."""
    place_m, hand = pressed(position_m, yaw_deg, frame)
    way_m = [HOME_M, place_m + HOVER_M, place_m, place_m + HOVER_M]
    positions = []
    for start_m, end_m in pairwise(way_m):
        steps = FLOW_STEPS if flows else REST_STEPS
        shares = np.arange(1, steps + 1) / steps
        positions += [*(start_m + shares[:, None] * (end_m - start_m)), *([end_m] * (0 if flows else DWELL))]
    number = len(positions)
    quaternions = np.tile(hand.as_quat(), (number, 1))
    return Trajectory(one_joint(HOME_M, positions), np.array(positions), quaternions, np.zeros(number))


def seen(task, position_m, yaw_deg, **more):
    document = metadata(task, {"mug": np.round(position_m, 5).tolist()}, INSTRUCTION, **more)
    document["objects"][0]["quaternion_xyzw"] = rotated(0, 0, yaw_deg).as_quat().tolist()
    return document


def teach(http, task, frame, number=10, noise_m=0.001, flows=False, seed=3):
    """Upload demonstrations in which the mug stays where it was found."""
    random = np.random.default_rng(seed)
    http.put(f"/tasks/{task}", json={"workspace": "rlbench"}).raise_for_status()
    for yaw_deg in np.linspace(-70, 70, number):
        position_m = random.uniform([0.0, -0.3, 0.78], [0.4, 0.3, 0.78])
        found_m = position_m + random.normal(0, noise_m, 3)
        trajectory = recording(position_m, yaw_deg, frame, flows)
        stays = {"object_positions": found_m, "object_quaternions_xyzw": rotated(0, 0, yaw_deg).as_quat()}
        tracked = {name: np.tile(value, (len(trajectory), 1, 1)) for name, value in stays.items()}
        shown = npz(**hand_arrays(trajectory), **tracked)
        http.post("/episodes", files=multipart(seen(task, found_m, yaw_deg), shown)).raise_for_status()
    return task


@pytest.fixture(scope="module", params=[(frame, flows) for frame in FRAMES for flows in (False, True)], ids=str)
def taught(request, http):
    frame, flows = request.param
    return frame, teach(http, f"turning_{frame}_{flows}", frame, flows=flows)


def ask(http, task, position_m=ASKED[0][0], yaw_deg=ASKED[0][1], **options):
    answer = http.post("/predict", json=seen(task, position_m, yaw_deg, **options))
    answer.raise_for_status()
    return answer.json()


def dangers(answer):
    return [finding["message"] for finding in answer["findings"] if finding["severity"] == "danger"]


def assert_pressed(answer, position_m, yaw_deg, frame):
    place_m, hand = pressed(position_m, yaw_deg, frame)
    lowest = min(answer["actions"], key=lambda action: action["position"][2])
    assert np.linalg.norm(lowest["position"] - place_m) < 0.005
    assert np.degrees((hand.inv() * Rotation.from_quat(lowest["quaternion_xyzw"])).magnitude()) < 3
    assert (lowest["anchor"]["object"], lowest["anchor"]["frame"]) == ("mug", frame)


@pytest.mark.parametrize(
    ("model", "asked"),
    [("embedded/gemma-3-270m", 0), ("regression", 1), ("nearest", 0), ("nearest", 1), ("nearest", 2)],
)
def test_place_and_rotation_each_follow_their_own_axes(http, taught, model, asked):
    (frame, task), (position_m, yaw_deg) = taught, ASKED[asked]
    answer = ask(http, task, position_m, yaw_deg, model=model, representation="object_frame")
    assert f"1 A {frame}: " in answer["reply_text"]
    assert_pressed(answer, position_m, yaw_deg, frame)
    assert dangers(answer) == []


def test_they_follow_a_mug_that_was_moved_and_turned_since(url, taught):
    frame, task = taught
    before, now = (
        ObjectPose("mug", np.array(position_m), rotated(0, 0, yaw_deg).as_quat()) for position_m, yaw_deg in ASKED[:2]
    )
    with RoboPromptClient(url) as client:
        predicted = client.predict(task, INSTRUCTION, Observation((before,)), model="nearest")
    followed = reanchored(predicted.actions, predicted.anchors, {"mug": before}, {"mug": now}, {})
    lowest = min(followed, key=lambda action: action.position_m[2])
    place_m, hand = pressed(*ASKED[1], frame)
    assert np.linalg.norm(lowest.position_m - place_m) < 0.005
    assert np.degrees((hand.inv() * Rotation.from_quat(lowest.quaternion_xyzw)).magnitude()) < 3


def test_parts_follow_them_too(http, taught):
    frame, task = taught
    answer = ask(http, task, model="embedded/gemma-3-270m", representation="parts")
    assert_pressed(answer, *ASKED[0], frame)


def test_a_prompt_of_too_few_demonstrations_is_a_danger(http, taught):
    _, task = taught
    few = dangers(ask(http, task, model="nearest", num_demonstrations=2))
    assert any("too few demonstrations" in message for message in few)
    assert dangers(ask(http, task, model="nearest", num_demonstrations=5)) == []


@pytest.mark.parametrize("frame", FRAMES)
def test_three_noisy_demonstrations_choose_no_such_frame_and_are_a_danger(http, frame):
    task = teach(http, f"turning_few_{frame}", frame, number=3, noise_m=0.012)
    answer = ask(http, task, model="nearest")
    assert not any(f" {mixed}: " in answer["reply_text"] for mixed in FRAMES)
    assert dangers(answer)
