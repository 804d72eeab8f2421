"""The functions that a program can call: find objects, paint value maps, and move. Their results are plain data.

A wrong argument raises CommandError, which names valid ones.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from app.evaluation.voxposer.voxels import AXES, SIZE, Box, Voxel, Voxels, pointing_down, turned, yaw_deg

MAX_CM = 1_000.0
MAX_MOVES = 40
MAX_PAINTED = 5_000  # boxes that moves ask for
KINDS = ("affordance", "avoidance", "rotation", "velocity", "gripper")
EVERYWHERE: Box = ((0, SIZE), (0, SIZE), (0, SIZE))
NO_TURN = (0.0, 0.0, 0.0, 1.0)
PLAIN: tuple[Callable[..., object], ...] = (range, len, enumerate, zip, min, max, sum, abs, round, int)


class CommandError(Exception):
    """A command with a wrong argument, or one too many."""


@dataclass(frozen=True, eq=False)
class Thing:
    """The result of `detect`.

    Attributes:
        low, high: the corners of its bounding box.
        voxels: those that contain a point of it.
        position_m, quaternion_xyzw: its pose, which programs cannot read.
    """

    name: str
    position: Voxel
    low: Voxel
    high: Voxel
    size_cm: tuple[float, ...]
    voxels: tuple[Voxel, ...]
    yaw_deg: float
    position_m: tuple[float, ...]
    quaternion_xyzw: tuple[float, ...]

    @classmethod
    def read(cls, value: Mapping[str, Any], voxels: Voxels) -> "Thing":
        """Return an object of the scene's JSON."""
        points = tuple((x, y, z) for x, y, z in value["voxels"])
        low, high = (_voxel([pick(axis) for axis in zip(*points, strict=True)]) for pick in (min, max))
        steps = zip(low, high, voxels.step_m, strict=True)
        turn = tuple(value["quaternion_xyzw"] or NO_TURN)
        return cls(
            name=value["name"],
            position=voxels.at(value["position_m"]),
            low=low,
            high=high,
            size_cm=tuple(round(100 * step * (last - first + 1), 1) for first, last, step in steps),
            voxels=points,
            yaw_deg=round(yaw_deg(turn), 1),
            position_m=tuple(value["position_m"]),
            quaternion_xyzw=turn,
        )


@dataclass(eq=False)
class ValueMap:
    """A map as a list of painted boxes; later ones lie on top.

    Attributes:
        kind: one of KINDS.
    """

    kind: str
    painted: list[tuple[Box, object]] = field(default_factory=list)

    def __setitem__(self, index: object, value: object) -> None:
        """Set the voxels at an index like [x, y, z] or [:, :, 10:20]."""
        parts = index if isinstance(index, tuple) else (index,)
        if not 1 <= len(parts) <= 3:
            raise CommandError("a map has three indices: [x, y, z]")
        x, y, z = (*(_span(part) for part in parts), *EVERYWHERE[len(parts) :])
        self.add((x, y, z), value)

    def add(self, box: Box, value: object) -> None:
        """Set the voxels of a box."""
        if box == EVERYWHERE:
            self.painted.clear()  # it would have no effect
        self.painted.append((box, _map_value(self.kind, value)))


class Commands:
    """The functions of one program, and the moves that it asks for.

    Args:
        scene: see `sandbox.Scene.to_json`.
    """

    def __init__(self, scene: Mapping[str, Any]) -> None:
        self._voxels = Voxels(tuple(scene["min_m"]), tuple(scene["step_m"]))
        self._things = {item["name"]: Thing.read(item, self._voxels) for item in scene["objects"]}
        self._hand = Thing.read(scene["hand"], self._voxels)
        self._num_painted = 0
        self.moves: list[dict[str, list[tuple[Box, object]]]] = []

    def by_name(self) -> dict[str, Callable[..., object]]:
        """Return the functions by name."""
        maps = {f"empty_{kind}_map": partial(ValueMap, kind) for kind in KINDS}
        own = (self.detect, self.hand, self.shifted, self.shifted_along, self.set_voxels, self.set_object)
        more = (self.cm_to_voxels, self.voxels_to_cm, self.pointing_down, self.move)
        return {**{call.__name__: call for call in (*PLAIN, *own, *more)}, **maps}

    def detect(self, name: object) -> Thing:
        """Return the object of that name."""
        if not isinstance(name, str) or name not in self._things:
            raise CommandError(f"detect: there is no object {name!r:.60} (valid: {', '.join(map(repr, self._things))})")
        return self._things[name]

    def hand(self) -> Thing:
        """Return the end effector before the first move."""
        return self._hand

    def shifted(self, where: object, x_cm: object = 0, y_cm: object = 0, z_cm: object = 0) -> Voxel:
        """Return the voxel at an offset from an object or a voxel, along the world's axes."""
        return self._moved(where, (x_cm, y_cm, z_cm), NO_TURN)

    def shifted_along(self, thing: object, x_cm: object = 0, y_cm: object = 0, z_cm: object = 0) -> Voxel:
        """Return the voxel at an offset from an object, along the object's own axes."""
        if not isinstance(thing, Thing):
            raise CommandError("shifted_along takes an object from detect first")
        return self._moved(thing, (x_cm, y_cm, z_cm), thing.quaternion_xyzw)

    def _moved(self, where: object, by_cm: Sequence[object], turn: Sequence[float]) -> Voxel:
        start_m = where.position_m if isinstance(where, Thing) else self._voxels.center_m(_voxel(where))
        by_m = turned(turn, [_length_cm(value) / 100 for value in by_cm])
        return self._voxels.at([start + by for start, by in zip(start_m, by_m, strict=True)])

    def set_voxels(self, map: object, position: object, value: object = 1, radius_cm: object = 0) -> None:  # noqa: A002
        """Paint a box around a voxel."""
        at = _voxel(position)
        _a_map("set_voxels", map).add(self._voxels.around(at, at, abs(_length_cm(radius_cm))), value)

    def set_object(self, map: object, thing: object, value: object = 1, margin_cm: object = 0) -> None:  # noqa: A002
        """Paint the bounding box of an object with a margin."""
        if not isinstance(thing, Thing):
            raise CommandError("set_object takes a map, then an object from detect")
        _a_map("set_object", map).add(self._voxels.around(thing.low, thing.high, abs(_length_cm(margin_cm))), value)

    def cm_to_voxels(self, cm: object, axis: object = "z") -> int:
        """Convert a length to a number of voxels along an axis."""
        return self._voxels.count(_length_cm(cm), _axis_number(axis))

    def voxels_to_cm(self, voxels: object, axis: object = "z") -> float:
        """Convert a number of voxels along an axis to a length."""
        return 100 * _finite(voxels, "a number of voxels") * self._voxels.step_m[_axis_number(axis)]

    def pointing_down(self, yaw_deg: object = 0, tilt_deg: object = 0) -> tuple[float, ...]:
        """Return a rotation of the gripper whose fingers close perpendicular to the yaw."""
        return pointing_down(_finite(yaw_deg, "a yaw in degrees"), _finite(tilt_deg, "a tilt in degrees"))

    def move(
        self,
        affordance: object,
        avoidance: object = None,
        rotation: object = None,
        velocity: object = None,
        gripper: object = None,
    ) -> None:
        """Go where the affordance is highest."""
        given = dict(zip(KINDS, (affordance, avoidance, rotation, velocity, gripper), strict=True))
        for kind, value in given.items():
            if value is not None and not (isinstance(value, ValueMap) and value.kind == kind):
                raise CommandError(f"move: {kind} is no {kind} map (valid: empty_{kind}_map())")
        maps = {kind: list(value.painted) for kind, value in given.items() if isinstance(value, ValueMap)}
        if not any(isinstance(value, int | float) and value > 0 for _, value in maps.get("affordance", ())):
            raise CommandError("move: no voxel of the affordance map is above 0 (valid: set_voxels(map, position))")
        if len(self.moves) == MAX_MOVES:
            raise CommandError(f"the program moves more than {MAX_MOVES} times")
        self._num_painted += sum(map(len, maps.values()))
        if self._num_painted > MAX_PAINTED:
            raise CommandError(f"the maps of the moves are painted in more than {MAX_PAINTED} places")
        self.moves.append(maps)


def _a_map(command: str, value: object) -> ValueMap:
    if not isinstance(value, ValueMap):
        raise CommandError(f"{command} takes a map first (valid: one of the empty_..._map())")
    return value


def _voxel(value: object) -> Voxel:
    if isinstance(value, Thing):
        return value.position
    if isinstance(value, tuple | list) and len(value) == 3 and all(map(_is_index, value)):
        x, y, z = value
        return x, y, z
    raise CommandError(f"a position is three whole numbers (x, y, z), each 0..{SIZE - 1}, or an object from detect")


def _finite(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CommandError(f"{what} is a number, not {type(value).__name__}")
    return value


def _length_cm(value: object) -> float:
    if abs(length := _finite(value, "a length in cm")) > MAX_CM:
        raise CommandError(f"a length is {length:g} cm (valid: at most {MAX_CM:g})")
    return length


def _axis_number(value: object) -> int:
    if value not in AXES:
        raise CommandError(f"there is no such axis (valid: {', '.join(map(repr, AXES))})")
    return AXES.index(str(value))


def _is_index(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < SIZE


def _span(part: object) -> tuple[int, int]:
    """Return the range of voxels of an index along one axis."""
    if isinstance(part, slice) and part.step in (None, 1):
        first, last, _ = part.indices(SIZE)
        if first < last:
            return first, last
    elif isinstance(part, int) and _is_index(part):
        return part, part + 1
    raise CommandError(f"an index of a map is a whole number 0..{SIZE - 1} or a slice of them")


def _map_value(kind: str, value: object) -> object:
    """Return `value` if it is valid in a map of that kind."""
    if kind == "rotation":
        if not (isinstance(value, tuple | list) and len(value) == 4):
            raise CommandError("a rotation map holds quaternions (valid: pointing_down(yaw_deg))")
        quaternion = tuple(_finite(part, "a part of a quaternion") for part in value)
        if abs(math.hypot(*quaternion) - 1) > 1e-3:
            raise CommandError("a quaternion of a rotation map is not of length 1")
        return quaternion
    number = _finite(value, f"a value of the {kind} map")
    if kind == "gripper" and number not in (0, 1):
        raise CommandError(f"a gripper map holds {number:g} (valid: 1 open, 0 closed)")
    if kind == "velocity" and not 0 < number <= 1:
        raise CommandError(f"a velocity map holds {number:g} (valid: above 0, up to 1, the usual speed)")
    if kind in ("affordance", "avoidance") and not 0 <= number <= 1:
        raise CommandError(f"an {kind} map holds {number:g} (valid: 0 to 1)")
    return number
