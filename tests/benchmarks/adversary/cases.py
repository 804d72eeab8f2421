"""A small case by hand: ten picks of two objects in turn, and what of a case can change."""

from dataclasses import replace

import numpy as np

from benchmarks.adversary.case import Case, Recording
from roboprompt_client.types.poses import ObjectPose, Pose
from tests.episodes import pick_trajectory

NUMBER = 10
NAMES = ("red cube", "blue cube", "lid")


def poses(random):
    """Three objects on the table; the last is mentioned by no instruction."""
    places = random.uniform((0.2, -0.3), (0.5, 0.3), (len(NAMES), 2))
    yaws = random.uniform(-0.6, 0.6, len(NAMES))
    return tuple(
        ObjectPose(name, (*place, 0.78), (0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)))
        for name, place, yaw in zip(NAMES, places, yaws, strict=True)
    )


def recording(random, name):
    """A pick of the object of that name."""
    objects = poses(random)
    target = next(pose for pose in objects if pose.name == name)
    lifted = replace(target, position_m=target.position_m + np.array([0, 0, 0.1]))
    after = tuple(lifted if pose is target else pose for pose in objects)
    return Recording(f"pick up the {name}", objects, pick_trajectory(target.position_m), 20.0, after)


def picks(instruction="pick up the red cube"):
    """The case in which nothing is wrong; the other task's recordings end half as high."""
    random = np.random.default_rng(0)
    own = tuple(recording(random, NAMES[k % 2]) for k in range(NUMBER))
    low = Recording("lower it", poses(random), pick_trajectory((0.3, 0.1, 0.78), lift_m=0.07), 20.0)
    settings = {"yaw_symmetry_deg": {"lid": 0.0, "blue cube": 90.0}, "num_demonstrations": NUMBER}
    hand = Pose((0.4, 0.0, 1.1), (1.0, 0.0, 0.0, 0.0))
    return Case(own, instruction, poses(random), settings, {"model": "nearest"}, (low,), hand)


def _of_poses(objects):
    """Names, positions and rotations apart, so that each shows what has changed of it."""
    return {
        "names": [pose.name for pose in objects],
        "places": [pose.position_m.round(9).tolist() for pose in objects],
        "rotations": [pose.quaternion_xyzw.round(9).tolist() for pose in objects],
    }


def _of_recording(item):
    given = item.trajectory
    return {
        "words": item.instruction,
        **_of_poses(item.objects),
        "hand": given.positions_m.round(9).tolist(),
        "hand's rotation": given.quaternions_xyzw.round(9).tolist(),
        "gripper": given.gripper_open.tolist(),
        "speed": given.joint_velocities_rad_s.tolist(),
        "rate": item.control_frequency_hz,
    }


def _of_question(case):
    return {
        "words": case.instruction,
        **_of_poses(case.objects),
        "settings": case.settings,
        "options": case.options,
        "end effector": case.end_effector,
        "number": len(case.recordings),
    }


def changes(before, after):
    """What has changed: of the question, of any recording, and the number of recordings in which anything has."""
    question = _differing(_of_question(before), _of_question(after))
    pairs = zip(before.recordings, after.recordings, strict=False)
    changed = [_differing(_of_recording(one), _of_recording(other)) for one, other in pairs]
    return question, set().union(*changed), sum(map(bool, changed))


def _differing(old, new):
    return {name for name in old if old[name] != new[name]}
