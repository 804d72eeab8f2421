"""First frames with what is known of their objects."""

from dataclasses import dataclass

from app.perception.base import ObjectQuery
from app.pipeline.camera import RgbdFrame


@dataclass(frozen=True, eq=False)
class LabelledScene:
    """A first frame with what is known of its objects.

    Attributes:
        frames: RGB-D of one or more cameras; with masks for objects that have mask ids.
        objects: each with mask ids, a position, or both; a position makes the model's origin that of the object.
    """

    frames: tuple[RgbdFrame, ...]
    objects: tuple[ObjectQuery, ...]
