"""The values that a robot's program makes itself."""

import pickle

import numpy as np
import pytest

from roboprompt_client import (
    Camera,
    InvalidInputError,
    ObjectPose,
    Observation,
    PredictedActions,
    RgbdFrame,
    RoboPromptClient,
    ServiceProblemError,
    Trajectory,
)
from roboprompt_client.encoding import scene_json

CUBE = ObjectPose("cube", [0.4, 0, 0.1])
FRONT = RgbdFrame(Camera("front", 5, 5, 2, 2, np.eye(4)))


@pytest.mark.parametrize("objects", [CUBE, (CUBE,), [CUBE]])
@pytest.mark.parametrize("frames", [FRONT, [FRONT]])
@pytest.mark.parametrize("to_find", ["mug", ["mug"]])
def test_an_observation_takes_one_or_many(objects, frames, to_find):
    seen = Observation(objects, frames, to_find)
    assert (seen.objects, seen.frames, seen.to_find, seen.end_effector) == ((CUBE,), (FRONT,), ("mug",), None)


def test_poses_without_an_observation_are_named():
    with RoboPromptClient("http://127.0.0.1:1") as client, pytest.raises(InvalidInputError, match=r"is a list \(valid"):
        client.predict("press", "press the button", [CUBE])


def test_an_observation_may_be_empty():
    assert Observation() == Observation((), (), (), None)
    for wrong in (np.zeros(3), (np.zeros(3),), {"name": "cube"}, None, "cube"):
        with pytest.raises(InvalidInputError, match=r"objects: has a .* one or several of ObjectPose"):
            Observation(wrong)


def test_an_observation_says_which_pixels_of_its_masks_are_an_objects():
    seen = Observation(CUBE, FRONT, ("mug", "bowl"), mask_ids={"cube": [1], "mug": (3, 4), "plate": [5]})
    objects = {item["name"]: item.get("mask_ids") for item in scene_json(seen)["objects"]}
    assert objects == {"cube": [1], "mug": [3, 4], "bowl": None, "plate": [5]}


DOWN = [[1.0, 0, 0, 0]] * 3
HEIGHTS = [[0.4, 0, z] for z in (0.3, 0.2, 0.1)]


def test_a_trajectory_of_poses_has_no_joints():
    trajectory = Trajectory.from_poses(HEIGHTS, DOWN, [1, 1, 0], [0.0, 0.1, 0.2])
    assert (len(trajectory), trajectory.num_joints, trajectory.joint_positions_rad) == (3, 0, None)
    assert trajectory.gripper_open.tolist() == [True, True, False]
    assert trajectory.timestamps_s.tolist() == [0.0, 0.1, 0.2]
    assert Trajectory.from_poses(HEIGHTS, DOWN, [1, 1, 0]).timestamps_s is None


@pytest.mark.parametrize(
    ("arrays", "field"),
    [
        (([0.4, 0, 0.1], DOWN, [1, 1, 0]), "end_effector_positions"),
        ((HEIGHTS, DOWN[:2], [1, 1, 0]), "end_effector_quaternions_xyzw"),
        ((HEIGHTS, DOWN, [1, 0]), "gripper_open"),
        ((HEIGHTS, DOWN, [1, 1, 0], [0, 0, 0]), "timestamps"),
        (([], [], []), "end_effector_positions"),
    ],
)
def test_poses_that_do_not_fit_are_named(arrays, field):
    with pytest.raises(InvalidInputError) as caught:
        Trajectory.from_poses(*arrays)
    assert caught.value.field == f"trajectory.{field}"


def test_the_objects_of_a_prediction_say_how_they_were_found():
    found = {
        "name": "mug",
        "position": [0.4, 0, 0.1],
        "quaternion_xyzw": None,
        "estimator": "cuboid",
        "cameras": ["front"],
        "confidence": 0.518,
        "reason": "only 83 % of the pixels fit",
    }
    (mug,) = PredictedActions("p", (), {"objects": [found]}).objects
    assert (mug.estimator, mug.confidence, mug.reason, mug.cameras) == ("cuboid", 0.518, found["reason"], ("front",))
    assert mug.quaternion_xyzw is None


def test_a_problem_can_be_raised_by_a_worker_process():
    problem = {"type": "/problems/model-busy", "title": "Busy", "detail": "ask later"}
    again = pickle.loads(pickle.dumps(ServiceProblemError(503, problem)))
    assert (again.status, again.problem, str(again)) == (503, problem, "503 Busy: ask later")
