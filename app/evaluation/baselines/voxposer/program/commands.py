"""What a program can call: find objects, paint value maps, and move. Everything it asks for is plain data."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from app.evaluation.baselines.voxposer.program.arguments import (
    CommandError,
    axis_number,
    finite,
    is_index,
    length_cm,
    map_value,
    span,
)
from app.evaluation.baselines.voxposer.program.voxels import SIZE, Box, Voxel, Voxels, pointing_down, turned, yaw_deg

MAX_MOVES = 40
MAX_PAINTED = 5_000  # boxes that are painted, and those that moves ask for
MAX_VOLUME = 300 * SIZE**3  # voxels that moves ask for: what painting them costs the service
KINDS = ("affordance", "avoidance", "rotation", "velocity", "gripper")
EVERYWHERE: Box = ((0, SIZE), (0, SIZE), (0, SIZE))
NO_TURN = (0.0, 0.0, 0.0, 1.0)
PLAIN: tuple[Callable[..., object], ...] = (range, len, enumerate, zip, min, max, sum, abs, round, int)


@dataclass(frozen=True, eq=False)
class Thing:
    """What `detect` gives.

    Attributes:
        low, high: the corners of its bounding box.
        voxels: those that hold a point of it.
        position_m, quaternion_xyzw: its pose; programs do not see them.
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
        """An object as the scene has it."""
        points = tuple((x, y, z) for x, y, z in value["voxels"])
        low, high = (tuple(pick(axis) for axis in zip(*points, strict=True)) for pick in (min, max))
        size_cm = tuple(
            round(100 * step * (last - first + 1), 1)
            for first, last, step in zip(low, high, voxels.step_m, strict=True)
        )
        turn = tuple(value["quaternion_xyzw"] or NO_TURN)
        at = voxels.at(value["position_m"])
        return cls(
            value["name"],
            at,
            (low[0], low[1], low[2]),
            (high[0], high[1], high[2]),
            size_cm,
            points,
            round(yaw_deg(turn), 1),
            tuple(value["position_m"]),
            turn,
        )


@dataclass(eq=False)
class ValueMap:
    """A map as a list of painted boxes; what is painted later lies on top.

    Attributes:
        kind: one of KINDS.
    """

    kind: str
    commands: "Commands"
    painted: list[tuple[Box, object]] = field(default_factory=list)

    def __setitem__(self, index: object, value: object) -> None:
        """Set the voxels at an index like [x, y, z] or [:, :, 10:20]."""
        parts = index if isinstance(index, tuple) else (index,)
        if not 1 <= len(parts) <= 3:
            raise CommandError("a map has three indices: [x, y, z]")
        x, y, z = (*(span(part) for part in parts), *EVERYWHERE[len(parts) :])
        self.add((x, y, z), value)

    def add(self, box: Box, value: object) -> None:
        """Set the voxels of a box."""
        self.commands.count_painted()
        if box == EVERYWHERE:
            self.painted.clear()  # it would have no effect
        self.painted.append((box, map_value(self.kind, value)))


class Commands:
    """Called by the program; keeps the moves that it asks for.

    Args:
        scene: see `sandbox.Scene.to_json`.
    """

    def __init__(self, scene: Mapping[str, Any]) -> None:
        self._voxels = Voxels(tuple(scene["min_m"]), tuple(scene["step_m"]))
        self._things = {item["name"]: Thing.read(item, self._voxels) for item in scene["objects"]}
        self._hand = Thing.read(scene["hand"], self._voxels)
        self._num_painted = 0
        self._num_asked = 0
        self._volume = 0
        self.moves: list[dict[str, list[tuple[Box, object]]]] = []

    def by_name(self) -> dict[str, Callable[..., object]]:
        """What a program can call."""
        maps = {f"empty_{kind}_map": self._map_maker(kind) for kind in KINDS}
        own = (self.detect, self.hand, self.shifted, self.shifted_along, self.set_voxels, self.set_object)
        more = (self.cm_to_voxels, self.voxels_to_cm, self.pointing_down, self.move)
        return {**{call.__name__: call for call in (*PLAIN, *own, *more)}, **maps}

    def count_painted(self) -> None:
        """Note that a box is painted."""
        self._num_painted += 1
        if self._num_painted > MAX_PAINTED:
            raise CommandError(f"the maps are painted in more than {MAX_PAINTED} places")

    def _map_maker(self, kind: str) -> Callable[[], ValueMap]:
        return lambda: ValueMap(kind, self)

    def detect(self, name: object) -> Thing:
        """The object of that name in the first image."""
        if not isinstance(name, str) or name not in self._things:
            raise CommandError(f"detect: there is no object {name!r:.60} (valid: {', '.join(map(repr, self._things))})")
        return self._things[name]

    def hand(self) -> Thing:
        """The end effector before the first move."""
        return self._hand

    def shifted(self, where: object, x_cm: object = 0, y_cm: object = 0, z_cm: object = 0) -> Voxel:
        """The voxel so far from an object or a voxel, along the world's axes."""
        return self._moved(where, (x_cm, y_cm, z_cm), NO_TURN)

    def shifted_along(self, thing: object, x_cm: object = 0, y_cm: object = 0, z_cm: object = 0) -> Voxel:
        """The same along the object's own axes."""
        if not isinstance(thing, Thing):
            raise CommandError("shifted_along takes an object from detect first")
        return self._moved(thing, (x_cm, y_cm, z_cm), thing.quaternion_xyzw)

    def _moved(self, where: object, by_cm: Sequence[object], turn: Sequence[float]) -> Voxel:
        start_m = where.position_m if isinstance(where, Thing) else self._voxels.centre_m(_voxel(where))
        by_m = turned(turn, [length_cm(value) / 100 for value in by_cm])
        return self._voxels.at([start + by for start, by in zip(start_m, by_m, strict=True)])

    def set_voxels(self, map: object, position: object, value: object = 1, radius_cm: object = 0) -> None:  # noqa: A002
        """Paint the box of that radius about a voxel."""
        at = _voxel(position)
        _a_map("set_voxels", map).add(self._voxels.around(at, at, abs(length_cm(radius_cm))), value)

    def set_object(self, map: object, thing: object, value: object = 1, margin_cm: object = 0) -> None:  # noqa: A002
        """Paint the bounding box of an object, and a margin about it."""
        if not isinstance(thing, Thing):
            raise CommandError("set_object takes a map, then an object from detect")
        _a_map("set_object", map).add(self._voxels.around(thing.low, thing.high, abs(length_cm(margin_cm))), value)

    def cm_to_voxels(self, cm: object, axis: object = "z") -> int:
        """How many voxels a length has along an axis."""
        return self._voxels.count(length_cm(cm), axis_number(axis))

    def voxels_to_cm(self, voxels: object, axis: object = "z") -> float:
        """How long so many voxels are along an axis."""
        return 100 * finite(voxels, "a number of voxels") * self._voxels.step_m[axis_number(axis)]

    def pointing_down(self, yaw_deg: object = 0, tilt_deg: object = 0) -> tuple[float, ...]:
        """A rotation of the gripper, its fingers closing at right angles to the yaw."""
        return pointing_down(finite(yaw_deg, "a yaw in degrees"), finite(tilt_deg, "a tilt in degrees"))

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
        maps = {kind: value.painted for kind, value in given.items() if isinstance(value, ValueMap)}
        if not any(isinstance(value, int | float) and value > 0 for _, value in maps.get("affordance", ())):
            raise CommandError("move: no voxel of the affordance map is above 0 (valid: set_voxels(map, position))")
        if len(self.moves) == MAX_MOVES:
            raise CommandError(f"the program moves more than {MAX_MOVES} times")
        self._count_asked(box for painted in maps.values() for box, _ in painted)
        self.moves.append({kind: list(painted) for kind, painted in maps.items()})

    def _count_asked(self, boxes: Iterable[Box]) -> None:
        for (x0, x1), (y0, y1), (z0, z1) in boxes:
            self._num_asked += 1
            self._volume += (x1 - x0) * (y1 - y0) * (z1 - z0)
        if self._num_asked > MAX_PAINTED or self._volume > MAX_VOLUME:
            raise CommandError(f"move: the maps hold more than {MAX_PAINTED} places or {MAX_VOLUME:.0e} voxels")


def _a_map(command: str, value: object) -> ValueMap:
    if not isinstance(value, ValueMap):
        raise CommandError(f"{command} takes a map first (valid: one of the empty_..._map())")
    return value


def _voxel(value: object) -> Voxel:
    if isinstance(value, Thing):
        return value.position
    if isinstance(value, tuple | list) and len(value) == 3 and all(is_index(number) for number in value):
        x, y, z = value
        return x, y, z
    raise CommandError(f"a position is three whole numbers (x, y, z), each 0..{SIZE - 1}, or an object from detect")
