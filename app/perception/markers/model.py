"""The object model of the estimator `markers`: the printed markers on an object, or on the fixture that holds it."""

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from app.perception.object_model import (
    MIN_CONFIDENCE,
    WHOLE,
    Checked,
    Confidence,
    Length,
    Meters,
    ObjectModel,
    Truth,
    one_of,
)
from roboprompt_client.cameras.board import DICTIONARIES, marker_dictionary
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.camera import ROTATION_MATRIX_TOLERANCE

_RIGID = "four rows of a rigid transform from the marker's axes to the object's, lengths in meters"
Row = tuple[Meters, Meters, Meters, Meters]
SAME_PLACE = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Marker(Checked):
    """A printed square.

    Attributes:
        id: in its dictionary.
        size_m: the side of its black border, without the white rim.
        marker_to_object: (4, 4); the marker's axes begin at its middle: x to its right, y to its top, z out of it. For
            one on top of a cube of 5 cm: no turn, and a shift of (0, 0, 0.025).
    """

    id: Annotated[int, Field(ge=0, description="0, 1, 2, ...: the number printed with it"), WHOLE]
    size_m: Annotated[Length, Field(description="a length in meters above 0: the side of the black border")]
    marker_to_object: Annotated[tuple[Row, Row, Row, Row], Field(description=_RIGID)] = SAME_PLACE

    def __post_init__(self) -> None:
        _check_rigid("marker_to_object", self.marker_to_object)


@dataclass(frozen=True)
class MarkersModel(ObjectModel):
    """An object with markers on it.

    Attributes:
        dictionary: which family the markers are of, e.g. ``DICT_4X4_50`` or ``DICT_APRILTAG_36h11``.
        markers: those on the object; all that a camera sees are used together.
        upright: whether the object's z axis is vertical, as on a table: only its yaw is then estimated.
        min_confidence: a pose that is less certain is refused.
    """

    estimator: Literal["markers"] = field(default="markers", kw_only=True)
    dictionary: Annotated[str, Field(description="e.g. DICT_4X4_50 or DICT_APRILTAG_36h11")]
    markers: Annotated[tuple[Marker, ...], Field(description="a list of markers with id and size_m")]
    upright: Truth = False
    min_confidence: Confidence = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        one_of("dictionary", self.dictionary, DICTIONARIES)
        if not self.markers:
            raise InvalidInputError("markers", "is empty", "at least one marker with id and size_m")
        known = len(marker_dictionary(self.dictionary).bytesList)
        ids = [marker.id for marker in self.markers]
        for index, id_ in enumerate(ids):
            if id_ >= known:
                raise InvalidInputError(f"markers[{index}].id", f"is {id_}", f"0 to {known - 1} in {self.dictionary}")
            if id_ in ids[:index]:
                raise InvalidInputError(f"markers[{index}].id", f"{id_} appears twice", "each marker once")


def _check_rigid(name: str, rows: tuple[Row, ...]) -> None:
    rotation = np.array(rows)[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # huge elements are refused like any others
        off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not (off <= ROTATION_MATRIX_TOLERANCE and np.linalg.det(rotation) > 0 and list(rows[3]) == [0, 0, 0, 1]):
        what = "" if math.isnan(off) else f": its rotation's columns are off unit length and right angles by {off:.3g}"
        raise InvalidInputError(name, f"is not a rigid transform{what}", _RIGID)
