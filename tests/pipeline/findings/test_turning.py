"""Hands that turn with an object only if its rotations mean something else, and those that act beside it."""

from dataclasses import replace

import numpy as np
import pytest
from app.pipeline.findings.yaw import turning_findings
from app.pipeline.plans.support import Support

from app.pipeline.geometry import canonical_pose
from tests.pipeline.scenes import action, demonstration, pose, rotated

TAKE, PUT = "pick up the bar", "put the bar beside the box"


def found(group, symmetry_deg=None, given=None):
    declared = {} if symmetry_deg is None else {"bar": symmetry_deg}
    return [item.code for item in turning_findings(Support.of([group]), group[0].order, declared, given)]


def takes(said_deg, number=10, noise_deg=1.0, most_deg=60.0):
    """Hands that turn with a bar, whose yaw is said to be `said_deg(k, yaw)`."""
    random, group = np.random.default_rng(0), []
    for k in range(number):
        at_m, yaw_deg = (*random.uniform(-0.2, 0.2, 2), 0.8), float(random.uniform(-most_deg, most_deg))
        hand_deg = (180, 0, yaw_deg + random.normal(0, noise_deg))
        rows = [action((*at_m[:2], z_m), hand_deg, gripper_open=z_m == 0.9) for z_m in (0.9, 0.8)]
        group.append(demonstration(TAKE, (pose("bar", at_m, said_deg(k, yaw_deg)),), rows))
    return group


MISREAD = {
    "as it is": (lambda k, deg: deg, []),
    "the wrong sign": (lambda k, deg: -deg, ["w-first", "yaw-misread"]),  # or the hand is mirrored
    "half of it": (lambda k, deg: deg / 2, ["yaw-misread"]),
    "twice": (lambda k, deg: 2 * deg, ["yaw-misread"]),
    "the wrong sign in half": (lambda k, deg: deg * (-1) ** k, ["w-first", "yaw-misread"]),  # or the hand is mirrored
    "half a turn off in half": (lambda k, deg: deg + 180 * (k % 2), ["yaw-misread"]),
    "half a turn off in a third": (lambda k, deg: deg + 180 * (k % 3 == 0), ["yaw-misread"]),
    "another zero": (lambda k, deg: deg + 70, []),
    "by chance": (lambda k, deg: 37.0 * k, ["scattered-demonstrations"]),
    "a quarter turn off in half": (lambda k, deg: deg + 90 * (k % 2), ["scattered-demonstrations"]),
    "never turned": (lambda k, deg: 0.0, ["scattered-demonstrations"]),
}


@pytest.mark.parametrize("case", MISREAD)
def test_a_yaw_that_means_something_else(case):
    said_deg, codes = MISREAD[case]
    assert found(takes(said_deg)) == codes


def test_a_yaw_of_a_round_object_and_those_of_few_demonstrations_say_nothing():
    wrong, _ = MISREAD["the wrong sign"]
    assert found(takes(wrong), 0.0) == found(takes(wrong, number=4)) == []


@pytest.mark.parametrize(
    ("said_deg", "codes"),
    [
        (lambda k, deg: deg, []),
        (lambda k, deg: deg + 180 * (k % 2), []),
        (lambda k, deg: deg if k % 2 else -deg, ["scattered-demonstrations"]),
    ],
    ids=["as it is", "its other side", "the wrong sign in half"],
)
def test_hands_take_a_symmetric_object_alike(said_deg, codes):
    group = takes(said_deg)
    folded = [replace(item, objects=tuple(canonical_pose(each, 180) for each in item.objects)) for item in group]
    given = {item.id: {"bar": item.objects[0].quaternion_xyzw} for item in group}
    assert found(folded, 180.0, given) == codes


@pytest.mark.parametrize(
    ("declared_deg", "turns_deg", "is_misread"),
    [
        (90.0, 360, True),
        (90.0, 90, False),
        (0.0, 180, True),
        (0.0, 90, True),
        (180.0, 180, False),
        (360.0, 360, False),
        (0.0, 1, False),
    ],
)
def test_a_symmetry_that_the_hands_contradict(declared_deg, turns_deg, is_misread):
    """Hands that turn with a square object are the same after a quarter turn, and at a round one at every angle."""
    folded_deg = lambda deg: (deg + turns_deg / 2) % turns_deg - turns_deg / 2  # noqa: E731
    given_deg = {str(k): 47.0 * k for k in range(10)}
    group = [
        demonstration(
            TAKE,
            (canonical_pose(pose("bar", (0.03 * k, 0, 0.8), deg), declared_deg),),
            [action((0.03 * k, 0, z_m), (180, 0, folded_deg(deg)), gripper_open=z_m == 0.9) for z_m in (0.9, 0.8)],
        )
        for k, deg in enumerate(given_deg.values())
    ]
    group = [replace(item, id=id_) for item, id_ in zip(group, given_deg, strict=True)]
    given = {id_: {"bar": rotated(0, 0, deg).as_quat()} for id_, deg in given_deg.items()}
    assert found(group, declared_deg, given) == ["yaw-misread"] * is_misread
