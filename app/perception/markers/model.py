"""What the estimator `markers` knows of an object: which printed markers it, or the fixture that holds it, carries."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, Self

import cv2
import numpy as np

from app.perception.object_model import MIN_CONFIDENCE, ObjectModel, checked_fields, number, numbers, one_of, within
from roboprompt_client.camera import ROTATION_MATRIX_TOLERANCE
from roboprompt_client.errors import InvalidInputError

Row = tuple[float, ...]
DICTIONARIES = tuple(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))
SAME_PLACE: tuple[Row, ...] = tuple(map(tuple, np.eye(4).tolist()))
_RIGID = "four rows of a rigid transform from the marker's axes to the object's, lengths in metres"


@cache
def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """The dictionary of that name in `DICTIONARIES`."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


@dataclass(frozen=True)
class Marker:
    """A printed square.

    Attributes:
        id: in its dictionary.
        size_m: the side of its black border, without the white rim.
        marker_to_object: (4, 4); the marker's axes begin at its middle: x to its right, y to its top, z out of it. For
            one on top of a cube of 5 cm: no turn, and a shift of (0, 0, 0.025).
    """

    id: int
    size_m: float
    marker_to_object: tuple[Row, ...] = SAME_PLACE

    def __post_init__(self) -> None:
        if not isinstance(self.id, int) or isinstance(self.id, bool) or self.id < 0:
            raise InvalidInputError("id", f"is {self.id!r}", "0, 1, 2, ...: the number printed with it")
        valid = "a length in metres above 0: the side of the black border"
        (size_m,) = numbers("size_m", (self.size_m,), 1, valid=valid, low=0.0)
        object.__setattr__(self, "size_m", size_m)
        object.__setattr__(self, "marker_to_object", _rigid_rows("marker_to_object", self.marker_to_object))


@dataclass(frozen=True)
class MarkersModel(ObjectModel):
    """An object with markers on it.

    Attributes:
        dictionary: which family the markers are of, e.g. ``DICT_4X4_50`` or ``DICT_APRILTAG_36h11``.
        markers: those on the object; all that a camera sees are used together.
        upright: whether the object's z axis is vertical, as on a table: only its yaw is then estimated.
        min_confidence: a pose that is less certain is refused.
    """

    estimator: Literal["markers"] = field(default="markers", init=False)
    dictionary: str
    markers: tuple[Marker, ...]
    upright: bool = False
    min_confidence: float = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        one_of("dictionary", self.dictionary, DICTIONARIES)
        one_of("upright", self.upright, (False, True))
        number("min_confidence", self.min_confidence, valid="a number in 0..1", low=0.0, high=1.0)
        if not self.markers:
            raise InvalidInputError("markers", "is empty", "at least one marker with id and size_m")
        known = len(marker_dictionary(self.dictionary).bytesList)
        ids = [marker.id for marker in self.markers]
        for index, id_ in enumerate(ids):
            if id_ >= known:
                raise InvalidInputError(f"markers[{index}].id", f"is {id_}", f"0 to {known - 1} in {self.dictionary}")
            if id_ in ids[:index]:
                raise InvalidInputError(f"markers[{index}].id", f"{id_} appears twice", "each marker once")

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Self:
        arguments = checked_fields(cls, value)
        items = arguments["markers"]
        if not isinstance(items, list | tuple):
            raise InvalidInputError("markers", f"is {items!r}", "a list of markers with id and size_m")
        arguments["markers"] = tuple(_marker(index, item) for index, item in enumerate(items))
        return cls(**arguments)


def _marker(index: int, value: Mapping[str, Any]) -> Marker:
    try:
        return Marker(**checked_fields(Marker, value))
    except InvalidInputError as error:
        raise within(f"markers[{index}]", error) from None


def _rigid_rows(name: str, value: object) -> tuple[Row, ...]:
    if not isinstance(value, list | tuple) or len(value) != 4:
        raise InvalidInputError(name, f"is {value!r}", _RIGID)
    rows = tuple(numbers(f"{name}[{index}]", row, 4, valid="four numbers") for index, row in enumerate(value))
    rotation = np.array(rows)[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # huge elements are refused like any others
        off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if not (off <= ROTATION_MATRIX_TOLERANCE and np.linalg.det(rotation) > 0 and list(rows[3]) == [0, 0, 0, 1]):
        what = "" if math.isnan(off) else f": its rotation's columns are off unit length and right angles by {off:.3g}"
        raise InvalidInputError(name, f"is not a rigid transform{what}", _RIGID)
    return rows
