"""Put a block close to, or far to, the left or the right of another, or between two others."""

import numpy as np

from app.sim.moves import UP, Move, nearest_yaw_rad, pick, place, tool_down
from app.sim.scene import scatter
from app.sim.tasks.composition.base import BLOCK_HALF_M, CompositionTask
from app.sim.world import TABLE_TOP_M
from roboprompt_client.arrays import Array

BLOCK = "red block"
OTHERS = ("blue block", "green block", "yellow block")
BETWEEN = "between"
# Along the world's y axis, which points to the left as the robot sees it
OFFSETS_M = {
    "close to the left of": 0.10,
    "far to the left of": 0.18,
    "close to the right of": -0.10,
    "far to the right of": -0.18,
}
# A relation, and the blocks that it relates to
Relation = tuple[str, tuple[str, ...]]
BLUE, GREEN, YELLOW = ((other,) for other in OTHERS)
SHOWN: tuple[Relation, ...] = (
    ("close to the left of", BLUE),
    ("far to the left of", GREEN),
    ("close to the right of", YELLOW),
    (BETWEEN, GREEN + BLUE),
    ("close to the left of", YELLOW),
    ("far to the left of", BLUE),
    ("close to the right of", GREEN),
    (BETWEEN, YELLOW + GREEN),
    ("close to the right of", BLUE),
    ("far to the left of", YELLOW),
)
ASKED: tuple[Relation, ...] = (
    ("far to the right of", BLUE),
    ("far to the right of", GREEN),
    (BETWEEN, BLUE + YELLOW),
    ("far to the right of", YELLOW),
)
LOW_M, HIGH_M = (0.04, -0.30), (0.36, 0.30)
REACHED_LOW_M, REACHED_HIGH_M = (0.04, -0.34), (0.36, 0.34)
MIN_DISTANCE_M, ROOM_M = 0.11, 0.095
MAX_SCENES = 10_000
MAX_OFFSET_M, MAX_PUSH_M = 0.03, 0.02
DROP_M = 0.004


class PlaceBeside(CompositionTask):
    """Four 4.4 cm blocks in x 0.04..0.36 m, y -0.30..0.30 m, at least 11 cm apart; poses are centres.

    Close is 10 cm, far is 18 cm from centre to centre. Demonstrated are close and far to the left, close to the right,
    and between two of the pairs; asked for are far to the right, and between the third pair. Success: the red block
    lies within 3 cm of its place, the others have not been pushed by 2 cm or more, and the gripper holds nothing.
    """

    name = "place_beside"
    object_names = (BLOCK, *OTHERS)
    yaw_symmetry_deg = dict.fromkeys(object_names, 90.0)
    variations, test_only_variations = len(SHOWN), len(ASKED)

    @property
    def relation(self) -> Relation:
        """What the instruction asks for."""
        return (*SHOWN, *ASKED)[self.variation]

    def build(self, random: np.random.Generator) -> None:
        self._points = self._scene(random)
        for name, point in self._points.items():
            self.add_block(name, name.split()[0], point, random.uniform(-np.pi, np.pi))

    def _scene(self, random: np.random.Generator) -> dict[str, Array]:
        """Where the blocks lie, with room for what is asked for."""
        for _ in range(MAX_SCENES):
            points = scatter(random, len(self.object_names), LOW_M, HIGH_M, MIN_DISTANCE_M)
            named = dict(zip(self.object_names, points, strict=True))
            goal = self._goal(named)
            within = (goal >= REACHED_LOW_M).all() and (goal <= REACHED_HIGH_M).all()
            if within and min(np.linalg.norm(goal - point) for point in points) >= ROOM_M:
                return named
        raise ValueError(f"no scene has room {self.relation}")

    def _goal(self, points: dict[str, Array]) -> Array:
        relation, others = self.relation
        goal: Array = np.mean([points[other] for other in others], axis=0)
        goal[1] += OFFSETS_M.get(relation, 0.0)
        return goal

    @property
    def instruction(self) -> str:
        relation, others = self.relation
        return f"put the {BLOCK} {relation} " + " and ".join(f"the {other}" for other in others)

    def expert(self) -> list[Move]:
        grasp = tool_down(nearest_yaw_rad(self.yaw_rad(BLOCK), np.pi / 2))
        goal_m = np.array([*self._goal(self._points), TABLE_TOP_M + BLOCK_HALF_M])
        return pick(self.position_m(BLOCK), grasp) + place(goal_m + DROP_M * UP, tool_down(), straight=True)

    def succeeded(self) -> bool:
        there = {name: float(np.linalg.norm(self.position_m(name)[:2] - at)) for name, at in self._wanted().items()}
        stayed = all(there[other] < MAX_PUSH_M for other in OTHERS)
        return there[BLOCK] < MAX_OFFSET_M and stayed and self.on_table(BLOCK) and self.gripper_holds_nothing()

    def _wanted(self) -> dict[str, Array]:
        return {**self._points, BLOCK: self._goal(self._points)}
