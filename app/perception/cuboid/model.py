"""What the estimator `cuboid` knows of an object: its shape and size, its colour, and how to tell it from its like."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Self

from app.perception.object_model import MIN_CONFIDENCE, ObjectModel, checked_fields, number, numbers, one_of, within
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.wording import checked_name


@dataclass(frozen=True)
class ColorModel:
    """A box in HSV space that holds an object's pixels and few others.

    Attributes:
        hue_deg: (from, to) going upwards, each in 0..360; red goes over 360: (345, 15).
        saturation: (least, greatest) in 0..1.
        value: (least, greatest) in 0..1: how bright the brightest channel is.
    """

    hue_deg: tuple[float, float]
    saturation: tuple[float, float] = (0.4, 1.0)
    value: tuple[float, float] = (0.15, 1.0)

    def __post_init__(self) -> None:
        valid = "[from, to] in degrees, each 0..360, e.g. [345, 15] for red"
        hue = numbers("hue_deg", self.hue_deg, 2, valid=valid)
        if not all(0 <= item <= 360 for item in hue):
            raise InvalidInputError("hue_deg", f"is {list(hue)}", valid)
        object.__setattr__(self, "hue_deg", hue)
        for name in ("saturation", "value"):
            valid = "[least, greatest], each 0..1"
            low, high = numbers(name, getattr(self, name), 2, valid=valid)
            if not 0 <= low <= high <= 1:
                raise InvalidInputError(name, f"is {[low, high]}", valid)
            object.__setattr__(self, name, (low, high))

    @classmethod
    def from_json(cls, value: Mapping[str, Any] | str) -> Self:
        """From its fields, or from a name in `COLORS`."""
        if isinstance(value, str):
            if value not in COLORS:
                valid = f"one of {', '.join(COLORS)}, or hue_deg, saturation and value"
                raise InvalidInputError("", f"is {value!r}", valid)
            return cls(COLORS[value])
        return cls(**checked_fields(cls, value))


# Hues in degrees that English speakers give these names, as ranges that leave gaps between neighbours
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


@dataclass(frozen=True)
class Rank:
    """Which of several objects that look alike.

    Attributes:
        number: 1 for the nearest.
        nearest_to: the name of the object from which their distances are measured.
        of: how many there are: a count that comes out otherwise is refused, since one may be hidden.
    """

    number: int
    nearest_to: str
    of: int

    def __post_init__(self) -> None:
        for name, least in (("number", 1), ("of", 2)):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise InvalidInputError(name, f"is {value!r}", f"a whole number from {least} on")
        if self.number > self.of:
            raise InvalidInputError("number", f"is {self.number}", f"1..{self.of}, as many as there are")
        checked_name("nearest_to", self.nearest_to)


@dataclass(frozen=True)
class CuboidModel(ObjectModel):
    """An upright box or cylinder of one colour.

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

    estimator: Literal["cuboid"] = field(default="cuboid", init=False)
    size_m: tuple[float, float, float]
    color: ColorModel
    shape: Literal["box", "cylinder"] = "box"
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rank: Rank | None = None
    away_from: str | None = None
    min_confidence: float = MIN_CONFIDENCE

    def __post_init__(self) -> None:
        valid = "[x, y, z], positive lengths in metres, e.g. [0.05, 0.05, 0.05]"
        object.__setattr__(self, "size_m", numbers("size_m", self.size_m, 3, valid=valid, low=0.0))
        object.__setattr__(self, "origin_m", numbers("origin_m", self.origin_m, 3, valid="[x, y, z] in metres"))
        number("min_confidence", self.min_confidence, valid="a number in 0..1", low=0.0, high=1.0)
        one_of("shape", self.shape, ("box", "cylinder"))
        if self.shape == "cylinder" and not math.isclose(self.size_m[0], self.size_m[1]):
            raise InvalidInputError("size_m", f"is {list(self.size_m)}", "[diameter, diameter, height] of a cylinder")
        if self.away_from is not None:
            checked_name("away_from", self.away_from)
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

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Self:
        arguments = checked_fields(cls, value)
        try:
            arguments["color"] = ColorModel.from_json(arguments["color"])
        except InvalidInputError as error:
            raise within("color", error) from None
        if arguments.get("rank") is not None:
            try:
                arguments["rank"] = Rank(**checked_fields(Rank, arguments["rank"]))
            except InvalidInputError as error:
                raise within("rank", error) from None
        return cls(**arguments)
