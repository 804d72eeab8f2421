"""Refuses recordings without motion and numbers in other units, naming the likely cause."""

from collections.abc import Iterator, Sequence

import numpy as np

from app.pipeline.findings import Finding
from app.pipeline.findings.quaternion_order import check_hand_order, check_objects_order, tilted_about_x
from app.pipeline.keyframes import Motion
from app.pipeline.workspace import Workspace
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types import quaternions
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.camera import Camera
from roboprompt_client.types.poses import ObjectPose
from roboprompt_client.types.trajectory import Trajectory

MAX_MOTION_M = 3.0  # along an axis: no arm on a table reaches farther
MAX_AWAY_M = 3.0  # the distance of an object from the hand's path
MAX_CAMERA_M = 20.0  # from the hand
NEAR_OBJECT_M = 0.3  # the farthest in correct recordings was 0.07 m, from a door's hinge
FEW_FRAMES = 5
MANY_FRAMES, MAX_FRAME_S = 20, 5.0  # no recording has this many frames this far apart
MAX_TRACK_M = 0.1  # between an object's pose and its track at the first frame: many times an estimator's error
MIN_OPENING_M = 0.003
MIN_MOTION_M, MIN_MOTION_DEG = 0.005, 3.0  # a hand that moves less does nothing
MAX_JOINT_RAD_S = 30.0  # several times the speed of an arm
FAST_JOINT_RAD_S = 2.0
MIN_JOINT_RAD_S = 0.05  # below this a rate from positions is mostly noise
MAX_RATE_RATIO = 20.0  # of joint velocities to the derivative of joint positions: 57 if they are in degrees
MIN_HAND_M_PER_RAD = 0.02  # the least motion of the hand for a joint's turn
MAX_JOINT_RAD = 4 * np.pi
UNITS_PER_M = {"millimeters": 1000.0, "centimeters": 100.0}


def check_recording(motion: Motion, objects: Sequence[ObjectPose], cameras: Sequence[Camera] = ()) -> None:
    """Refuse a recording without motion, or whose numbers are not meters, radians and quaternions xyzw.

    Raises:
        InvalidInputError: naming the field and what the numbers probably are.
    """
    _check_moves(motion)
    _check_times(motion.trajectory)
    _check_positions(motion.trajectory.positions_m, objects, cameras)
    _check_tracks(motion.trajectory, objects)
    _check_fingers(motion.trajectory)
    _check_joints(motion)
    check_objects_order(objects)
    check_hand_order(motion)


def unit_findings(trajectory: Trajectory, objects: Sequence[ObjectPose]) -> Iterator[Finding]:
    """Yield findings about units, frames and rates that are probably wrong, but may be meant."""
    if len(trajectory) < FEW_FRAMES:
        message = f"The recording has only {len(trajectory)} frames. Record at a higher rate."
        numbers = {"num_frames": len(trajectory)}
        yield Finding("few-frames", "warning", message, "trajectory", numbers)
    if tilted := tilted_about_x(objects):
        message = (
            f"By its quaternion {', '.join(tilted)} is tilted about the x axis, and upright if w comes first. If it"
            " stands upright, send quaternions in the order x y z w."
        )
        where = f"objects[{tilted[0]}].quaternion_xyzw"
        yield Finding("tilted-about-x", "warning", message, where, {"num_objects": len(tilted)})
    away_m = {
        pose.name: float(np.linalg.norm(trajectory.positions_m - pose.position_m, axis=1).min()) for pose in objects
    }
    if away_m and min(away_m.values()) > NEAR_OBJECT_M:
        name = min(away_m, key=lambda name: away_m[name])
        message = (
            f"The hand stays {away_m[name]:.2f} m or more away from every object (nearest: {name}). Give the positions"
            " of hand and objects in one frame, not one in the robot's base and the other in the world."
        )
        yield Finding("far-from-objects", "warning", message, f"objects[{name}].position", {"away_m": away_m[name]})


def check_scene_units(objects: Sequence[ObjectPose], workspace: Workspace) -> None:
    """Refuse observed objects whose positions are not in meters, judged by the task's workspace.

    Raises:
        InvalidInputError: as `check_recording`.
    """
    for pose in objects:
        check_meters(f"objects[{pose.name}].position", pose.position_m, workspace)
    check_objects_order(objects)


def check_meters(field: str, position_m: Array, workspace: Workspace) -> None:
    """Refuse a place (3,) far from the workspace, which lies within it if its unit is another one.

    Raises:
        InvalidInputError: names the field and the unit.
    """
    away_m = np.maximum(workspace.min_m - position_m, position_m - workspace.max_m).max()
    for unit, factor in UNITS_PER_M.items():
        if away_m > MAX_AWAY_M and workspace.contains(position_m / factor):
            message = f"is {position_m.round(3).tolist()}, which is likely in {unit}"
            raise InvalidInputError(field, message, "meters, world frame")


def _check_moves(motion: Motion) -> None:
    trajectory = motion.trajectory
    away_m = float(np.linalg.norm(trajectory.positions_m - trajectory.positions_m[0], axis=1).max())
    turns_rad = quaternions.angles_rad(trajectory.quaternions_xyzw, trajectory.quaternions_xyzw[0])
    turned_deg = float(np.degrees(turns_rad).max())
    if away_m < MIN_MOTION_M and turned_deg < MIN_MOTION_DEG and not motion.gripper_changes:
        message = f"moves the hand by {1000 * away_m:.1f} mm and {turned_deg:.1f} degrees in {len(motion)} frames"
        raise InvalidInputError("trajectory", message, "a demonstration in which the robot moves: record it again")


def _check_times(trajectory: Trajectory) -> None:
    if trajectory.timestamps_s is None or len(trajectory) < MANY_FRAMES:
        return
    if (usual_s := float(np.median(np.diff(trajectory.timestamps_s)))) > MAX_FRAME_S:
        message = f"has {len(trajectory)} frames {usual_s:.4g} apart: likely milliseconds"
        raise InvalidInputError("trajectory.timestamps", message, "seconds")


def _check_positions(positions_m: Array, objects: Sequence[ObjectPose], cameras: Sequence[Camera]) -> None:
    extent_m = float(np.ptp(positions_m, axis=0).max())
    if extent_m > MAX_MOTION_M:
        message = f"spans {extent_m:.4g} along an axis, which is likely in {_likely(extent_m)}"
        raise InvalidInputError("trajectory.end_effector_positions", message, "meters, world frame")
    for pose in objects:
        away_m = float(np.linalg.norm(positions_m - pose.position_m, axis=1).min())
        if away_m > MAX_AWAY_M:
            message = f"is {away_m:.4g} from the nearest place of the hand: likely {_likely(away_m)}, or another frame"
            raise InvalidInputError(f"objects[{pose.name}].position", message, "meters, world frame as the hand's")
    for camera in cameras:
        field = f"cameras[{camera.name}].camera_to_world"
        away_m = float(np.linalg.norm(positions_m - camera.camera_to_world[:3, 3], axis=1).min())
        if away_m > MAX_CAMERA_M:
            message = f"puts the camera {away_m:.4g} from the hand: likely {_likely(away_m)}"
            raise InvalidInputError(field, message, "a translation in meters")
        _, depths_m = camera.project([*positions_m, *(pose.position_m for pose in objects)])
        if depths_m.max() < 0:
            message = "puts the hand's whole way and all objects behind the camera: OpenGL's axes, or its inverse?"
            raise InvalidInputError(field, message, "camera to world, OpenCV axes: x right, y down, z forward")


def _check_tracks(trajectory: Trajectory, objects: Sequence[ObjectPose]) -> None:
    tracks_m = trajectory.object_positions_m
    if tracks_m is None or tracks_m.shape[1] != len(objects):
        return
    for pose, tracked_m in zip(objects, tracks_m[0], strict=True):
        away_m = float(np.linalg.norm(tracked_m - pose.position_m))
        if away_m > MAX_TRACK_M:
            message = f"starts {away_m:.2f} m from objects[{pose.name}].position: another order, or another frame"
            raise InvalidInputError("trajectory.object_positions", message, "(T, N, 3), in the order of objects")


def _check_fingers(trajectory: Trajectory) -> None:
    is_open, widths_m = trajectory.gripper_open, trajectory.gripper_width_m
    if widths_m is None or is_open.all() or not is_open.any():
        return
    open_m, closed_m = float(np.median(widths_m[is_open])), float(np.median(widths_m[~is_open]))
    if open_m < closed_m - MIN_OPENING_M:
        message = f"is true where the fingers are {open_m:.3f} m apart, and false where they are {closed_m:.3f} m apart"
        raise InvalidInputError("trajectory.gripper_open", message, "true where gripper_width is large")


def _check_joints(motion: Motion) -> None:
    angles_rad, speeds_rad_s = motion.trajectory.joint_positions_rad, motion.joint_speeds_rad_s
    if angles_rad is not None and (most := float(np.abs(angles_rad).max())) > MAX_JOINT_RAD:
        raise InvalidInputError("trajectory.joint_positions", f"reaches {most:.4g}: likely degrees", "radians")
    fastest = float(speeds_rad_s.max())
    moving = speeds_rad_s > fastest / 10
    hand = motion.hand_speeds_m_s
    idle = float(np.median(hand[moving] / speeds_rad_s[moving])) < MIN_HAND_M_PER_RAD if fastest > 0 else False
    if fastest > MAX_JOINT_RAD_S or (fastest > FAST_JOINT_RAD_S and idle) or _beyond_positions(motion):
        message = f"reaches {fastest:.4g} (norm over the joints): likely degrees per second"
        raise InvalidInputError("trajectory.joint_velocities", message, "rad/s")


def _beyond_positions(motion: Motion) -> bool:
    angles_rad = motion.trajectory.joint_positions_rad
    if angles_rad is None or len(motion) < FEW_FRAMES:
        return False
    shown_rad_s = np.linalg.norm(np.gradient(angles_rad, motion.times_s, axis=0), axis=1)
    moving = shown_rad_s > MIN_JOINT_RAD_S
    if not moving.any():
        return False
    return bool(np.median(motion.joint_speeds_rad_s[moving] / shown_rad_s[moving]) > MAX_RATE_RATIO)


def _likely(extent: float) -> str:
    return "millimeters" if extent > 100 * MAX_MOTION_M / 3 else "centimeters or millimeters"
