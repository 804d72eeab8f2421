"""What each kind of case changes of a case in which nothing is wrong: that, in so many recordings, and nothing else."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.adversary.case import Case, Recording
from benchmarks.adversary.kinds import KINDS, RIGHT, WRONG
from benchmarks.adversary.measure import digest_of, mutated
from roboprompt_client.types.poses import ObjectPose, Pose
from roboprompt_client.types.trajectory import Trajectory

NUMBER = 10
NAMES = ("red cube", "blue cube", "lid")


MOVE, REST = 8, 6  # frames
DOWN_XYZW = (1.0, 0.0, 0.0, 0.0)


def pick_trajectory(position_m, lift_m=0.15):
    """Home, above the object, down, closed, lifted: rests between straight moves."""
    x, y, z = position_m
    stops = [((0.1, 0.0, 1.2), 1), ((x, y, z + 0.1), 1), ((x, y, z), 0), ((x, y, z + lift_m), 0)]
    positions, is_open = [], []
    for (start_m, before), (end_m, after) in pairwise(stops):
        positions += [*np.linspace(start_m, end_m, MOVE + 1)[1:], *[np.array(end_m)] * REST]
        is_open += [before] * MOVE + [after] * REST
    speeds = np.zeros((len(positions), 7))
    steps_m = np.linalg.norm(np.diff(positions, axis=0, prepend=[stops[0][0]]), axis=1)
    speeds[:, 0] = 20 * steps_m
    return Trajectory(speeds, np.array(positions), np.tile(DOWN_XYZW, (len(positions), 1)), np.array(is_open))


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


SOME, HALF, ALL = 3 * NUMBER // 10, NUMBER // 2, NUMBER
PLACES, TURNS, POSES = {"places"}, {"rotations"}, {"places", "rotations"}
NAMED = {"names", "places", "rotations"}
HAND, HAND_POSE = {"hand"}, {"hand", "hand's rotation"}
MOTION = {"hand", "speed"}
TIME = {"hand", "gripper", "speed"}  # the small recordings never turn the hand
NONE: set[str] = set()
# Faults of the recorder, in half of the recordings and in all
RECORDER = {
    "gripper late": {"gripper"},
    "gripper early": {"gripper"},
    "gripper stuck": {"gripper"},
    "hand smoothed": HAND,
    "begun late": TIME | HAND_POSE,
    "middle missing": TIME | HAND_POSE,
    "few frames": TIME | HAND_POSE | {"rate"},
    "hand in a tilted frame": HAND_POSE,
    "hand with y up": HAND_POSE,
    "hand scaled": HAND,
    "hand turned about itself": {"hand's rotation"},
    "hand misses": HAND,
    "times in milliseconds": {"rate"},
    "joints at rest": {"speed"},
    "joints in degrees": {"speed"},
    "joint positions as velocities": {"speed"},
    "hand drifts": HAND,
    "hand frozen": HAND,
    "frames out of order": TIME,
    "hand's x and y exchanged": HAND,
    "hand from its start": HAND,
    "hand's rotation missing": {"hand's rotation"},
    "not stopped": TIME | HAND_POSE,
    "objects in a camera's frame": POSES,
    "objects' rotations missing": TURNS,
}
# Of the question, of recordings, and in how many of these
EXPECTED = {
    "unchanged": (NONE, NONE, 0),
    "poses 0.5 cm off": (NONE, POSES, ALL),
    "poses as the estimator gives them": (NONE, POSES, ALL),
    "scene 0.5 cm off": (POSES, NONE, 0),
    "three asked for": ({"options"}, NONE, 0),
    "objects in another order": (NAMED, NONE, 0),
    "hand elsewhere": ({"end effector"}, NONE, 0),
    "turned within symmetry": (TURNS, NONE, 0),
    "hand trembles": (NONE, HAND_POSE | {"speed"}, ALL),
    "hand waits on its way": (NONE, TIME | HAND_POSE, ALL),
    "each at its own speed": (NONE, {"rate", "speed"}, ALL),
    "fingers close again in some": (NONE, TIME | HAND_POSE, SOME),
    "hand strays": (NONE, MOTION, ALL),
    "frame moved in half": (NONE, HAND_POSE | POSES, HALF),
    "hand shifted in half": (NONE, HAND, HALF),
    "hand shifted in all": (NONE, HAND, ALL),
    "hand shifted in one": (NONE, HAND, 1),
    "hand turned in half": (NONE, HAND_POSE, HALF),
    "hand turned in all": (NONE, HAND_POSE, ALL),
    "hand lifted in half": (NONE, HAND, HALF),
    "hand lifted in all": (NONE, HAND, ALL),
    "mirrored in half": (NONE, HAND_POSE | POSES, HALF),
    "hand mirrored in half": (NONE, HAND_POSE, HALF),
    "hand mirrored in all": (NONE, HAND_POSE, ALL),
    "hand in millimeters in half": (NONE, HAND, HALF),
    "gripper inverted in half": (NONE, {"gripper"}, HALF),
    "gripper inverted in one": (NONE, {"gripper"}, 1),
    "gripper inverted in all": (NONE, {"gripper"}, ALL),
    "w first in half": (NONE, {"hand's rotation"}, HALF),
    "w first in all": (NONE, {"hand's rotation"}, ALL),
    "objects' w first in half": (NONE, TURNS, HALF),
    "reversed in half": (NONE, TIME, HALF),
    "reversed in one": (NONE, TIME, 1),
    "reversed in all": (NONE, TIME, ALL),
    "broken off in half": (NONE, TIME | HAND_POSE, HALF),
    "broken off in all": (NONE, TIME | HAND_POSE, ALL),
    "another task's motion in half": (NONE, MOTION, HALF),
    "another task's motion in one": (NONE, MOTION, 1),
    "another task's motion in all": (NONE, MOTION, ALL),
    "another task in half": (NONE, MOTION | POSES, HALF),
    "another task in all": (NONE, MOTION | POSES, ALL),
    "names swapped in half": (NONE, POSES, HALF),
    "names swapped in one": (NONE, POSES, 1),
    "names swapped in question": (POSES, NONE, 0),
    "object seen where another is in question": (POSES, NONE, 0),
    "name in capitals in question": ({"names"}, NONE, 0),
    "name underscored in half": (NONE, {"names"}, HALF),
    "name hyphenated in question": ({"names"}, NONE, 0),
    "name twice in question": (NAMED, NONE, 0),
    "name twice, one capitalized": (NAMED, NONE, 0),
    "name twice, one underscored": (NAMED, NONE, 0),
    "objects of the next in one": (NONE, POSES, 1),
    "objects of the next in half": (NONE, POSES, HALF),
    "objects of the next in all": (NONE, POSES, ALL),
    "object 2 to 5 cm off in half": (NONE, PLACES, HALF),
    "object 5 to 20 cm off in half": (NONE, PLACES, HALF),
    "object 20 to 70 cm off in half": (NONE, PLACES, HALF),
    "object 2 to 5 cm off in question": (PLACES, NONE, 0),
    "object 5 to 20 cm off in question": (PLACES, NONE, 0),
    "object 20 to 70 cm off in question": (PLACES, NONE, 0),
    "object 0.7 to 2.5 m off in question": (PLACES, NONE, 0),
    "object 2 to 6 cm higher or lower in question": (PLACES, NONE, 0),
    "object 10 to 70 cm higher or lower in question": (PLACES, NONE, 0),
    "object's height scaled in half": (NONE, PLACES, HALF),
    "object's height scaled in question": (PLACES, NONE, 0),
    "object upside down in question": (TURNS, NONE, 0),
    "object lying in question": (TURNS, NONE, 0),
    "object turned in question": (TURNS, NONE, 0),
    "object turned in half": (NONE, TURNS, HALF),
    "objects in a camera's frame in question": (POSES, NONE, 0),
    "objects' rotations missing in question": (TURNS, NONE, 0),
    "bystander moved in question": (PLACES, NONE, 0),
    "tag moved in question": (NAMED, NAMED, ALL),
    "poses 5 cm off in all": (NONE, POSES, ALL),
    "scene 5 cm off": (POSES, NONE, 0),
    "scene of a recording": (POSES, NONE, 0),
    "two ways under one instruction": ({"words"}, {"words"}, ALL),
    "instructions exchanged in half": (NONE, {"words"}, HALF),
    "declared round": ({"settings"}, NONE, 0),
    "declared square": ({"settings"}, NONE, 0),
    "workspace widened": (PLACES, PLACES | HAND, 1),
    "one asked for, hand shifted in half": ({"options"}, HAND, HALF),
    "two asked for, hand shifted in half": ({"options"}, HAND, HALF),
    "one asked for, gripper inverted in half": ({"options"}, {"gripper"}, HALF),
    "one asked for, names swapped in half": ({"options"}, POSES, HALF),
    "hand's rotations inverted in half": (NONE, {"hand's rotation"}, HALF),
    "hand's rotations inverted in all": (NONE, {"hand's rotation"}, ALL),
    "objects' rotations inverted in half": (NONE, TURNS, HALF),
    "objects' rotations inverted in all": (NONE, TURNS, ALL),
    "objects seen after the motion in half": (NONE, PLACES, HALF),
    "objects seen after the motion in all": (NONE, PLACES, ALL),
    "places scaled in half": (NONE, PLACES, HALF),
    "places scaled in question": (PLACES, NONE, 0),
    **{
        f"{name} in {part}": (NONE, changed, number)
        for name, changed in RECORDER.items()
        for part, number in (("half", HALF), ("all", ALL))
    },
}
ELSEWHERE = {"five recordings", "tag moved, nothing named"}  # tests of their own


def test_every_kind_is_tested():
    assert {*EXPECTED, *ELSEWHERE} == {*KINDS}


@pytest.mark.parametrize("kind", EXPECTED)
def test_a_kind_changes_what_it_says_and_nothing_else(kind):
    case = picks()
    assert changes(case, mutated(kind, case, "pick", 0)) == EXPECTED[kind]


def test_equal_arguments_give_equal_cases_and_other_seeds_other_ones():
    kind = "hand shifted in half"
    one, again, other = (mutated(kind, picks(), "pick", seed) for seed in (3, 3, 4))
    assert changes(one, again) == (set(), set(), 0)
    assert digest_of(one) == digest_of(again) != digest_of(other)


def test_there_are_enough_kinds():
    assert len(WRONG) >= 25
    assert all(not kind.wrong for kind in RIGHT.values())


def test_five_recordings_have_those_of_the_asked_instruction_first():
    case = picks()
    kept = mutated("five recordings", case, "pick", 0).recordings
    assert kept == tuple(item for item in case.recordings if item.instruction == case.instruction)


def test_a_tag_is_beside_the_object_in_every_recording_and_elsewhere_in_the_question():
    one_task = picks()
    own = tuple(item for item in one_task.recordings if item.instruction == one_task.instruction)
    case = mutated("tag moved in question", one_task, "pick", 0)
    beside_m = [np.linalg.norm(r.objects[0].position_m - r.objects[-1].position_m) for r in case.recordings]
    np.testing.assert_allclose(beside_m, 0.08)
    alone = type(one_task)(own, one_task.instruction, one_task.objects, one_task.settings)
    hidden = mutated("tag moved, nothing named", alone, "pick", 0)
    assert {item.instruction for item in hidden.recordings} == {hidden.instruction} == {"do it"}


@pytest.mark.parametrize(
    ("kind", "least_m", "most_m"),
    [("object 2 to 5 cm off in question", 0.02, 0.05), ("object 20 to 70 cm off in question", 0.2, 0.7)],
)
def test_an_object_is_shifted_as_far_as_the_kind_says(kind, least_m, most_m):
    case = picks()
    for seed in range(10):
        moved = mutated(kind, case, "pick", seed)
        far_m = np.linalg.norm(moved.objects[0].position_m - case.objects[0].position_m)
        assert least_m <= far_m <= most_m


def test_a_mirrored_hand_keeps_rotations_and_returns_when_it_is_mirrored_again():
    case = picks()
    once = mutated("hand mirrored in all", case, "pick", 0)
    twice = mutated("hand mirrored in all", once, "pick", 0)
    assert changes(case, twice) == (set(), set(), 0)


def test_a_moved_frame_keeps_where_the_hand_is_seen_from_the_objects():
    case = picks()
    moved = mutated("frame moved in half", case, "pick", 0)
    for old, new in zip(case.recordings, moved.recordings, strict=True):
        far_m = [np.linalg.norm(r.trajectory.positions_m - r.objects[0].position_m, axis=1) for r in (old, new)]
        np.testing.assert_allclose(*far_m)


def test_a_case_that_offers_no_way_to_be_wrong_is_none():
    case = picks()
    single = type(case)(
        tuple(type(r)(r.instruction, r.objects[:1], r.trajectory, 20.0) for r in case.recordings[::2]),
        case.instruction,
        case.objects[:1],
        case.settings,
    )
    for kind in ("names swapped in question", "bystander moved in question", "another task in all"):
        assert mutated(kind, single, "pick", 0) is None
