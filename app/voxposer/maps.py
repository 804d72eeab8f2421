"""Value maps of 100^3 voxels, painted from the boxes that a program's process answers with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from app.voxposer.program.voxels import SIZE
from roboprompt_client.arrays import Array

Values = npt.NDArray[np.float32]
Painted = Sequence[tuple[Any, Any]]


@dataclass(frozen=True, eq=False)
class ValueMaps:
    """Where one move is to go, and how.

    Attributes:
        affordance: (100, 100, 100) the higher, the rather the end effector is to be there.
        avoidance: (100, 100, 100) the higher, the less.
        rotation: (100, 100, 100, 4) quaternions xyzw in the world frame.
        velocity: (100, 100, 100) shares of the usual speed.
        gripper: (100, 100, 100) 1 open, 0 closed.
    """

    affordance: Values
    avoidance: Values
    rotation: Values
    velocity: Values
    gripper: Values

    @classmethod
    def painted(cls, move: Mapping[str, Painted], quaternion_xyzw: Array, *, gripper_open: bool) -> "ValueMaps":
        """The maps of a move.

        Args:
            move: for each kind that the program gave, boxes and values; later ones lie on top.
            quaternion_xyzw, gripper_open: those of the moment, which hold where a map says nothing.
        """
        empty: dict[str, Any] = {
            "affordance": 0.0,
            "avoidance": 0.0,
            "rotation": quaternion_xyzw,
            "velocity": 1.0,
            "gripper": float(gripper_open),
        }
        return cls(**{kind: _map(move.get(kind, ()), value) for kind, value in empty.items()})

    @property
    def targets(self) -> npt.NDArray[np.bool_]:
        """(100, 100, 100) the voxels of the highest affordance; none if it is 0 everywhere."""
        highest = float(self.affordance.max())
        found: npt.NDArray[np.bool_] = (self.affordance == highest) & (highest > 0)
        return found


def _map(painted: Painted, background: Any) -> Values:  # noqa: ANN401
    background = np.asarray(background, dtype=np.float32)
    values = np.broadcast_to(background, (SIZE, SIZE, SIZE, *background.shape))
    if not painted:
        return values
    values = values.copy()
    for ((x0, x1), (y0, y1), (z0, z1)), value in painted:
        values[x0:x1, y0:y1, z0:z1] = value
    return values
