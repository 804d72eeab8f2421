"""Object models of the estimator `cuboid`: shape, size, color, and which of several similar objects is meant."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from app.perception.object_model import (
    MIN_CONFIDENCE,
    WHOLE,
    Checked,
    Confidence,
    Length,
    Meters,
    Number,
    ObjectModel,
    Share,
)
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_object_name

Degrees = Annotated[Number, Field(ge=0, le=360)]
Shape = Literal["box", "cylinder"]
SHAPES: tuple[Shape, ...] = ("box", "cylinder")
_RANGE = Field(description="[least, greatest], each 0..1")
ColorName = Literal["red", "orange", "yellow", "green", "cyan", "blue", "purple", "pink"]


@dataclass(frozen=True)
class ColorModel(Checked):
    """A box in HSV space that holds an object's pixels and few others.

    Attributes:
        hue_deg: (from, to) going upwards, each in 0..360; red goes over 360: (345, 15).
        saturation: (least, greatest) in 0..1.
        value: (least, greatest) in 0..1: how bright the brightest channel is.
    """

    hue_deg: Annotated[
        tuple[Degrees, Degrees], Field(description="[from, to] in degrees, each 0..360, e.g. [345, 15] for red")
    ]
    saturation: Annotated[tuple[Share, Share], _RANGE] = (0.4, 1.0)
    value: Annotated[tuple[Share, Share], _RANGE] = (0.15, 1.0)

    def __post_init__(self) -> None:
        for name in ("saturation", "value"):
            low, high = getattr(self, name)
            if low > high:
                raise InvalidInputError(name, f"is {[low, high]}", "[least, greatest]")


# Hues in degrees that English speakers give these names, as ranges that leave gaps between neighbors
COLORS: Mapping[str, tuple[float, float]] = {
    "red": (345.0, 14.0),
    "orange": (18.0, 38.0),
    "yellow": (42.0, 68.0),
    "green": (80.0, 160.0),
    "cyan": (168.0, 198.0),
    "blue": (203.0, 255.0),
    "purple": (262.0, 305.0),
    "pink": (310.0, 342.0),
}


def _of_that_name(value: object) -> object:
    if not isinstance(value, str):
        return value
    if value not in COLORS:
        raise InvalidInputError("", f"is {value!r}", f"one of {', '.join(COLORS)}, or hue_deg, saturation and value")
    return ColorModel(COLORS[value])


Color = Annotated[ColorModel, BeforeValidator(_of_that_name, json_schema_input_type=ColorModel | ColorName)]


@dataclass(frozen=True)
class Rank(Checked):
    """Which of several objects that look alike.

    Attributes:
        number: 1 for the nearest.
        nearest_to: the name of the object from which their distances are measured.
        of: how many there are: a count that comes out otherwise is refused, since one may be hidden.
    """

    number: Annotated[int, Field(ge=1, description="a whole number from 1 on"), WHOLE]
    nearest_to: str
    of: Annotated[int, Field(ge=2, description="a whole number from 2 on"), WHOLE]

    def __post_init__(self) -> None:
        if self.number > self.of:
            raise InvalidInputError("number", f"is {self.number}", f"1..{self.of}, as many as there are")
        checked_object_name("nearest_to", self.nearest_to)


@dataclass(frozen=True)
class CuboidModel(ObjectModel):
    """An upright box or cylinder of one color.

    Attributes:
        size_m: (3,) full lengths along the object's own axes, z up; a cylinder's first two are its diameter.
        color: which pixels are the object's.
        shape: what `size_m` is the size of.
        origin_m: (3,) the object's origin, seen from the middle of its shape, in the object's axes; on the z axis where
            nothing tells the yaws apart.
        rank: which one it is where several look alike; None where it is the only one.
        away_from: the name of an object that the x axis points away from, to choose among the yaws that look alike.
        min_confidence: a pose that is less certain is refused.
    """

    estimator: Literal["cuboid"] = field(default="cuboid", kw_only=True)
    size_m: Annotated[
        tuple[Length, Length, Length],
        Field(description="[x, y, z], positive lengths in meters, e.g. [0.05, 0.05, 0.05]"),
    ]
    color: Color
    shape: Shape = "box"
    origin_m: Annotated[tuple[Meters, Meters, Meters], Field(description="[x, y, z] in meters")] = (0.0, 0.0, 0.0)
    rank: Rank | None = None
    away_from: str | None = None
    min_confidence: Confidence = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        if min(self.size_m) <= 0:
            raise InvalidInputError("size_m", f"is {list(self.size_m)}", "positive lengths")
        if self.shape == "cylinder" and not math.isclose(self.size_m[0], self.size_m[1]):
            raise InvalidInputError("size_m", f"is {list(self.size_m)}", "[diameter, diameter, height] of a cylinder")
        if self.away_from is not None:
            checked_object_name("away_from", self.away_from)
        elif any(self.origin_m[:2]):
            remedy = "x = y = 0, or away_from to tell the yaws apart that look alike"
            raise InvalidInputError("origin_m", f"is {list(self.origin_m)}", remedy)

    @property
    def yaw_symmetry_deg(self) -> float | None:
        """The turn about z that leaves pose and looks unchanged: 0 any, None where `away_from` settles the yaw."""
        if self.away_from is not None:
            return None
        return self.shape_symmetry_deg

    @property
    def shape_symmetry_deg(self) -> float:
        """The turn about z that leaves the shape unchanged; 0: every turn does."""
        if self.shape == "cylinder":
            return 0.0
        return 90.0 if math.isclose(self.size_m[0], self.size_m[1], rel_tol=1e-6) else 180.0
