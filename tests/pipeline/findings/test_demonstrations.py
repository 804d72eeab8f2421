"""Demonstrations that contradict each other: no answer made of them goes without a danger."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.hand import Kept
from app.pipeline.findings.outliers import gripper_outlier_findings
from app.pipeline.findings.path_kept import kept, missed_m, path_findings

from app.pipeline.keyframes import Motion
from app.pipeline.order.order import Order
from app.pipeline.plans import agreeing, aligned_by_plan
from tests.pipeline.plans.taught import picked, recording
from tests.pipeline.recordings import ScriptedMotion
from tests.pipeline.scenes import action, demonstration, pose, rotated

PRESS = "press the button"


def presses(seed, side):
    """The left or the right of two buttons is pressed; the gripper stays closed."""
    random = np.random.default_rng(seed)
    left_m = random.uniform((-0.2, 0.05, 0.8), (0.3, 0.35, 0.8))
    right_m = random.uniform((-0.2, -0.35, 0.8), (0.3, -0.05, 0.8))
    objects = (pose("left knob", left_m, 0), pose("right knob", right_m, 0))
    above_m, pressed_m = (objects[side].position_m + np.array([0, 0, height_m]) for height_m in (0.1, 0.02))
    places_m = [(0.1, 0.0, 1.1), above_m, pressed_m, above_m]
    knots = tuple((2.0 * k + rest_s, place_m) for k, place_m in enumerate(places_m) for rest_s in (0.0, 0.5))
    return recording(ScriptedMotion(knots, starts_open=False, rest_s=0.5), objects, instruction=PRESS)


def taught(recordings, **how):
    demonstrations = tuple(replace(d, start=None) for d in aligned_by_plan(recordings))
    return Taught(demonstrations, **how)


def found(taught):
    return [(f.code, f.severity) for f in taught.findings(taught.demonstrations[0].order)]


def test_presses_of_one_button_are_no_doubt():
    assert found(taught([presses(seed, 0) for seed in range(10)])) == []


@pytest.mark.parametrize("num_right", [5])
def test_five_that_press_left_and_five_that_press_right_are_a_danger_and_no_mean(num_right):
    known = taught([presses(seed, int(seed < num_right)) for seed in range(10)])
    assert "danger" in [severity for _, severity in found(known)]
    for before, after in zip(known.usual, agreeing(known.usual), strict=True):
        pressed_m = min(after.actions, key=lambda action: action.position_m[2]).position_m
        nearest_m = min(np.linalg.norm(pressed_m - pose.position_m) for pose in before.objects)
        assert nearest_m < 0.03


def moved(item, move_m=(0, 0, 0), mirror=False, invert=False):
    """The recording with its hand in another frame, or its gripper inverted."""
    trajectory = item.motion.trajectory
    positions_m = trajectory.positions_m * ([1, -1, 1] if mirror else [1, 1, 1]) + np.array(move_m)
    gripper = ~trajectory.gripper_open if invert else trajectory.gripper_open
    changed = replace(trajectory, positions_m=positions_m, gripper_open=gripper)
    return replace(item, motion=Motion(changed, item.motion.times_s))


FAULTS = {
    "another base frame": {"move_m": (0.12, 0.13, 0)},
    "a little beside": {"move_m": (0, 0.06, 0)},
    "gripper inverted": {"invert": True},
    "mirrored": {"mirror": True},
}


@pytest.mark.parametrize("number", [5])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_half_the_recordings_is_a_danger(fault, number):
    recordings = [picked(seed) for seed in range(10)]
    assert found(taught(recordings)) == []
    wrong = [moved(item, **FAULTS[fault]) if k < number else item for k, item in enumerate(recordings)]
    assert "danger" in [severity for _, severity in found(taught(wrong))]


def test_ways_that_the_task_declares_are_no_danger():
    recordings = [moved(picked(seed), (0, 0.12 * (seed % 2), 0)) for seed in range(10)]
    assert found(taught(recordings)) == [("several-ways", "danger")]
    assert found(taught(recordings, several_ways=True)) == [("several-ways", "info")]


def test_a_slip_among_ten_is_no_way():
    recordings = [moved(picked(seed), (0, 0.2 * (seed < 2), 0)) for seed in range(10)]
    assert "danger" not in [severity for _, severity in found(taught(recordings))]


def sides(instruction, number_right, number=10):
    """So many picks of the cube on the right, which is `cube 2`, and otherwise of `cube 1`."""
    recordings = []
    for seed in range(number):
        item = presses(seed, int(seed < number_right))
        shown = item.demonstration
        names = ("cube 1", "cube 2")
        objects = tuple(replace(seen, name=name) for seen, name in zip(shown.objects, names, strict=True))
        recordings.append(replace(item, demonstration=replace(shown, instruction=instruction, objects=objects)))
    return recordings


@pytest.mark.parametrize(
    ("instruction", "number_right", "severity"),
    [
        ("press the left one", 1, "danger"),  # the place decides, and one recording says so
        ("press the nearest cube", 2, "danger"),
        ("press it", 0, None),
        ("press it", 1, "warning"),  # a slip among ten
        ("press it", 2, "warning"),
        ("press it", 3, "danger"),
    ],
)
def test_demonstrations_that_the_answer_does_not_follow(instruction, number_right, severity):
    known = taught(sides(instruction, number_right))
    assert dict(found(known)).get("acts-elsewhere") == severity
    if severity is not None:
        finding = next(item for item in known.findings(known.demonstrations[0].order) if item.code == "acts-elsewhere")
        assert finding.numbers["elsewhere"] == number_right


def test_keyframes_that_miss_where_hands_act():
    recordings = [presses(seed, 0) for seed in range(4)]
    demonstrations = taught(recordings).demonstrations
    last_only = [replace(demonstration, actions=demonstration.actions[-1:]) for demonstration in demonstrations]
    for shown, severity in ((demonstrations, None), (last_only, "danger")):
        paths = [kept(r.motion, d.actions, 0.1) for r, d in zip(recordings, shown, strict=True)]
        findings = {finding.code: finding.severity for finding in path_findings(paths)}
        assert findings.get("path-not-kept") == severity


@pytest.mark.parametrize(("left_m", "severity"), [(0.029, None), (0.03, "warning"), (0.05, "danger")])
def test_a_lift_that_most_recordings_lose_is_a_finding(left_m, severity):
    for number, expected in ((5, severity), (4, severity and "warning"), (3, None)):
        paths = [Kept(0.0, left_m)] * number + [Kept(0.0, 0.0)] * (10 - number)
        assert [finding.severity for finding in path_findings(paths)] == ([expected] if expected else [])


def test_a_grasp_between_keyframes_is_missed():
    item = picked(0)
    (demonstration,) = aligned_by_plan([item])
    assert missed_m(item.motion, demonstration.actions) < 0.01
    opened = [action for action in demonstration.actions if action.gripper_open]
    assert missed_m(item.motion, opened[:1]) == 1.0  # nothing closes


CUBE = pose("cube", (0.1, 0.0, 0.8))
PICKS, SLIPS = (True, False, False), (True, False, True, False)


def gripped(grippers, instruction="pick up the cube"):
    return demonstration(instruction, [CUBE], [action((0.1, 0.0, 0.9), gripper_open=is_open) for is_open in grippers])


@pytest.mark.parametrize(
    ("new", "others", "named"),
    [
        (SLIPS, [PICKS] * 9, True),
        (SLIPS, [PICKS] * 3, True),
        (SLIPS, [PICKS] * 2, False),  # too few to tell
        (SLIPS, [PICKS] * 3 + [SLIPS], False),  # two of five are no slip
        (PICKS, [PICKS] * 9, False),
        ((False, False), [PICKS] * 9, False),  # the hand comes without a pose before the grasp
        ((), [PICKS] * 9, True),
    ],
)
def test_an_upload_whose_gripper_does_something_else_is_named(new, others, named):
    found = list(gripper_outlier_findings(gripped(new), [gripped(item) for item in others]))
    assert [finding.code for finding in found] == ["left-out"] * named


def test_an_order_of_several_clauses_follows_the_objects_of_each():
    """Demonstrations carry out one clause each, beside an object that turns."""
    random, shown = np.random.default_rng(1), []
    for k in range(10):
        name = ("red cup", "blue cup")[k % 2]
        cups = [pose(each, (*random.uniform(-0.3, 0.3, 2), 0.8), 12.0 * k - 60) for each in ("red cup", "blue cup")]
        cup = next(each for each in cups if each.name == name)
        beside_m = cup.position_m + rotated(0, 0, 12.0 * k - 60).apply([0.1, 0, 0.05])
        shown.append(demonstration(f"push the {name}", cups, [action(beside_m, (180, 0, 12.0 * k - 60), False)]))
    known = Taught(tuple(shown))
    one = Order("push the blue cup", ("red cup", "blue cup"))
    both = Order("push the red cup, then push the blue cup", ("red cup", "blue cup"))
    assert known.followed(one) == known.turning(one) == {"blue cup"}
    assert known.followed(both) == known.turning(both) == {"red cup", "blue cup"}
