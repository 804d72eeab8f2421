"""A hand that contradicts a Franka's joints is refused, and why is named; arms of other makers are not judged."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.findings.joints import check_joints
from app.pipeline.findings.units import flange_findings
from app.pipeline.keyframes import Motion
from roboprompt_client.arms.panda import READY_RAD, flange
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import Trajectory

BASE, BASE_M = Rotation.from_euler("zyx", [70, 3, -2], degrees=True), np.array([0.3, -0.2, 0.6])
TOOL, TOOL_M = Rotation.from_euler("zx", [-45, 25], degrees=True), np.array([0.01, 0.02, 0.15])
MIRROR_Y = np.array([1.0, -1.0, 1.0])


def franka(seed, turns_rad=0.5):
    """A Franka whose joints go to and fro about its ready pose; base and tool are turned and moved."""
    random = np.random.default_rng(seed)
    times_s = np.arange(100) / 20
    rates, phases = random.uniform(0.3, 0.9, 7), random.uniform(0, 6, 7)
    angles_rad = READY_RAD + turns_rad * np.sin(rates * times_s[:, None] + phases)
    flanges = np.array([flange(angles)[0] for angles in angles_rad])
    at_flange = Rotation.from_matrix(flanges[:, :3, :3])
    positions_m = BASE.apply(flanges[:, :3, 3] + at_flange.apply(TOOL_M)) + BASE_M
    return Trajectory(
        np.gradient(angles_rad, times_s, axis=0),
        positions_m,
        (BASE * at_flange * TOOL).as_quat(),
        np.ones(len(times_s)),
        times_s,
        angles_rad,
    )


def turned(change):
    return lambda item: replace(item, quaternions_xyzw=change(item.quaternions_xyzw))


def mirrored(item):
    return replace(item, positions_m=item.positions_m * MIRROR_Y)


@pytest.mark.parametrize("seed", range(20))
def test_a_franka_with_any_base_and_tool_is_accepted(seed):
    check_joints(Motion.of(franka(seed)))
    check_joints(Motion.of(franka(seed, turns_rad=0.02)))


@pytest.mark.parametrize(("seed", "turns_rad"), [(0, 0.231), (2, 0.133), (8, 0.11), (16, 0.125)])
def test_a_path_near_the_least_width_is_not_taken_for_a_left_handed_one(seed, turns_rad):
    """A reversed axis fits a narrow path, too, but not as well."""
    for near_rad in np.linspace(0.99 * turns_rad, 1.01 * turns_rad, 9):
        check_joints(Motion.of(franka(seed, near_rad)))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (turned(lambda q: np.roll(q, 1, axis=1)), "w first"),
        (turned(lambda q: q * [-1, -1, -1, 1]), "inverted"),
        (turned(lambda q: q * [-1, 1, -1, 1]), "mirrored in y"),
        (turned(lambda q: q[:, [1, 0, 2, 3]]), "otherwise than a Franka's joints turn its hand"),
        (mirrored, "left-handed frame"),
    ],
)
def test_a_wrong_convention_is_refused_and_named(wrong, named):
    for seed in range(5):
        with pytest.raises(InvalidInputError, match=named):
            check_joints(Motion.of(wrong(franka(seed))))


def test_another_arm_of_seven_joints_is_not_judged():
    """Its joints are within a Franka's limits; that w is first cannot be known then."""
    for seed in range(5):
        item = franka(seed)
        slower = np.array(READY_RAD) + (item.joint_positions_rad - READY_RAD)[:, ::-1] / 2
        check_joints(Motion.of(turned(lambda q: np.roll(q, 1, axis=1))(replace(item, joint_positions_rad=slower))))


def gripping(item, tool_m, noise_m=0.0):
    """The same motion with a tip at `tool_m` on the flange, and a gripper that closes half-way."""
    at_flange = np.array([flange(angles)[0] for angles in item.joint_positions_rad])
    tips_m = BASE.apply(at_flange[:, :3, 3] + at_flange[:, :3, :3] @ tool_m) + BASE_M
    noisy_m = tips_m + np.random.default_rng(0).normal(0, noise_m, tips_m.shape)
    return Motion.of(replace(item, positions_m=noisy_m, gripper_open=np.arange(len(item)) < len(item) / 2))


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("noise_m", [0.0, 0.0005])
def test_a_flange_is_noticed_and_a_tool_is_not(seed, noise_m):
    item = franka(seed)
    codes = [
        [finding.code for finding in flange_findings(gripping(item, np.array(tool_m), noise_m))]
        for tool_m in ((0, 0, 0), (0, 0, 0.1034), TOOL_M)
    ]
    assert codes == [["hand-is-the-flange"], [], []]


def test_a_hand_that_does_not_grip_or_hardly_turns_is_not_judged():
    item = franka(0)
    still = replace(gripping(item, np.zeros(3)).trajectory, gripper_open=np.ones(len(item)))
    assert not list(flange_findings(Motion.of(still)))
    assert not list(flange_findings(gripping(franka(0, turns_rad=0.002), np.array([0, 0, 0.1034]), 0.001)))
