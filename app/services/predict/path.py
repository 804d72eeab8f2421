"""The path of a recorded prediction, as the robot's side previews it before a motion."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from app.services.task_settings import TaskSettings
from app.store.records import PredictionRecord
from roboprompt_client import quaternions as rotations
from roboprompt_client.arms.calibration import Calibration
from roboprompt_client.arms.panda import PandaGeometry
from roboprompt_client.arms.preview import Previewed, preview_plan
from roboprompt_client.arrays import Array
from roboprompt_client.errors import MotionError
from roboprompt_client.trajectory import EndEffectorAction


def path_of(record: PredictionRecord, settings: TaskSettings) -> tuple[Previewed, ...]:
    """Each action with its distance from the base, its reach, and the boxes of today's settings on the way to it.

    The arm, where the settings name one, is thought to come from its maker's ready pose straight to where the request
    said that the hand was.
    """
    actions = [
        EndEffectorAction(np.array(item["position"]), np.array(item["quaternion_xyzw"]), item["gripper_open"])
        for item in record.actions or ()
    ]
    base = Calibration(np.array(settings.robot_base), rotations.IDENTITY)
    geometry = None if settings.arm is None else PandaGeometry(settings.arm)
    hand = record.request.get("end_effector")
    joints = None if geometry is None else _start(geometry, base, hand)
    start_m = None if hand is None else hand["position"]
    limits = settings.limits_of_motion()
    return preview_plan(actions, base, limits, geometry=geometry, joints_rad=joints, start_m=start_m)


def _start(geometry: PandaGeometry, base: Calibration, hand: Mapping[str, Any] | None) -> Array:
    if hand is None:
        return geometry.ready_rad
    position_m, quaternion = np.array(hand["position"]), np.array(hand["quaternion_xyzw"])
    try:
        return geometry.way(geometry.ready_rad, *base.to_base(position_m, quaternion))
    except MotionError:
        return geometry.ready_rad
