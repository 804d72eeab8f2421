"""A trajectory sampled from the simulated arm at a fixed rate while it moves."""

from collections.abc import Sequence
from typing import Any, Literal

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.robot import SimulatedPanda
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.trajectory import Trajectory

GripperState = Literal["measured", "commanded"]
TIME_TOLERANCE_S = 1e-9
MIN_FINGER_TRAVEL_M = 1e-3  # fingers that move less have neither opened nor closed


class TrajectorySampler:
    """Samples an arm and its scene at `control_frequency_hz`, from now on.

    Args:
        tracked: names of the bodies of the objects to be tracked.

    Raises:
        InvalidInputError: for a frequency that the simulation cannot sample at.
    """

    def __init__(self, robot: SimulatedPanda, control_frequency_hz: float = 20.0, tracked: Sequence[str] = ()) -> None:
        model, data = robot.task.model, robot.task.data
        if not 0 < control_frequency_hz <= 1 / model.opt.timestep:
            valid = f"above 0 and at most {1 / model.opt.timestep:g} Hz, the simulation's rate"
            raise InvalidInputError("control_frequency_hz", f"is {control_frequency_hz}", valid)
        self._robot, self._model, self._data = robot, model, data
        self._tracked = [model.body(name).id for name in tracked]
        self._period_s = 1 / control_frequency_hz
        self._next_s = data.time
        self._positions = [model.joint(name).qposadr[0] for name in panda.JOINT_NAMES]
        self._fingers = [model.joint(name).qposadr[0] for name in panda.FINGER_NAMES]
        self._velocities = [model.joint(name).dofadr[0] for name in panda.JOINT_NAMES]
        self._site_id = model.site(panda.TCP_SITE).id
        self._rows: list[dict[str, Any]] = []
        self.sample()
        robot.after_step.append(self.sample)

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
                "gripper_open": self._robot.gripper_commanded_open,
                "widths_m": data.qpos[self._fingers].sum(),
                "object_positions_m": data.xpos[self._tracked],
                "object_axes": data.xmat[self._tracked],
            }
        )

    def trajectory(self, gripper: GripperState = "commanded") -> Trajectory:
        """Everything sampled so far.

        Args:
            gripper: whether its state is what the fingers have done, or what they were commanded; see `measured_open`.
        """
        columns = {key: np.array([row[key] for row in self._rows]) for key in self._rows[0]}
        rotations = Rotation.from_matrix(columns.pop("rotations"))
        widths_m = columns.pop("widths_m")
        positions_m, axes = columns.pop("object_positions_m"), columns.pop("object_axes").reshape(-1, 3, 3)
        if self._tracked:
            columns["object_positions_m"] = positions_m
            # All at once: one rotation takes as long as a thousand.
            turns_xyzw = Rotation.from_matrix(axes).as_quat(canonical=True)
            columns["object_quaternions_xyzw"] = turns_xyzw.reshape(*positions_m.shape[:2], 4)
        if gripper == "measured":
            columns["gripper_open"] = measured_open(widths_m)
        return Trajectory(quaternions_xyzw=rotations.as_quat(), **columns)


def measured_open(widths_m: Array) -> npt.NDArray[np.bool_]:
    """Whether the gripper is open (T,), from the widths (T,) between its fingers over a whole recording.

    It is open above the middle between the narrowest and the widest of them: fingers that hold something are closed,
    however thick it is. Fingers that never move are open if they are more than half open.
    """
    narrowest_m, widest_m = widths_m.min(), widths_m.max()
    moves = widest_m - narrowest_m > 2 * MIN_FINGER_TRAVEL_M
    middle_m = (narrowest_m + widest_m) / 2 if moves else panda.FINGER_TRAVEL_M
    is_open: npt.NDArray[np.bool_] = widths_m > middle_m
    return is_open
