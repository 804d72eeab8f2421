"""Samples the arm at a fixed rate while it moves."""

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from app.pipeline.episode import ObjectPose, Trajectory
from app.pipeline.errors import InvalidInputError
from app.sim import panda

TIME_TOLERANCE_S = 1e-9


class Recorder:
    """Records the state of one scene at `control_frequency_hz`, from now on.

    Args:
        model, data: the scene (mujoco.MjModel, mujoco.MjData).
        objects: the scene's objects as they are now, to be tracked; None tracks none.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        control_frequency_hz: float = 20.0,
        objects: Callable[[], Sequence[ObjectPose]] | None = None,
    ) -> None:
        if not 0 < control_frequency_hz <= 1 / model.opt.timestep:
            valid = f"above 0 and at most {1 / model.opt.timestep:g} Hz, the simulation's rate"
            raise InvalidInputError("control_frequency_hz", f"is {control_frequency_hz}", valid)
        self._model, self._data, self._objects = model, data, objects
        self._period_s = 1 / control_frequency_hz
        self._next_s = data.time
        self._positions = [model.joint(name).qposadr[0] for name in panda.JOINT_NAMES]
        self._velocities = [model.joint(name).dofadr[0] for name in panda.JOINT_NAMES]
        self._site_id = model.site(panda.TCP_SITE).id
        self._rows: list[dict[str, Any]] = []
        self.sample()

    def sample(self) -> None:
        """Take a sample if one is due; called after every simulation step."""
        if self._data.time < self._next_s - TIME_TOLERANCE_S:
            return
        self._next_s += self._period_s
        data = self._data
        mujoco.mj_kinematics(self._model, data)  # mj_step leaves body poses one step behind the joints
        self._rows.append(
            {
                "timestamps_s": data.time,
                "joint_velocities_rad_s": data.qvel[self._velocities],
                "joint_positions_rad": data.qpos[self._positions],
                "positions_m": data.site_xpos[self._site_id].copy(),
                "rotations": data.site_xmat[self._site_id].reshape(3, 3).copy(),
                "gripper_open": data.ctrl[panda.GRIPPER_CTRL] > panda.FINGER_TRAVEL_M / 2,
                **self._tracked(),
            }
        )

    def _tracked(self) -> dict[str, Any]:
        if self._objects is None:
            return {}
        poses = self._objects()
        return {
            "object_positions_m": [pose.position_m for pose in poses],
            "object_quaternions_xyzw": [pose.quaternion_xyzw for pose in poses],
        }

    def trajectory(self) -> Trajectory:
        """Everything sampled so far; the gripper's state is the commanded one."""
        columns = {key: np.array([row[key] for row in self._rows]) for key in self._rows[0]}
        rotations = Rotation.from_matrix(columns.pop("rotations"))
        return Trajectory(quaternions_xyzw=rotations.as_quat(), **columns)
