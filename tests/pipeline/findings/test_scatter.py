"""Demonstrations that scatter where the gripper acts."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.outliers import prompt_findings
from app.pipeline.findings.scatter import scatter_findings
from app.pipeline.plans.support import Support
from scipy.spatial.transform import Rotation

from tests.pipeline.scenes import action, demonstration, pose, rotated

INSTRUCTION = "pick up the cube"


def shown(off_m, number=10, after_m=None, closes=1, *, before=True):
    """Approach, grasp and lift, whose grasp is off by `off_m` here and there, and the lift by `after_m` or as much.

    The gripper is open `before` the row `closes`, otherwise from there on.
    """
    group = []
    for k in range(number):
        x_m, way_m = 0.03 * k, np.array([np.cos(2.4 * k), np.sin(2.4 * k), 0.0])
        offs_m = [0.0, off_m, off_m if after_m is None else after_m]
        places_m = [(x_m, 0, 0.9 - 0.05 * row) + off * way_m for row, off in enumerate(offs_m)]
        rows = [action(place_m, gripper_open=(row < closes) == before) for row, place_m in enumerate(places_m)]
        group.append(demonstration(INSTRUCTION, (pose("cube", (x_m, 0, 0.8), 0),), rows))
    return group


def found(*groups):
    return list(scatter_findings(Support.of(groups), groups[0][0].order, {}))


@pytest.mark.parametrize(("off_m", "severity"), [(0.005, None), (0.02, "info"), (0.05, "danger"), (0.1, "danger")])
def test_the_center_counts(off_m, severity):
    findings = found(shown(off_m))
    assert [finding.severity for finding in findings] == ([] if severity is None else [severity])
    for finding in findings:
        assert (finding.code, finding.where) == ("scattered-demonstrations", "actions[1]")
        assert finding.numbers["scatter_m"] == pytest.approx(off_m, rel=0.2)


def line_m(k):
    return np.random.default_rng(100 + k).uniform(-0.2, 0.2, 3)


@pytest.mark.parametrize(
    ("off_m", "severity"),
    [
        (lambda k, cube_m, start_m, noise_m: (0.01 * k, 0, 0), "danger"),
        (lambda k, cube_m, start_m, noise_m: 0.15 * cube_m, "danger"),
        (lambda k, cube_m, start_m, noise_m: start_m, "danger"),
        (lambda k, cube_m, start_m, noise_m: 0.3 * (cube_m - line_m(k)), "danger"),
        (lambda k, cube_m, start_m, noise_m: noise_m, "info"),
    ],
    ids=["a camera that drifts", "a wrong scale", "another tool", "beyond two objects", "noise"],
)
def test_what_explains_the_scatter_is_no_noise(off_m, severity):
    random, group = np.random.default_rng(0), []
    for k in range(10):
        cube_m, start_m = random.uniform(-0.2, 0.2, 3), random.uniform(-0.03, 0.03, 3)
        at_m = cube_m + off_m(k, cube_m, start_m, random.normal(0, 0.02, 3))
        ups_m = np.array([[0, 0, 0.1], [0, 0, 0], [0, 0, 0.1]])
        rows = [action(at_m + up_m, gripper_open=row == 0) for row, up_m in enumerate(ups_m)]
        given = demonstration(INSTRUCTION, (pose("cube", cube_m, 0), pose("line", line_m(k), 0)), rows)
        group.append(replace(given, start=action(start_m + np.array([0, 0, 0.4]))))
    (finding,) = found(group)
    assert finding.severity == severity


@pytest.mark.parametrize(
    ("between_deg", "symmetry_deg", "dangers"),
    [(0, None, 0), (12, None, 0), (30, None, 1), (38, 90.0, 1), (38, 0.0, 0), (90, 90.0, 0), (90, 180.0, 1)],
)
def test_two_turns_of_the_hand_are_not_averaged(between_deg, symmetry_deg, dangers):
    random, group = np.random.default_rng(0), []
    for k in range(10):
        cube_m, yaw_deg = (*random.uniform(-0.2, 0.2, 2), 0.8), float(random.uniform(-40, 40))
        deg = yaw_deg + between_deg * (k % 2) + random.normal(0, 1.5)
        rows = [action((*cube_m[:2], z_m), (180, 0, deg), gripper_open=z_m == 0.9) for z_m in (0.9, 0.8)]
        group.append(demonstration(INSTRUCTION, (pose("cube", cube_m, yaw_deg),), rows))
    declared = {} if symmetry_deg is None else {"cube": symmetry_deg}
    findings = list(scatter_findings(Support.of([group]), group[0].order, declared))
    assert sum(finding.severity == "danger" for finding in findings) == dangers


def in_two_places(apart_m, number, noise_m, seed):
    """Grasps of a cube, half of which are so far beside the others."""
    random, group = np.random.default_rng(seed), []
    for k in range(number):
        cube_m = np.array([*random.uniform(-0.2, 0.2, 2), 0.8])
        at_m = cube_m + np.array([apart_m * (k % 2), 0, 0]) + random.normal(0, noise_m, 3)
        rows = [action(at_m + np.array([0, 0, up_m]), gripper_open=up_m > 0) for up_m in (0.1, 0)]
        group.append(demonstration(INSTRUCTION, (pose("cube", cube_m, float(random.uniform(-40, 40))),), rows))
    return group


@pytest.mark.parametrize(("apart_m", "dangers"), [(0.0, 0), (0.015, 0), (0.03, 1), (0.04, 1)])
def test_two_places_of_a_grasp_are_not_averaged(apart_m, dangers):
    findings = found(in_two_places(apart_m, 10, 0.002, seed=0))
    assert [finding.severity for finding in findings].count("danger") == dangers


def test_without_a_switch_the_hand_acts_where_it_is_lowest():
    (finding,) = found(shown(0.05, closes=5))
    assert (finding.severity, finding.where) == ("danger", "actions[2]")
    assert found(shown(0.05, after_m=0.0, closes=5)) == []


def test_more_than_a_third_that_are_far_off_are_a_danger_and_a_slip_is_none():
    """The others agree to the millimeter, so that neither median nor center says so."""

    def with_wrong(number):
        right, wrong = shown(0.0), shown(0.2)
        return wrong[:number] + right[number:]

    assert [finding.severity for finding in found(with_wrong(4))] == ["danger"]
    assert found(with_wrong(3)) == []


def beside(off_m, number, *, place_turns=True, hand_turns=False, turned_deg=40, noise_m=0.0, noise_deg=0.0):
    """The cube is turned further each time; the hand goes to a place beside its center."""
    random, group = np.random.default_rng(1), []
    for k in range(number):
        way = Rotation.from_euler("z", turned_deg * k * place_turns, degrees=True).apply([off_m, 0, 0])
        way += random.normal(0, noise_m, 3)
        turn = rotated(180, 0, turned_deg * k * hand_turns + noise_deg * (-1) ** k).as_quat()
        rows = [
            replace(action(np.add(way, [0.03 * k, 0, z_m]), gripper_open=is_open), quaternion_xyzw=turn)
            for z_m, is_open in ((0.9, True), (0.8, False))
        ]
        group.append(demonstration(INSTRUCTION, (pose("cube", (0.03 * k, 0, 0.8), turned_deg * k),), rows))
    return group


TURN_APART = [{"place_turns": True, "hand_turns": False}, {"place_turns": False, "hand_turns": True}]


@pytest.mark.parametrize("turns", TURN_APART)
@pytest.mark.parametrize(("off_m", "number", "noise_m"), [(0.012, 4, 0.0), (0.02, 3, 0.001), (0.03, 10, 0.003)])
def test_a_place_and_a_hand_of_which_one_turns_with_an_object_have_frames_of_their_own(off_m, number, noise_m, turns):
    assert found(beside(off_m, number, **turns, noise_m=noise_m)) == []


def test_a_place_and_a_hand_that_turn_alike_are_none():
    assert found(beside(0.003, 10)) == found(beside(0.03, 10, turned_deg=0)) == []
    assert found(beside(0.03, 10, hand_turns=True)) == found(beside(0.03, 10, place_turns=False)) == []


@pytest.mark.parametrize("turns", TURN_APART)
def test_a_prompt_must_show_enough_demonstrations_of_such_frames(turns):
    taught, asked = Support.of([beside(0.03, 10, **turns)]), beside(0.03, 8, **turns)[7]

    def found_with(number):
        plans = Support.of([beside(0.03, number, **turns)]).placed(asked)
        return [(f.code, f.severity) for f in prompt_findings(taught, asked, plans, frozenset())]

    assert found_with(2) == [("scattered-demonstrations", "danger")]
    assert found_with(4) == []


def poured(beside_m=0.0, every=2, without_turn=False, returned=True):
    """From a cup into a bowl, every so-manieth time beside it or without turning the cup; it is put back or kept."""
    group = []
    for k in range(10):
        odd, cup_m, bowl_m = k % every == 0, np.array([0.03 * k, 0.0, 0.8]), np.array([0.2, 0.02 * k, 0.8])
        at_m = bowl_m + np.array([0.0, beside_m if odd else 0.0, 0.15])
        turned_deg = (180, 0, 0) if odd and without_turn else (80, 0, 0)
        over_m = cup_m + np.array([0.0, 0.0, 0.2])
        rows = [action(cup_m), action(cup_m, gripper_open=False), action(over_m, gripper_open=False)]
        rows += [action(at_m, turn, gripper_open=False) for turn in ((180, 0, 0), turned_deg, (180, 0, 0))]
        rows += [action(cup_m, gripper_open=True)] if returned else []
        objects = pose("cup", tuple(cup_m), 0), pose("bowl", tuple(bowl_m), 0)
        group.append(demonstration("pour the cup into the bowl", objects, rows))
    return group


@pytest.mark.parametrize("returned", [False, True])
def test_what_is_done_with_what_is_held_counts(returned):
    assert found(poured(returned=returned)) == []
    assert [finding.severity for finding in found(poured(beside_m=0.03, returned=returned))] == ["info"]
    for wrong in ({"beside_m": 0.2}, {"without_turn": True}):
        (finding,) = found(poured(**wrong, returned=returned))
        assert (finding.severity, finding.where) == ("danger", "actions[4]")


@pytest.mark.parametrize(("share", "severity"), [(0.5, "danger"), (0.0, None)], ids=["between both", "at one post"])
def test_a_place_between_two_objects_is_no_noise(share, severity):
    random, group = np.random.default_rng(4), []
    for _ in range(10):
        post_m = random.uniform((0, -0.3, 0.8), (0.3, 0.1, 0.8))
        other_m = post_m + random.uniform((-0.03, 0.10, 0), (0.03, 0.18, 0))
        cube_m = np.array([*random.uniform(0.4, 0.6, 2), 0.8])
        put_m = post_m + share * (other_m - post_m) + [0, 0, 0.02]
        rows = [action(cube_m), action(cube_m, gripper_open=False), action(put_m)]
        objects = (pose("cube", cube_m, 0), pose("left post", post_m), pose("right post", other_m))
        group.append(demonstration("put the cube between the left post and the right post", objects, rows))
    assert [finding.severity for finding in found(group)] == ([severity] if severity else [])


def slid(along_m, across_m):
    """Ten pushes of a drawer: half touch it so far along the way that they push, and so far beside it."""
    group = []
    for k, x_m in enumerate(np.random.default_rng(4).uniform(-0.1, 0.1, 10)):
        handle_m = np.array([x_m, 0.6, 0.8])
        touch_m = handle_m + (np.array([across_m, along_m, 0]) if k % 2 else 0)
        pushed_m = handle_m + np.array([across_m * (k % 2), 0.15, 0])
        rows = [action(place_m) for place_m in (touch_m + np.array([0, 0, 0.1]), touch_m, pushed_m)]
        group.append(demonstration("close the drawer", (pose("drawer", handle_m, 0),), rows))
    return group


def test_a_hand_that_slides_may_come_down_anywhere_along_its_way():
    assert found(slid(0.03, 0.0)) == []
    (finding,) = found(slid(0.0, 0.03))
    assert finding.severity == "danger"
