"""Refuses recordings without motion and numbers in other units, naming the likely cause."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

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
# Quaternions with w first: a rotation about the vertical is then read as one about the x axis
UPRIGHT_DEG = 5.0
OFF_UPRIGHT_DEG = 20.0
DOWN_DEG = 10.0
APPROACH_M = 0.05  # before a grasp or release the hand moves along its own z axis
ALONG_DEG, ACROSS_DEG = 25.0, 60.0
ONE_TILT_DEG = 5.0  # tilts that differ by less are one
UP, DOWN = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
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


def check_hand_order(motion: Motion) -> None:
    """Refuse a hand that would point straight down, or along its way to each grasp, if w came first.

    Raises:
        InvalidInputError: naming the field.
    """
    _check_approaches(motion)
    quaternions = motion.trajectory.quaternions_xyzw
    as_read, as_meant = _off_way_deg(quaternions, DOWN), _off_way_deg(_w_first(quaternions), DOWN)
    turns = np.abs(quaternions @ quaternions[0]).min() < np.cos(np.radians(DOWN_DEG / 2))
    if turns and as_meant.max() < DOWN_DEG and as_read.max() > OFF_UPRIGHT_DEG:
        message = "are a hand that points straight down only if w comes first"
        raise InvalidInputError("trajectory.end_effector_quaternions_xyzw", message, "order x y z w")


def _check_approaches(motion: Motion) -> None:
    """Refuse a hand that would move along its own z axis before each grasp and release if w came first.

    A hand that points down as given may move sideways before it closes, to push. No hand grasps pointing up.
    """
    positions_m, frames = motion.trajectory.positions_m, [switch.frame for switch in motion.switches]
    ways = [(frame, way_m) for frame in frames if (way_m := _approach(positions_m[: frame + 1])) is not None]
    if not ways:
        return
    quaternions = motion.trajectory.quaternions_xyzw[[frame for frame, _ in ways]]
    directions = np.array([way_m for _, way_m in ways])
    as_read, as_meant = (_off_way_deg(q, directions) for q in (quaternions, _w_first(quaternions)))
    may_be_right = _off_way_deg(quaternions, DOWN).max() < OFF_UPRIGHT_DEG
    points_up = _off_way_deg(_w_first(quaternions), UP).min() < ACROSS_DEG
    if not (may_be_right or points_up) and as_read.min() > ACROSS_DEG and as_meant.max() < ALONG_DEG:
        message = "are a hand that moves the way it points before it grasps only if w comes first"
        raise InvalidInputError("trajectory.end_effector_quaternions_xyzw", message, "order x y z w")


def _approach(positions_m: Array) -> Array | None:
    """Return (3,) the last `APPROACH_M` of a path; None if it is shorter."""
    away_m = np.linalg.norm(positions_m - positions_m[-1], axis=1)
    before = np.flatnonzero(away_m >= APPROACH_M)
    if not len(before):
        return None
    way_m: Array = positions_m[-1] - positions_m[before[-1]]
    return way_m


def _off_way_deg(quaternions_xyzw: Array, ways_m: Array) -> Array:
    """Return (N,) angles between the rotations' z axes and directions (N, 3), or one direction (3,)."""
    axes = Rotation.from_quat(quaternions_xyzw).apply([0.0, 0.0, 1.0])
    along = (axes * ways_m).sum(axis=1) / np.linalg.norm(ways_m, axis=-1)
    angles: Array = np.degrees(np.arccos(np.clip(along, -1, 1)))
    return angles


def check_objects_order(objects: Sequence[ObjectPose]) -> None:
    """Refuse objects that are all upright only if w comes first, several of them inclined at different angles.

    A single object may well lie on its side, stand on its head or be inclined about the x axis.

    Raises:
        InvalidInputError: naming the object.
    """
    turned, quaternions = _turned(objects)
    tilts_deg = _off_way_deg(quaternions, UP)
    inclined = _is_inclined(tilts_deg)
    if _upright_if_w_first(quaternions).all() and inclined.any() and np.ptp(tilts_deg[inclined]) > ONE_TILT_DEG:
        place = int(np.argmax(tilts_deg * inclined))
        message = f"is {quaternions[place].round(4).tolist()}: upright only if w comes first"
        raise InvalidInputError(f"objects[{turned[place].name}].quaternion_xyzw", message, "order x y z w")


def _turned(objects: Sequence[ObjectPose]) -> tuple[list[ObjectPose], Array]:
    """Return the N objects whose rotations are known, and these (N, 4)."""
    known = [pose for pose in objects if pose.quaternion_xyzw is not None]
    return known, np.array([pose.quaternion_xyzw for pose in known]).reshape(-1, 4)


def _is_inclined(tilts_deg: Array) -> npt.NDArray[np.bool_]:
    """Return (N,) bool: tilted, but neither lying on a side nor upside down."""
    inclined: npt.NDArray[np.bool_] = (tilts_deg > OFF_UPRIGHT_DEG) & (
        np.abs((tilts_deg + 45) % 90 - 45) > ONE_TILT_DEG
    )
    return inclined


def _upright_if_w_first(quaternions: Array) -> npt.NDArray[np.bool_]:
    """Return (N,) bool of quaternions (N, 4)."""
    upright: npt.NDArray[np.bool_] = _off_way_deg(_w_first(quaternions), UP) < UPRIGHT_DEG
    return upright


def _w_first(quaternions: Array) -> Array:
    """Return quaternions (N, 4) as they are meant if w comes first."""
    return np.roll(quaternions, -1, axis=1)
