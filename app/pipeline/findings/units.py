"""Numbers that can only be meant in other units or conventions are refused, with the likely cause."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.keyframes.waypoints import hand_speeds_m_s
from app.pipeline.workspace import Workspace
from roboprompt_client.arrays import Array
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.trajectory import ObjectPose, Trajectory

MOST_MOTION_M = 3.0  # along an axis: no arm on a table reaches farther
MOST_AWAY_M = 3.0  # of an object from all places where the hand was
MOST_JOINT_RAD_S = 30.0  # several times what arms turn
FAST_JOINT_RAD_S = 6.0
LEAST_HAND_M_PER_RAD = 0.02  # how far a turning joint moves or turns the hand, at the least
MOST_JOINT_RAD = 4 * np.pi
UPRIGHT_DEG = 5.0
OFF_UPRIGHT_DEG = 20.0
DOWN_DEG = 10.0
UNITS_PER_M = {"millimetres": 1000.0, "centimetres": 100.0}


def check_recording_units(trajectory: Trajectory, objects: Sequence[ObjectPose], times_s: Array) -> None:
    """Refuse a recording whose numbers are not metres, radians and quaternions xyzw.

    Args:
        objects: those whose poses came with the recording.
        times_s: (T,) of the frames.

    Raises:
        InvalidInputError: naming the field and what the numbers probably are.
    """
    _check_positions(trajectory, objects)
    _check_joints(trajectory, times_s)
    _check_quaternion_order(trajectory, objects)


def check_scene_units(objects: Sequence[ObjectPose], workspace: Workspace) -> None:
    """Refuse observed objects whose positions are not in metres, seen from the workspace of their task.

    Raises:
        InvalidInputError: as `check_recording_units`.
    """
    for pose in objects:
        away_m = np.maximum(workspace.min_m - pose.position_m, pose.position_m - workspace.max_m).max()
        for unit, factor in UNITS_PER_M.items():
            if away_m > MOST_AWAY_M and workspace.contains(pose.position_m / factor):
                message = f"is {pose.position_m.round(3).tolist()}, which is likely in {unit}"
                raise InvalidInputError(f"objects[{pose.name}].position", message, "metres, world frame")
    _check_objects_order(objects)


def _check_positions(trajectory: Trajectory, objects: Sequence[ObjectPose]) -> None:
    positions_m = trajectory.positions_m
    extent_m = float(np.ptp(positions_m, axis=0).max())
    if extent_m > MOST_MOTION_M:
        message = f"spans {extent_m:.4g} along an axis, which is likely in {_likely(extent_m)}"
        raise InvalidInputError("trajectory.end_effector_positions", message, "metres, world frame")
    for pose in objects:
        away_m = float(np.linalg.norm(positions_m - pose.position_m, axis=1).min())
        if away_m > MOST_AWAY_M:
            message = f"is {away_m:.4g} from the nearest place of the hand: likely {_likely(away_m)}, or another frame"
            raise InvalidInputError(f"objects[{pose.name}].position", message, "metres, world frame as the hand's")


def _likely(extent: float) -> str:
    return "millimetres" if extent > 100 * MOST_MOTION_M / 3 else "centimetres or millimetres"


def _check_joints(trajectory: Trajectory, times_s: Array) -> None:
    angles_rad = trajectory.joint_positions_rad
    if angles_rad is not None and (most := float(np.abs(angles_rad).max())) > MOST_JOINT_RAD:
        raise InvalidInputError("trajectory.joint_positions", f"reaches {most:.4g}: likely degrees", "radians")
    speeds_rad_s = np.linalg.norm(trajectory.joint_velocities_rad_s, axis=1)
    fastest = float(speeds_rad_s.max())
    moving = speeds_rad_s > fastest / 10
    hand = hand_speeds_m_s(trajectory, times_s)
    idle = float(np.median(hand[moving] / speeds_rad_s[moving])) < LEAST_HAND_M_PER_RAD if fastest > 0 else False
    if fastest > MOST_JOINT_RAD_S or (fastest > FAST_JOINT_RAD_S and idle):
        message = f"reaches {fastest:.4g} (norm over the joints): likely degrees per second"
        raise InvalidInputError("trajectory.joint_velocities", message, "rad/s")


def _check_quaternion_order(trajectory: Trajectory, objects: Sequence[ObjectPose]) -> None:
    """A hand that would point straight down all the time, and objects that would stand upright, if w came first."""
    _check_objects_order(objects)
    quaternions = trajectory.quaternions_xyzw
    as_read, as_meant = _off_axis_deg(quaternions, -1.0), _off_axis_deg(np.roll(quaternions, -1, axis=1), -1.0)
    turns = np.abs(quaternions @ quaternions[0]).min() < np.cos(np.radians(DOWN_DEG / 2))
    if turns and as_meant.max() < DOWN_DEG and as_read.max() > OFF_UPRIGHT_DEG:
        message = "are a hand that points straight down only if w comes first"
        raise InvalidInputError("trajectory.end_effector_quaternions_xyzw", message, "order x y z w")


def _check_objects_order(objects: Sequence[ObjectPose]) -> None:
    turned = [pose for pose in objects if pose.quaternion_xyzw is not None]
    if not turned:
        return
    quaternions = np.array([pose.quaternion_xyzw for pose in turned])
    as_read, as_meant = _off_axis_deg(quaternions, 1.0), _off_axis_deg(np.roll(quaternions, -1, axis=1), 1.0)
    if as_read.max() > OFF_UPRIGHT_DEG and as_meant.max() < UPRIGHT_DEG:
        place = int(np.argmax(as_read))
        message = f"is {quaternions[place].round(4).tolist()}: upright only if w comes first"
        raise InvalidInputError(f"objects[{turned[place].name}].quaternion_xyzw", message, "order x y z w")


def _off_axis_deg(quaternions_xyzw: Array, up: float) -> Array:
    """(N,) angles between the rotations' z axes and straight up (1) or down (-1)."""
    heights = Rotation.from_quat(quaternions_xyzw).apply([0.0, 0.0, 1.0])[:, 2]
    angles: Array = np.degrees(np.arccos(np.clip(up * heights, -1, 1)))
    return angles
