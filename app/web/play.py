"""The motion that the 3D view shows.

It is a document for `static/player.js`, of an episode as it was recorded or of a prediction before a robot carries
it out: times in seconds and, for each, the hand's pose and gripper in the world frame, and where the arm's joints stand
if the arm is known.
"""

from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from app.services.task_settings import TaskSettings
from app.store.records import PredictionRecord
from app.store.values import JsonObject
from roboprompt_client.arms.driver import Calibration
from roboprompt_client.arms.geometry import Chain
from roboprompt_client.errors import MotionError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

MAX_MOMENTS = 1500  # of a recording: the page moves straight between them
HAND_M_S, HAND_RAD_S = 0.25, 1.0  # how fast a prediction is played
GRIPPER_S = 0.5  # how long the hand rests where its gripper opens or closes
STEP_S = 0.1


def recorded_motion(trajectory: Trajectory, times_s: Array, settings: TaskSettings) -> JsonObject:
    """Return an episode's motion at no more moments than a page can show.

    Args:
        times_s: (T,) of the trajectory's frames.
    """
    chosen = np.unique(np.linspace(0, len(trajectory) - 1, min(len(trajectory), MAX_MOMENTS)).round().astype(int))
    joints = None if trajectory.joint_positions_rad is None else trajectory.joint_positions_rad[chosen]
    document = _document(
        times_s[chosen],
        trajectory.positions_m[chosen],
        trajectory.quaternions_xyzw[chosen],
        trajectory.gripper_open[chosen].tolist(),
        joints,
        settings,
    )
    moved = {"objects": trajectory.object_positions_m, "turns": trajectory.object_quaternions_xyzw}
    return document | {name: array[chosen].round(4).tolist() for name, array in moved.items() if array is not None}


def planned_motion(record: PredictionRecord, settings: TaskSettings) -> JsonObject | None:
    """A prediction's actions, the hand going straight from one to the next; None without actions.

    It begins where the request says that the hand was, else at the arm's ready pose if the arm is known, else at the
    first action. The arm is shown as far as it gets.
    """
    actions = record.actions or ()
    if not actions:
        return None
    poses = [(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"]) for item in actions]
    geometry = settings.geometry()
    if (hand := record.request.get("end_effector")) is not None:
        poses.insert(0, (np.array(hand["position"]), np.array(hand["quaternion_xyzw"]), True))
    elif geometry is not None:
        ready = geometry.hand(geometry.ready_rad)
        turn = Rotation.from_matrix(ready[:3, :3]).as_quat()
        poses.insert(0, (*settings.base().to_world(ready[:3, 3], turn), True))
    times_s = _arrivals_s(poses)
    moments_s = np.unique(np.concatenate([np.arange(0, times_s[-1], STEP_S), times_s]))
    places = np.array([position for position, _, _ in poses])
    positions = np.stack([np.interp(moments_s, times_s, places[:, k]) for k in range(3)], axis=1)
    turns = Rotation.from_quat([quaternion for _, quaternion, _ in poses])
    quaternions = Slerp(times_s, turns)(moments_s).as_quat() if len(poses) > 1 else turns.as_quat()
    # The gripper acts where it arrives.
    reached = np.searchsorted(times_s, moments_s + 1e-9, side="right") - 1
    is_open = [bool(poses[index][2]) for index in reached]
    joints = None if geometry is None else _joints(geometry, *_in_base(settings.base(), positions, quaternions))
    document = _document(moments_s, positions, quaternions, is_open, joints, settings)
    return {**document, "marks_s": times_s[len(poses) - len(actions) :].round(3).tolist()}


def _arrivals_s(poses: Sequence[tuple[Array, Array, bool]]) -> Array:
    """When the hand is at each pose."""
    times_s = [0.0]
    for (start_m, start, was_open), (end_m, end, is_open) in pairwise(poses):
        turn_rad = float((Rotation.from_quat(start).inv() * Rotation.from_quat(end)).magnitude())
        way_s = max(float(np.linalg.norm(end_m - start_m)) / HAND_M_S, turn_rad / HAND_RAD_S, STEP_S)
        times_s.append(times_s[-1] + way_s + (GRIPPER_S if was_open != is_open else 0.0))
    return np.array(times_s)


def _joints(geometry: Chain, positions_m: Array, quaternions_xyzw: Array) -> Array | None:
    """(M, J) rad at the first M poses, base frame: up to where the arm gets; None if not even to the first."""
    found: list[Array] = []
    joints = geometry.ready_rad
    with suppress(MotionError):
        for position_m, quaternion in zip(positions_m, quaternions_xyzw, strict=True):
            joints = geometry.way(joints, position_m, quaternion)
            found.append(joints)
    return np.array(found) if found else None


def _document(
    times_s: Array,
    positions_m: Array,
    quaternions_xyzw: Array,
    is_open: list[bool],
    joints_rad: Array | None,
    settings: TaskSettings,
) -> JsonObject:
    speeds = np.linalg.norm(np.diff(positions_m, axis=0), axis=1) / np.maximum(np.diff(times_s), 1e-6)
    return {
        "times_s": times_s.round(3).tolist(),
        "positions": positions_m.round(4).tolist(),
        "quaternions": quaternions_xyzw.round(4).tolist(),
        "open": is_open,
        "speeds_m_s": np.append(speeds, speeds[-1:]).round(4).tolist() if len(speeds) else [0.0],
        "joints": None if joints_rad is None else joints_rad.T.round(3).tolist(),
        "arm": None if joints_rad is None else skeletons(joints_rad, settings),
    }


def _in_base(base: Calibration, positions_m: Array, quaternions: Array) -> tuple[Array, Array]:
    """Return poses (T, 3), (T, 4) of the world frame in that of the base."""
    turn = Rotation.from_quat(base.quaternion_xyzw).inv()
    return turn.apply(positions_m - base.position_m), (turn * Rotation.from_quat(quaternions)).as_quat()


def skeletons(joints_rad: Array, settings: TaskSettings) -> list[list[list[float]]] | None:
    """Return for each moment of (T, J) joints the arm's points, world frame; None if no arm with J joints is known."""
    geometry = settings.geometry()
    if geometry is None or joints_rad.shape[1] != geometry.num_joints:
        return None
    points_m, base = np.array([geometry.skeleton(each) for each in joints_rad]), settings.base()
    turned_m = Rotation.from_quat(base.quaternion_xyzw).apply(points_m.reshape(-1, 3)).reshape(points_m.shape)
    points: list[list[list[float]]] = (turned_m + base.position_m).round(3).tolist()
    return points


def why_without_arm(trajectory: Trajectory, settings: TaskSettings) -> str:
    """Why a recording plays without the task's arm; empty if it plays with it, or no arm is known."""
    geometry, joints_rad = settings.geometry(), trajectory.joint_positions_rad
    if geometry is None or (joints_rad is not None and joints_rad.shape[1] == geometry.num_joints):
        return ""
    recorded = "no joint positions" if joints_rad is None else f"{joints_rad.shape[1]} joints"
    return f"The recording has {recorded}, the task's arm {geometry.num_joints} joints: the arm is not drawn."
