"""Recordings in other units, frames or conventions are refused or reported with the likely cause."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.pipeline.findings.units import check_recording_units, unit_findings
from app.pipeline.keyframes import Motion
from roboprompt_client.camera import Camera
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose, Trajectory

FRAMES, RATE_HZ = 60, 20.0
TIMES_S = np.arange(FRAMES) / RATE_HZ


def recording(reach_m=0.4, turn=None):
    """A hand that goes straight down onto a cube and closes, while two joints turn."""
    share = np.linspace(0, 1, FRAMES)[:, None]
    positions_m = np.array([0.5, 0.1, 0.02 + reach_m]) - share * [0, 0, reach_m]
    turn = Rotation.from_quat([1, 0, 0, 0]) if turn is None else turn
    angles_rad = share * [0.9, -1.2]
    return Trajectory(
        np.gradient(angles_rad, TIMES_S, axis=0),
        positions_m,
        np.tile(turn.as_quat(), (FRAMES, 1)),
        (share[:, 0] < 0.98),
        joint_positions_rad=angles_rad,
    )


def cube(x_m=0.5):
    return ObjectPose("cube", np.array([x_m, 0.1, 0.02]))


def checked(trajectory, cameras=(), rate_hz=RATE_HZ):
    check_recording_units(Motion.of(trajectory, rate_hz), [cube()], cameras)


def camera(away_m):
    transform = np.eye(4)
    transform[:3, 3] = away_m
    return Camera("front", 500, 500, 320, 240, transform)


def test_a_right_recording_passes():
    checked(recording(), [camera(1.2)])
    assert not list(unit_findings(recording(), [cube()]))


@pytest.mark.parametrize("slow", [1.0, 0.2])
@pytest.mark.parametrize("positions", [True, False])
def test_joint_velocities_in_degrees_contradict_the_joints_or_the_hand(slow, positions):
    right = recording()
    wrong = replace(
        right,
        joint_velocities_rad_s=np.degrees(right.joint_velocities_rad_s) * slow,
        joint_positions_rad=right.joint_positions_rad * slow if positions else None,
    )
    with pytest.raises(InvalidInputError, match="likely degrees per second") as caught:
        checked(wrong, rate_hz=RATE_HZ * slow)
    assert caught.value.field == "trajectory.joint_velocities"


def test_a_hand_that_approaches_along_its_axis_only_if_w_came_first():
    turned = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_quat([1, 0, 0, 0])
    right = recording(turn=turned)
    checked(right)
    wrong = replace(right, quaternions_xyzw=np.roll(right.quaternions_xyzw, 1, axis=1))
    with pytest.raises(InvalidInputError, match="only if w comes first") as caught:
        checked(wrong)
    assert caught.value.field == "trajectory.end_effector_quaternions_xyzw"


@pytest.mark.parametrize(
    ("turn", "way_m"),
    [([1.0, 0, 0, 0], [0, 0, 0.2]), ([0.7071068, 0.7071068, 0, 0], [0, -0.2, 0])],
    ids=["up, before it closes", "across, to push"],
)
def test_a_hand_that_points_down_may_move_elsewhere_before_it_closes(turn, way_m):
    """Meta-World's drawers are closed so."""
    steps = np.linspace(0, 1, 40)[:, None]
    positions_m = np.array([0.5, 0.1, 0.2]) + np.concatenate([steps * way_m, np.tile(way_m, (10, 1))])
    closes = np.r_[np.ones(42), np.zeros(8)]
    checked(Trajectory.from_poses(positions_m, np.tile(turn, (50, 1)), closes, np.arange(50) / 20))


def test_an_object_that_the_hand_never_comes_near_is_in_another_frame():
    (finding,) = unit_findings(recording(), [cube(-0.3)])
    assert (finding.code, finding.severity, finding.where) == ("far-from-objects", "warning", "objects[cube].position")
    assert finding.numbers["away_m"] == pytest.approx(0.8)
    assert not list(unit_findings(recording(), [cube(-0.3), replace(cube(), name="bowl")]))


def test_a_camera_placed_in_centimetres_is_refused():
    with pytest.raises(InvalidInputError, match="likely centimetres") as caught:
        checked(recording(), [camera(25.0)])
    assert caught.value.field == "cameras[front].camera_to_world"


def test_two_frames_are_few():
    two = Trajectory.from_poses([[0.5, 0.1, 0.4], [0.5, 0.1, 0.02]], [[1, 0, 0, 0]] * 2, [1, 0])
    assert [finding.code for finding in unit_findings(two, [cube()])] == ["few-frames"]
