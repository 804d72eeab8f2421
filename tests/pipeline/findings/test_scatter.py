"""Demonstrations that scatter where the gripper acts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.findings.acting_row import ActingRow
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.outliers import prompt_findings
from app.pipeline.findings.scatter import scatter_findings
from app.pipeline.plans.rows import plan_row, plan_rows
from app.pipeline.plans.support import Support
from app.pipeline.representation.anchors import Anchor
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


@pytest.mark.parametrize(("varies_m", "explained"), [(0.02, False), (0.2, True)])
def test_the_noise_of_an_object_that_stays_in_one_place_explains_nothing(varies_m, explained):
    """The hand goes to one place; seen from the object, all scatter is the object's."""
    random, group = np.random.default_rng(3), []
    for _ in range(10):
        bin_m = np.array([0.4, 0.1, 0.8]) + random.uniform(-varies_m, varies_m, 3)
        group.append(demonstration(INSTRUCTION, (pose("bin", bin_m, 0),), [action((0.4, 0.1, 0.8))]))
    row = plan_row(group, 0, (Anchor("bin", "w"),) * len(group))
    far_m, cause = ActingRow(group, [row], 0, True, group[0].order, {}).explained_m()
    assert (far_m > 0.015, cause) == ((True, "the place of bin") if explained else (False, ""))


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


def test_noise_is_seldom_taken_for_two_places():
    alarms = [found(in_two_places(0.0, number, 0.01, seed)) for number in (6, 10) for seed in range(15)]
    assert sum("two places" in finding.message for findings in alarms for finding in findings) <= 1


def test_what_is_let_go_may_come_down_anywhere():
    (finding,) = found(shown(0.05, before=False))
    assert finding.severity == "warning"


def test_more_demonstrations_make_up_for_noise():
    few, many = (found(shown(0.03, number))[0] for number in (5, 20))
    assert (few.severity, many.severity) == ("danger", "info")


def test_many_demonstrations_do_not_make_up_for_what_no_noise_does():
    """Of two plans that with more demonstrations scatters farther, and its center is the better known."""
    narrow, wide = shown(0.06, number=5), shown(0.1, number=40)
    (finding,) = found(narrow, wide)
    assert finding.severity == "danger"
    assert finding.numbers["center_off_m"] < found(narrow)[0].numbers["center_off_m"]


def test_an_empty_hand_that_closes_on_the_way_says_nothing():
    assert found(shown(0.15, after_m=0.0)) == []
    (lost,) = found(shown(0.15))
    assert lost.severity == "danger"


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


@pytest.mark.parametrize(("noise_deg", "severities"), [(2.0, []), (12.0, ["danger"])])
def test_a_hand_that_does_not_keep_its_rotation_in_the_world_follows_something_else(noise_deg, severities):
    """Its place turns with the cube, and seen from there its rotation scatters even more."""
    group = beside(0.05, 10, noise_deg=noise_deg)
    assert plan_rows(group)[1].anchors[0].frame == "ow"
    assert [finding.severity for finding in found(group)] == severities


TURN_APART = [{"place_turns": True, "hand_turns": False}, {"place_turns": False, "hand_turns": True}]


@pytest.mark.parametrize("turns", TURN_APART)
@pytest.mark.parametrize(("off_m", "number", "noise_m"), [(0.012, 4, 0.0), (0.02, 3, 0.001), (0.03, 10, 0.003)])
def test_a_place_and_a_hand_of_which_one_turns_with_an_object_have_frames_of_their_own(off_m, number, noise_m, turns):
    assert found(beside(off_m, number, **turns, noise_m=noise_m)) == []


@pytest.mark.parametrize("turns", TURN_APART)
def test_too_few_and_noisy_ones_of_which_one_turns_are_a_danger(turns):
    (finding,) = found(beside(0.03, 3, **turns, noise_m=0.009))
    assert (finding.severity, finding.where) == ("danger", "actions[1]")
    assert ("turns with cube" in finding.message) is turns["place_turns"]


@pytest.mark.parametrize("turns", TURN_APART)
def test_a_hand_of_which_a_far_place_decides_the_frame_is_a_danger(turns):
    """The place is exact and decides; the hand's rotation is too noisy to be certain of."""
    (finding,) = found(beside(0.1, 3, **turns, noise_deg=12))
    assert (finding.severity, finding.where) == ("danger", "actions[1]")
    assert ("turns with cube" in finding.message) is turns["hand_turns"]


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


def test_where_something_is_only_carried_does_not_count():
    group = []
    for k in range(10):
        cube_m, way_m = np.array([0.03 * k, 0.0, 0.8]), 0.15 * np.array([np.cos(2.4 * k), np.sin(2.4 * k), 1.0])
        over_m = way_m + np.array([0.2, 0.2, 1.0])
        rows = [action(cube_m), action(cube_m, gripper_open=False), action(over_m, gripper_open=False)]
        rows += [action((0.3, 0.3, 0.8), gripper_open=True)]
        objects = pose("cube", tuple(cube_m), 0), pose("bin", (0.3, 0.3, 0.8), 0)
        group.append(demonstration("put the cube in the bin", objects, rows))
    assert found(group) == []


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


@pytest.mark.parametrize(("wrong_deg", "severities"), [(0, []), (45, ["danger"])])
def test_a_pull_that_follows_a_yaw_that_half_of_the_poses_have_wrong_is_a_danger(wrong_deg, severities):
    """The places to which the hand pulls lie on a circle around the handle."""
    group = []
    for k, yaw_deg in enumerate(np.random.default_rng(3).uniform(-20, 20, 10)):
        pulled_m = Rotation.from_euler("z", yaw_deg, degrees=True).apply([0.17, 0, 0])
        at_m = np.array([0.03 * k, 0, 0.8])
        places_m = (at_m + pulled_m / 2, at_m, at_m + pulled_m)
        rows = [action(place_m, gripper_open=number != 1) for number, place_m in enumerate(places_m)]
        handle = pose("handle", at_m, yaw_deg + wrong_deg * (k % 2))
        group.append(demonstration("open the drawer", (handle,), rows))
    findings = found(group)
    assert [finding.severity for finding in findings] == severities
    assert all("a yaw that was not sent" in finding.message for finding in findings)


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


def in_two_plans(off_m):
    """Ten grasps of which five are off: all three of one plan, and two of the seven of the other."""
    random, group = np.random.default_rng(11), []
    for k in range(10):
        cube_m = np.array([*random.uniform(-0.2, 0.2, 2), 0.8])
        at_m = cube_m + np.array([off_m if k < 5 else 0, 0, 0])
        ups_m = (0.2, 0.1, 0.0, 0.2) if k < 3 else (0.1, 0.0, 0.1)
        closes = ups_m.index(0.0)
        rows = [action(at_m + np.array([0, 0, m]), gripper_open=row < closes) for row, m in enumerate(ups_m)]
        item = demonstration(INSTRUCTION, (pose("cube", cube_m, 0),), rows)
        group.append(replace(item, plan=int(k < 3), id=str(k)))
    return group


@pytest.mark.parametrize(("off_m", "severities"), [(0.0, []), (0.03, ["danger"])])
def test_acts_of_several_plans_between_which_nothing_decides_are_compared(off_m, severities):
    known = Taught(tuple(in_two_plans(off_m)))
    findings = [
        item for item in known.findings(known.demonstrations[0].order) if item.code == "scattered-demonstrations"
    ]
    assert [item.severity for item in findings] == severities


def test_a_hand_that_slides_may_come_down_anywhere_along_its_way():
    assert found(slid(0.03, 0.0)) == []
    (finding,) = found(slid(0.0, 0.03))
    assert finding.severity == "danger"


@pytest.mark.parametrize(("goes_up", "severity"), [(False, "warning"), (True, "danger")])
def test_a_push_may_end_anywhere_along_its_way_unless_the_hand_goes_up_from_there(goes_up, severity):
    group = []
    for x_m, push_m in ((0.0, 0.09), (0.03, 0.21), (-0.05, 0.12), (0.08, 0.19)):
        handle_m = np.array([x_m, 0.6, 0.8])
        ways_m = [(0, 0, 0.1), (0, 0, 0), (0, push_m, 0), (0, push_m, 0.1)]
        rows = [action(handle_m + way_m) for way_m in ways_m[: 3 + goes_up]]
        group.append(demonstration("close the drawer", (pose("drawer", handle_m, 0),), rows))
    assert [finding.severity for finding in found(group)] == [severity]


@pytest.mark.parametrize(("ends_apart_m", "severities"), [(0.0, []), (0.03, ["danger"])])
def test_a_hand_that_slides_from_one_object_to_another_is_between_them_on_its_way(ends_apart_m, severities):
    group, random = [], np.random.default_rng(7)
    for k in range(10):
        plate_m, box_m = (
            np.array([random.uniform(-0.1, 0.1), 0.5, 0.8]),
            np.array([random.uniform(-0.1, 0.1), 0.8, 0.8]),
        )
        between_m = box_m + 0.4 * (plate_m - box_m)
        ends_m = box_m + np.array([ends_apart_m * (k % 2), 0, 0])
        rows = [action(place_m) for place_m in (plate_m + np.array([0, 0, 0.1]), plate_m, between_m, ends_m)]
        group.append(demonstration("slide the plate into the box", (pose("plate", plate_m), pose("box", box_m)), rows))
    findings = [finding.severity for finding in found(group) if finding.severity == "danger"]
    assert findings == severities


@pytest.mark.parametrize(
    ("off_m", "rise_m", "gripper_open", "severities"),
    [
        ((0, 0.04, 0), 0.0, True, []),  # along its way
        ((0, 0.04, 0), 0.02, True, []),  # along its way, a little upward
        ((0, 0.04, 0), 0.1, True, ["danger"]),  # it leaves what it touched
        ((0, 0.04, 0), 0.0, False, ["danger"]),  # it takes what it touched
        ((0.03, -0.03, 0), 0.0, True, ["danger"]),  # beside its way
    ],
)
def test_where_a_hand_slides_to_another_object_only_what_is_beside_its_way_counts(
    off_m, rise_m, gripper_open, severities
):
    group, random = [], np.random.default_rng(8)
    for k in range(10):
        plate_m = np.array([random.uniform(-0.1, 0.1), 0.5, 0.8])
        box_m = np.array([plate_m[0], random.uniform(0.7, 0.9), 0.8])
        here_m = plate_m + (k % 2) * np.array(off_m)
        places_m = (plate_m + np.array([0, 0, 0.1]), here_m, box_m + np.array([0, 0, rise_m]))
        states = (True, gripper_open, gripper_open)
        rows = [action(place_m, gripper_open=state) for place_m, state in zip(places_m, states, strict=True)]
        group.append(demonstration("slide the plate to the box", (pose("plate", plate_m), pose("box", box_m)), rows))
    assert [finding.severity for finding in found(group) if finding.severity == "danger"] == severities


def test_a_hand_that_wipes_to_and_fro_turns_back_at_one_place():
    group = []
    for k in range(10):
        sponge_m = np.array([0.03 * k, 0.1, 0.8])
        along_m = (0.0, 0.15 + 0.04 * (k % 2), 0.0)
        places_m = [sponge_m + np.array([x_m, 0, up_m]) for x_m, up_m in zip(along_m, (0.1, 0, 0), strict=True)]
        rows = [action(place_m) for place_m in (*places_m, sponge_m)]
        group.append(demonstration("wipe the line", (pose("line", sponge_m, 0),), rows))
    (finding,) = found(group)
    assert (finding.severity, finding.where) == ("danger", "actions[1]")


@pytest.mark.parametrize(("rotation", "severities"), [(0, ["danger"]), (None, [])])
def test_ends_around_a_goal_follow_no_yaw_where_none_was_sent_and_no_hand_turns(rotation, severities):
    group = []
    for k, way_deg in enumerate(np.random.default_rng(5).uniform(-50, 50, 10)):
        goal_m = np.array([0.03 * k, 0, 0.8])
        away_m = Rotation.from_euler("z", way_deg, degrees=True).apply([0.05, 0, 0])
        rows = [action(goal_m + away_m + np.array([0, 0, 0.1])), action(goal_m + away_m)]
        group.append(demonstration("reach the goal", (pose("goal", goal_m, rotation),), rows))
    findings = [finding for finding in found(group) if "a yaw that was not sent" in finding.message]
    assert [finding.severity for finding in findings] == severities


def scaled(number, noise_m, seed=0, scale=1.1):
    """Ten grasps, so many of them recorded with a wrong scale of places, so that they scatter beside the others."""
    random, group = np.random.default_rng(seed), []
    for k in range(10):
        cube_m = np.array([*random.uniform((0.2, -0.2), (0.45, 0.2)), 0.8])
        grasp_m = cube_m + random.normal(0, noise_m, 3)
        seen_m = cube_m * [scale, scale, 1.0] if k < number else cube_m
        rows = [action(grasp_m + np.array([0, 0, 0.1])), action(grasp_m, gripper_open=False)]
        group.append(demonstration(INSTRUCTION, (pose("cube", seen_m, 0),), rows))
    return group


@pytest.mark.parametrize("number", [4, 5])
def test_others_beside_a_place_at_which_half_agree_are_no_noise(number):
    findings = [found(scaled(number, 0.001, seed)) for seed in range(20)]
    assert sum([finding.severity for finding in of_set] == ["danger"] for of_set in findings) >= 19


def test_noise_alone_leaves_no_half_that_agrees():
    sets = [scaled(0, noise_m, seed) for noise_m in (0.003, 0.006, 0.012) for seed in range(30)]
    assert not any("agree closely" in finding.message for of_set in sets for finding in found(of_set))
