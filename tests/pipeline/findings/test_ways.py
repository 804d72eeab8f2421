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


@pytest.mark.parametrize(("other_deg", "expected"), [(-110.0, ["danger"]), (100.0, [])])
@pytest.mark.parametrize("declared", [False, True])
def test_demonstrations_that_turn_something_the_other_way_are_another_way(other_deg, expected, declared):
    random = np.random.default_rng(0)
    alike = [turned(110.0 if k % 2 else other_deg, random, plan=k % 2) for k in range(10)]
    found = ways_findings(alike, [], ROUND, declared=declared)
    assert [finding.severity for finding in found] == (["info"] * len(expected) if declared else expected)
