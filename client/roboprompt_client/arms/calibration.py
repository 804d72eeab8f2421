"""Where an arm's base stands in the world."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from roboprompt_client import quaternions as rotations
from roboprompt_client.arms.driver import ArmState
from roboprompt_client.arrays import Array, finite_array, settle, unit_quaternions
from roboprompt_client.errors import InvalidInputError

CALIBRATION_JSON = '{"base_to_world": {"position": [x, y, z], "quaternion_xyzw": [x, y, z, w]}}, meters'


@dataclass(frozen=True, eq=False)
class Calibration:
    """The arm's base in the world frame: position (3,) m and rotation (4,) xyzw; by default the base is the world."""

    position_m: Array
    quaternion_xyzw: Array

    def __post_init__(self) -> None:
        settle(
            self,
            position_m=finite_array("base_to_world.position", self.position_m, (3,)),
            quaternion_xyzw=unit_quaternions("base_to_world.quaternion_xyzw", self.quaternion_xyzw, (4,)),
        )

    @classmethod
    def none(cls) -> "Calibration":
        """The base is the world's origin."""
        return cls(np.zeros(3), rotations.IDENTITY)

    @classmethod
    def from_json(cls, document: object) -> "Calibration":
        """One of a JSON document; raises InvalidInputError if it is none."""
        pose = document.get("base_to_world") if isinstance(document, Mapping) else None
        if not isinstance(pose, Mapping) or not {"position", "quaternion_xyzw"} <= set(pose):
            raise InvalidInputError("base_to_world", f"is {pose!r:.80}", CALIBRATION_JSON)
        return cls(pose["position"], pose["quaternion_xyzw"])

    def to_world(self, position_m: Array, quaternion_xyzw: Array) -> tuple[Array, Array]:
        """A pose in the base frame, in the world frame."""
        turned = rotations.product(self.quaternion_xyzw, quaternion_xyzw)
        return self.position_m + rotations.rotated(self.quaternion_xyzw, position_m), rotations.canonical(turned)

    def state_to_world(self, state: ArmState) -> ArmState:
        """An arm's state in the base frame, in the world frame."""
        position_m, quaternion = self.to_world(state.position_m, state.quaternion_xyzw)
        wrench = state.wrench_n_nm
        if wrench is not None:
            wrench = np.concatenate([rotations.rotated(self.quaternion_xyzw, part) for part in np.split(wrench, 2)])
        return replace(state, position_m=position_m, quaternion_xyzw=quaternion, wrench_n_nm=wrench)

    def to_base(self, position_m: Array, quaternion_xyzw: Array) -> tuple[Array, Array]:
        """A pose in the world frame, in the base frame."""
        back = rotations.inverse(self.quaternion_xyzw)
        turned = rotations.product(back, quaternion_xyzw)
        return rotations.rotated(back, position_m - self.position_m), rotations.canonical(turned)
