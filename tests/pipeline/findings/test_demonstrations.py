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
from tests.pipeline.plans.taught import INSTRUCTION, picked, reached, recording, scene
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


@pytest.mark.parametrize("num_right", [4, 5, 6])
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


@pytest.mark.parametrize("number", [4, 5])
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


def test_ways_that_differ_only_in_how_the_hand_gets_there_are_one():
    """Half of the demonstrations come from higher, by one more row."""
    random, group = np.random.default_rng(0), []
    for k in range(8):
        cube, plate = scene(random)
        over = [action(cube.position_m + np.array([0, 0, height_m])) for height_m in (0.3, 0.1)[k % 2 :]]
        actions = [*over, action(cube.position_m, gripper_open=False), action(plate.position_m)]
        group.append(replace(demonstration(INSTRUCTION, (cube, plate), actions), plan=k % 2))
    assert "several-ways" not in [code for code, _ in found(Taught(tuple(group)))]


def test_a_slip_among_ten_is_no_way():
    recordings = [moved(picked(seed), (0, 0.2 * (seed < 2), 0)) for seed in range(10)]
    assert "danger" not in [severity for _, severity in found(taught(recordings))]


def test_of_instructions_only_the_one_that_is_asked_is_doubted():
    right = [picked(seed) for seed in range(6)]
    wrong = [presses(seed, seed % 2) for seed in range(6)]
    known = taught(right)
    assert found(known) == []
    assert Taught(()).findings(right[0].demonstration.order) == ()
    assert "danger" in [severity for _, severity in found(taught(wrong))]


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


def test_one_of_three_is_more_than_a_slip():
    assert dict(found(taught(sides("press it", 1, number=3))))["acts-elsewhere"] == "danger"


def test_a_side_in_an_objects_name_decides_by_the_name():
    recordings = [presses(seed, int(seed < 2)) for seed in range(10)]
    recordings = [
        replace(r, demonstration=replace(r.demonstration, instruction="press the left knob")) for r in recordings
    ]
    assert dict(found(taught(recordings)))["acts-elsewhere"] == "warning"


def test_a_declared_way_is_no_danger_where_a_place_decides():
    assert dict(found(taught(sides("press the left one", 2), several_ways=True)))["acts-elsewhere"] == "info"


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


@pytest.mark.parametrize(("others_m", "severity"), [(0.029, "warning"), (0.03, "danger")])
def test_a_straight_way_is_demonstrated_where_more_than_half_take_it(others_m, severity):
    (finding,) = path_findings([Kept(0.0, 0.08)] * 4 + [Kept(0.0, others_m)] * 6)
    assert finding.severity == severity


def test_a_grasp_between_keyframes_is_missed():
    item = picked(0)
    (demonstration,) = aligned_by_plan([item])
    assert missed_m(item.motion, demonstration.actions) < 0.01
    opened = [action for action in demonstration.actions if action.gripper_open]
    assert missed_m(item.motion, opened[:1]) == 1.0  # nothing closes


@pytest.mark.parametrize("symmetry_deg", [{}, {"red cube": 0.0}])
def test_grasps_round_an_object_that_is_declared_round(symmetry_deg):
    random = np.random.default_rng(0)
    turns_rad = random.uniform(-1, 1, 10)
    offsets_m = [(0.08 * np.cos(turn), 0.08 * np.sin(turn), 0.0) for turn in turns_rad]
    known = Taught(tuple(reached(offsets_m, random=random)), yaw_symmetry_deg=symmetry_deg)
    (finding,) = known.findings(known.demonstrations[0].order)
    assert (finding.code, finding.severity) == ("scattered-demonstrations", "danger")
    assert ("yaw_symmetry_deg" in finding.message) == bool(symmetry_deg)


def test_like_instructions_may_name_different_objects():
    recordings = sides("press the left one beside the cube 1", 2) + sides("press the left one beside the cube 2", 3)
    assert dict(found(taught(recordings)))["acts-elsewhere"] == "danger"


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


def test_other_instructions_are_not_compared():
    assert not list(gripper_outlier_findings(gripped(SLIPS, "move the cube"), [gripped(PICKS)] * 9))


@pytest.mark.parametrize(("returns", "severity"), [(True, None), (False, "danger")])
def test_a_detour_that_shifts_rows_is_not_elsewhere(returns, severity):
    """Three of ten go aside before they press: in the row in which others press they are 20 cm away."""
    random, demonstrations = np.random.default_rng(1), []
    for k in range(10):
        button_m = random.uniform((0, -0.2, 0.8), (0.3, 0.2, 0.8))
        aside_m, above_m = button_m + np.array([0.2, 0, 0.02]), button_m + np.array([0, 0, 0.1])
        late = [above_m, aside_m, button_m if returns else aside_m, above_m]
        way_m = late if k < 3 else [above_m, button_m, above_m, above_m]
        rows = [action(place_m, gripper_open=False) for place_m in way_m]
        demonstrations.append(replace(demonstration(PRESS, [pose("button", button_m)], rows), plan=0, id=f"d{k}"))
    assert dict(found(Taught(tuple(demonstrations)))).get("acts-elsewhere") == severity


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
