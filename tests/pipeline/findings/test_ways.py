"""Several ways under one instruction: a tap is turned the other way round, a gripper takes a can half a turn apart."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.several_ways import ways_findings

from tests.pipeline.scenes import action, demonstration, pose

WORDS = "turn the tap"
ROUND = {"tap": 0.0}


def turned(by_deg, random, plan):
    """The hand takes the tap, which it turns with, turns it and lets go."""
    tap_m, yaw_deg = random.uniform((-0.2, -0.3, 0.8), (0.3, 0.3, 0.8)), float(random.uniform(-20, 20))
    above_m = np.add(tap_m, (0, 0, 0.1))
    half_deg, all_deg = yaw_deg + by_deg / 2, yaw_deg + by_deg
    actions = (
        action(above_m, (180, 0, yaw_deg)),
        action(tap_m, (180, 0, yaw_deg), gripper_open=False),
        action(tap_m, (180, 0, half_deg), gripper_open=False),
        action(tap_m, (180, 0, all_deg)),
    )
    return replace(demonstration(WORDS, [pose("tap", tap_m, yaw_deg)], actions), plan=plan, id=f"{by_deg}")


def inserted(by_deg, random, plan):
    """The hand takes a peg, and lets go of it in the socket, turned as the socket is, and by so much more."""
    places_m, degs = random.uniform((-0.2, -0.3, 0.8), (0.3, 0.3, 0.8), (2, 3)), random.uniform(-40, 40, 2).tolist()
    (peg_m, socket_m), (peg_deg, socket_deg) = places_m, degs
    actions = (
        action(np.add(peg_m, (0, 0, 0.1)), (180, 0, peg_deg)),
        action(peg_m, (180, 0, peg_deg), gripper_open=False),
        action(np.add(socket_m, (0, 0, 0.1)), (180, 0, socket_deg + by_deg), gripper_open=False),
        action(socket_m, (180, 0, socket_deg + by_deg)),
    )
    objects = [pose("peg", peg_m, peg_deg), pose("socket", socket_m, socket_deg)]
    return replace(demonstration("insert the peg into the socket", objects, actions), plan=plan, id=f"{by_deg}")


@pytest.mark.parametrize(("other_deg", "ways"), [(180.0, 1), (90.0, 1), (0.0, 0)])
def test_a_hand_that_is_turned_otherwise_where_it_lets_go_is_another_way(other_deg, ways):
    """Of both together the hand seems to turn with neither; of each it turns with the socket."""
    random = np.random.default_rng(0)
    alike = [inserted(other_deg * (k % 2), random, plan=k % 2) for k in range(10)]
    assert len([*ways_findings(alike, [], {}, declared=False)]) == ways


def carried(random, plan, grasp_deg=0.0, release_deg=0.0, down_deg=180):
    """A can is put onto a tray, the hand turned by these angles about the vertical where it grasps and releases."""
    can_m, tray_m = random.uniform((-0.2, -0.3, 0.8), (0.3, 0.0, 0.8)), random.uniform((0, 0.1, 0.8), (0.3, 0.4, 0.8))
    taking, placing = (down_deg, 0, grasp_deg), (down_deg, 0, release_deg)
    actions = (
        action(np.add(can_m, (0, 0, 0.1)), taking),
        action(can_m, taking, gripper_open=False),
        action(np.add(can_m, (0, 0, 0.1)), taking, gripper_open=False),
        action(np.add(tray_m, (0, 0, 0.1)), placing, gripper_open=False),
        action(tray_m, placing),
    )
    shown = demonstration("put the can onto the tray", [pose("can", can_m), pose("tray", tray_m)], actions)
    return replace(shown, plan=plan, id=f"{grasp_deg} {release_deg}")


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ({"grasp_deg": 180, "release_deg": 180}, []),  # fingers exchanged: what is held moves alike
        ({"release_deg": 180}, ["danger"]),  # the can ends up half a turn apart
        ({"grasp_deg": 90, "release_deg": 90}, ["danger"]),
    ],
)
def test_a_half_turn_of_the_gripper_is_no_other_way(other, expected):
    random = np.random.default_rng(0)
    alike = [carried(random, 0) if k % 2 else carried(random, 1, **other) for k in range(10)]
    assert [finding.severity for finding in ways_findings(alike, [], {}, declared=False)] == expected


@pytest.mark.parametrize(("other_deg", "expected"), [(-110.0, ["danger"]), (100.0, [])])
@pytest.mark.parametrize("declared", [False, True])
def test_demonstrations_that_turn_something_the_other_way_are_another_way(other_deg, expected, declared):
    random = np.random.default_rng(0)
    alike = [turned(110.0 if k % 2 else other_deg, random, plan=k % 2) for k in range(10)]
    found = ways_findings(alike, [], ROUND, declared=declared)
    assert [finding.severity for finding in found] == (["info"] * len(expected) if declared else expected)
