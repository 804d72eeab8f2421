"""Objects whose rotation only some demonstrations have."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.demonstrations import Taught
from app.pipeline.findings.unmeasured import unmeasured_findings

from roboprompt_client.types import quaternions
from tests.pipeline.scenes import action, demonstration, pose, rotated


def pressed(unturned, *, yaws_deg=(), position_digits=6, number=10):
    """Presses beside a button that is turned; of the first `unturned` the rotation is the identity."""
    random, found = np.random.default_rng(5), []
    for k in range(number):
        at_m = np.array([*random.uniform(-0.2, 0.2, 2), 0.8]).round(position_digits)
        yaw_deg = float(yaws_deg[k] if yaws_deg else random.uniform(-80, 80))
        button = pose("button", at_m, yaw_deg)
        beside_m = at_m + rotated(0, 0, yaw_deg).apply((0.05, 0, 0))
        ups_m = ([0, 0, 0.1], [0, 0, 0.02], [0, 0, 0.1])
        actions = [action(beside_m + up_m, (180, 0, yaw_deg), gripper_open=False) for up_m in ups_m]
        seen = replace(button, quaternion_xyzw=quaternions.IDENTITY) if k < unturned else button
        found.append(demonstration("press the button", (seen,), actions))
    return found


def severities(group):
    return [item.severity for item in unmeasured_findings(group, ("button",))]


@pytest.mark.parametrize(
    ("unturned", "expected"), [(0, []), (1, []), (2, ["danger"]), (5, ["danger"]), (8, ["danger"]), (10, [])]
)
def test_rotations_that_only_some_have_are_a_danger(unturned, expected):
    assert severities(pressed(unturned)) == expected


def test_people_type_poses():
    assert severities(pressed(5, position_digits=3)) == []


def test_only_objects_that_the_motion_follows_count():
    known = Taught(tuple(pressed(5)))
    (found,) = [item for item in known.findings(known.demonstrations[0].order) if item.code == "rotation-not-measured"]
    assert (found.severity, found.where, found.numbers) == ("danger", "objects[button]", {"share": 0.5})
    assert list(unmeasured_findings(pressed(5), ())) == []
