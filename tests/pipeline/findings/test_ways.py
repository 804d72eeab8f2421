"""Several ways under one instruction: a tap that half of the demonstrations turn the other way round."""

from dataclasses import replace

import numpy as np
import pytest

from app.pipeline.findings.ways import ways_findings
from tests.pipeline.scenes import action, demonstration, pose

WORDS = "turn the tap"
ROUND = frozenset({"tap"})


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
    assert len([*ways_findings(alike, [], frozenset(), declared=False)]) == ways


def test_keyframes_that_are_not_aligned_may_be_of_any_number():
    """As of the rule `uniform`; only the gripper tells ways apart then."""
    random, shown = np.random.default_rng(0), []
    for k in range(12):
        item = inserted(0.0, random, None)
        longer = (*item.actions, item.actions[-1]) if k % 3 else item.actions
        actions = longer if k % 2 else tuple(replace(each, gripper_open=False) for each in longer)
        shown.append(replace(item, actions=actions, plan=None))
    (found,) = ways_findings(shown, [], frozenset(), declared=False)
    assert found.severity == "danger"
