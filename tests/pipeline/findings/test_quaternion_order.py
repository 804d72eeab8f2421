"""Objects with w first: refused where no correct scene looks like that, a danger where demonstrations show it."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.quaternion_order import (
    check_objects_order,
    objects_order_findings,
    tilted_about_x,
)
from scipy.spatial.transform import Rotation

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.poses import ObjectPose
from tests.pipeline.scenes import action, demonstration


def object_at(name, turn, w_first=False):
    quaternion = turn.as_quat()
    return ObjectPose(name, np.array([0.3, 0.0, 0.8]), np.roll(quaternion, 1) if w_first else quaternion)


def yawed(name, deg, **order):
    return object_at(name, Rotation.from_euler("z", deg, degrees=True), **order)


def tilted(name, deg, yaw_deg=0.0):
    return object_at(name, Rotation.from_euler("zx", [yaw_deg, deg], degrees=True))


@pytest.mark.parametrize("deg", [90, -90, 180, 37])
def test_one_object_that_lies_or_is_inclined_about_x_is_no_error_but_a_warning(deg):
    objects = (tilted("bottle", deg), object_at("cup", Rotation.identity()))
    check_objects_order(objects)
    check_objects_order(objects[:1])
    assert tilted_about_x(objects) == ("bottle",)


def test_bottles_side_by_side_and_upright_objects_are_no_error():
    check_objects_order([tilted("bottle", 90), tilted("other bottle", 90), tilted("glass", 180)])
    assert tilted_about_x([yawed("cup", 40), tilted("bottle", 90, yaw_deg=30)]) == ()


def test_objects_with_w_first_at_different_yaws_are_refused():
    with pytest.raises(InvalidInputError, match="upright only if w comes first"):
        check_objects_order([yawed("cup", 20, w_first=True), yawed("plate", -40, w_first=True)])


def taught(poses):
    return [
        replace(demonstration("take it", [pose], (action((0.3, 0, 0.8)),)), id=f"e{k}") for k, pose in enumerate(poses)
    ]


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0])
def test_an_object_with_w_first_in_some_demonstrations_is_a_danger(share):
    yaws_deg = np.random.default_rng(0).uniform(-45, 45, 10)
    shown = taught([yawed("cup", deg, w_first=k < 10 * share) for k, deg in enumerate(yaws_deg)])
    assert [finding.severity for finding in objects_order_findings(shown)] == ["danger"]


RIGHT = {
    "upright": [yawed("cup", deg) for deg in (0, 20, -70, 170)],
    "turned over in half": [tilted("cup", deg) for deg in (0, 180, 0, 180)],
    "a lid that is opened about x": [tilted("lid", deg) for deg in (0, 70, 100, 120)],
    "lying at any yaw": [tilted("cup", 90, yaw_deg=deg) for deg in (0, 20, -70, 170)],
    "lying about x": [tilted("cup", 90) for _ in range(4)],
    "too few": [yawed("cup", deg, w_first=deg > 0) for deg in (-20, 20)],
}


@pytest.mark.parametrize("case", RIGHT)
def test_correct_demonstrations_have_no_such_danger(case):
    assert list(objects_order_findings(taught(RIGHT[case]))) == []
