"""Many poses of a template at once: rotations and the places of its origin."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from roboprompt_client.arrays import Array


@dataclass(frozen=True, eq=False)
class Poses:
    """S poses, template -> world.

    Attributes:
        rotations: (S, 3, 3).
        origins_m: (S, 3).
    """

    rotations: Array
    origins_m: Array

    def __len__(self) -> int:
        return len(self.rotations)

    def __getitem__(self, index: npt.ArrayLike | slice) -> "Poses":
        """Those at an index array or slice."""
        return Poses(self.rotations[index], self.origins_m[index])  # type: ignore[index]

    def to_world(self, points_m: Array) -> Array:
        """(S, P, 3) of points (P, 3) of the template."""
        moved: Array = points_m @ self.rotations.transpose(0, 2, 1) + self.origins_m[:, None]
        return moved

    def to_template(self, points_m: Array) -> Array:
        """(S, P, 3) of points (P, 3) of the world."""
        moved: Array = (points_m - self.origins_m[:, None]) @ self.rotations
        return moved

    def turned(self, number: int, yaws_deg: Array) -> "Poses":
        """Pose `number`, turned about the vertical through its origin by each of (T,) degrees."""
        turns = about_z(yaws_deg)
        return Poses(turns @ self.rotations[number], np.tile(self.origins_m[number], (len(turns), 1)))

    def matrix(self, number: int) -> Array:
        """(4, 4) of pose `number`."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.rotations[number], self.origins_m[number]
        return pose


def about_z(degrees: npt.ArrayLike) -> Array:
    """(S, 3, 3) rotations about the vertical."""
    matrices: Array = Rotation.from_euler("z", np.atleast_1d(degrees).reshape(-1, 1), degrees=True).as_matrix()
    return matrices


def joined(*poses: Poses) -> Poses:
    """All of them."""
    return Poses(np.concatenate([p.rotations for p in poses]), np.concatenate([p.origins_m for p in poses]))


def angle_deg(one: Array, other: Array, symmetry_deg: float | None = None) -> float:
    """Between two rotations (3, 3), as small as a symmetry about z allows; with 0 between their z axes."""
    if symmetry_deg == 0:
        return float(np.degrees(np.arccos(np.clip(one[:, 2] @ other[:, 2], -1, 1))))
    turns = about_z(np.arange(0, 360, symmetry_deg or 360))
    traces = np.einsum("ij,tik,kj->t", one, other[None] @ turns, np.eye(3))
    return float(np.degrees(np.arccos(np.clip((traces.max() - 1) / 2, -1, 1))))
