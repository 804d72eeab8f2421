"""The geometry of an arm that a URDF file describes, by pinocchio."""

from pathlib import Path

import numpy as np

from roboprompt_client.arms.driver import pose_matrix
from roboprompt_client.arms.geometry import Nearest, follow_line, nearest_limit
from roboprompt_client.arrays import Array
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.extras import import_extra


class UrdfGeometry:
    """An arm's joints after its URDF; a `Geometry`.

    Args:
        frame: of the file: the end effector whose pose the arm's driver tells.

    Raises:
        InvalidInputError: if pinocchio is not installed, the file is none, has no such frame, or a joint that turns
            without end or has no single coordinate.
    """

    def __init__(self, path: Path, frame: str) -> None:
        self._pin = pin = import_extra("pinocchio", "pinocchio", "urdf")
        try:
            self._model = pin.buildModelFromUrdf(str(path))
        except ValueError as error:
            raise InvalidInputError("urdf", f"{path}: {error}", "a URDF file") from error
        if not self._model.existFrame(frame):
            valid = ", ".join(item.name for item in self._model.frames)
            raise InvalidInputError("urdf_frame", f"{frame!r:.80} is not in {path}", valid)
        if self._model.nq != self._model.nv:
            raise InvalidInputError("urdf", f"{path} has a joint without limits", "joints with limits")
        self._data, self._frame = self._model.createData(), self._model.getFrameId(frame)

    def way(self, joints_rad: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        if len(joints_rad) != self._model.nq:
            raise MotionError(f"the arm says {len(joints_rad)} joints, its URDF has {self._model.nq}")
        goal = pose_matrix(position_m, quaternion_xyzw)
        return follow_line(self._forward, joints_rad, goal, *self._limits_rad)

    def nearest_limit(self, joints_rad: Array) -> Nearest:
        return nearest_limit(joints_rad, *self._limits_rad)

    @property
    def _limits_rad(self) -> tuple[Array, Array]:
        return np.array(self._model.lowerPositionLimit), np.array(self._model.upperPositionLimit)

    def _forward(self, joints_rad: Array) -> tuple[Array, Array]:
        axes = self._pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = self._pin.computeFrameJacobian(self._model, self._data, joints_rad, self._frame, axes)
        self._pin.updateFramePlacement(self._model, self._data, self._frame)
        return np.array(self._data.oMf[self._frame].homogeneous), np.array(jacobian)
