"""What can be set for an object of the estimator `masks`."""

from dataclasses import dataclass, field
from typing import Literal

from app.perception.object_model import ObjectModel, one_of


@dataclass(frozen=True)
class MasksModel(ObjectModel):
    """An object that segmentation masks show.

    Attributes:
        rotation: whether to give the yaw of an upright box around the masked points, too.
        yaw_symmetry_deg: 90 for a square footprint; 180 for one with a longer side, which then is the x axis.
    """

    estimator: Literal["masks"] = field(default="masks", init=False)
    rotation: bool = False
    yaw_symmetry_deg: float = 90.0

    def __post_init__(self) -> None:
        one_of("rotation", self.rotation, (False, True))
        one_of("yaw_symmetry_deg", self.yaw_symmetry_deg, (90, 180))
