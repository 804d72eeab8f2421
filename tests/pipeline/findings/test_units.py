"""Recordings in other units, frames or conventions are refused or reported with the likely cause.

Among them is every row of the table of conventions in docs/your-arm.md: what a library says, uploaded as it is.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from app.pipeline.findings.units import check_recording, unit_findings
from scipy.spatial.transform import Rotation

from app.pipeline.keyframes import Motion
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import Camera
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import Trajectory, trajectory_from_arrays

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
    check_recording(Motion.of(trajectory, rate_hz), [cube()], cameras)


def camera(away_m, axes=(1.0, -1.0, -1.0)):
    """It looks down; with other `axes` (3,) up."""
    transform = np.diag([*axes, 1.0])
    transform[:3, 3] = away_m
    return Camera("front", 500, 500, 320, 240, transform)


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


def test_two_frames_are_few():
    two = Trajectory.from_poses([[0.5, 0.1, 0.4], [0.5, 0.1, 0.02]], [[1, 0, 0, 0]] * 2, [1, 0])
    assert [finding.code for finding in unit_findings(two, [cube()])] == ["few-frames"]


PAGE = Path(__file__).parents[3] / "docs/your-arm.md"
HAND, TURN, GRIPPER = "end_effector_positions", "end_effector_quaternions_xyzw", "gripper_open"
ANGLES, RATES, WIDTH, TIMES = "joint_positions", "joint_velocities", "gripper_width", "timestamps"
BASE_M = np.array([-0.3, 0.0, 0.752])


def right():
    """The arrays of a right recording, each by its name."""
    made = recording(turn=Rotation.from_euler("z", 90, degrees=True) * Rotation.from_quat([1, 0, 0, 0]))
    arrays = {HAND: made.positions_m, TURN: made.quaternions_xyzw, GRIPPER: made.gripper_open.astype(float)}
    widths_m = np.where(made.gripper_open, 0.08, 0.02)
    joints = {ANGLES: made.joint_positions_rad, RATES: made.joint_velocities_rad_s}
    return {**arrays, **joints, WIDTH: widths_m, TIMES: TIMES_S}


def doubts(arrays, objects=None, cameras=()):
    """The codes of what is found."""
    objects = [cube()] if objects is None else objects
    trajectory = trajectory_from_arrays(arrays)
    check_recording(Motion.of(trajectory, RATE_HZ), objects, cameras)
    return [finding.code for finding in unit_findings(trajectory, objects)]


# By the table's rows: what is taken as that library has it -> the field that is refused
REFUSED = {
    "UR: a rotation vector": ({TURN: np.zeros((FRAMES, 3))}, TURN),
    "UR: the output that closes": ({GRIPPER: 1 - right()[GRIPPER]}, GRIPPER),
    "xArm: millimeters": ({HAND: 1000 * right()[HAND]}, HAND),
    "xArm: roll pitch yaw": ({TURN: np.tile([180.0, 0.0, 0.0], (FRAMES, 1))}, TURN),
    "xArm: pulses": ({WIDTH: 10_000 * right()[WIDTH]}, WIDTH),
    "xArm: degrees": ({ANGLES: np.degrees(right()[ANGLES])}, ANGLES),
    "xArm: degrees per second": ({RATES: np.degrees(right()[RATES])}, RATES),
    "LeRobot: per cent": ({GRIPPER: 100 * right()[GRIPPER]}, GRIPPER),
    "LeRobot: degrees": ({ANGLES: np.degrees(right()[ANGLES]), RATES: None}, ANGLES),
    "ROS 2: stamps in nanoseconds": ({TIMES: 1.7e18 + 1e9 * TIMES_S}, TIMES),
    "ROS 2: stamps in milliseconds": ({TIMES: 1000 * TIMES_S}, TIMES),
    "openpi: 1 closed": ({GRIPPER: 1 - right()[GRIPPER]}, GRIPPER),
    "openpi: Euler angles": ({TURN: np.zeros((FRAMES, 3))}, TURN),
    "MuJoCo: w first": ({TURN: np.roll(right()[TURN], 1, axis=1)}, TURN),
}


def test_the_right_recording_has_no_doubts():
    assert doubts(right(), cameras=[camera(1.2)]) == []


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_in_another_unit_or_order_is_refused(case):
    changes, field = REFUSED[case]
    arrays = {name: array for name, array in {**right(), **changes}.items() if array is not None}
    with pytest.raises(InvalidInputError) as caught:
        doubts(arrays)
    assert caught.value.field == f"trajectory.{field}"


@pytest.mark.parametrize("row", ["Franka", "UR", "xArm", "LeRobot", "ROS 2", "openpi"])
def test_a_hand_in_the_base_s_frame_is_found(row):
    assert row in _rows()
    assert doubts({**right(), HAND: right()[HAND] - BASE_M}) == ["far-from-objects"]


def test_objects_and_cameras_in_millimeters_are_refused():
    with pytest.raises(InvalidInputError, match=r"objects\[cube\]\.position.*likely millimeters"):
        doubts(right(), [ObjectPose("cube", 1000 * cube().position_m)])
    for away, unit in ((1200.0, "probably millimeters"), (25.0, "likely centimeters")):
        with pytest.raises(InvalidInputError, match=rf"cameras\[front\]\.camera_to_world.*{unit}"):
            doubts(right(), cameras=[camera(away)])


def test_opengl_axes_put_everything_behind_the_camera():
    with pytest.raises(InvalidInputError, match=r"cameras\[front\]\.camera_to_world.*behind the camera: OpenGL's axes"):
        doubts(right(), cameras=[camera(1.2, axes=(1.0, 1.0, 1.0))])


def test_every_row_that_differs_from_ours_has_a_case():
    """RLBench has our conventions."""
    assert {case.partition(":")[0] for case in REFUSED} - {"MuJoCo"} == _rows() - {"RoboPrompt", "RLBench", "Franka"}


def _rows():
    table = PAGE.read_text().partition("\n## Conventions\n")[2].partition("\n\nCameras:")[0]
    names = re.findall(r"^\| \**([\w ]+?)\**(?: \(.*?\)| SDK)? \|", table, re.MULTILINE)
    return set(names)
