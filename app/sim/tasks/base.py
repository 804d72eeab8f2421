"""The base of a task: a scene drawn from a seed, an instruction, an expert that solves it and a test of success.

To add a task, write a subclass of SimTask in the module of its domain and name it in `app.sim.tasks`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.moves import Move, nearest_yaw_rad, tool_down
from app.sim.scene import NO_TURN, SceneBody, about_z
from app.sim.world import OBJECT_CONTACT, base_spec, place_arm
from roboprompt_client.types.arrays import Array
from roboprompt_client.types.poses import ObjectPose

SETTLE_S = 0.3
FINAL_HOLD_S = 0.5  # things come to rest before the outcome is judged
NOT_SOLVED = "every action was carried out, but the task is not solved"
OPEN_FINGER_M = panda.FINGER_TRAVEL_M / 2  # the gripper is commanded open above this


class SimTask(ABC):
    """One scene of a task, the arm at home. A task instance is determined by seed and variation.

    Args:
        seed: draws the scene.
        variation: which of the task's variations the instruction asks for; they take turns with the seed by default, so
            that consecutive seeds demonstrate them all.

    Attributes:
        model, data: the MuJoCo scene (mujoco.MjModel, mujoco.MjData).
        events: what `latch` has noted since the scene was set up.
        way: which of its ways the expert goes, 0..ways - 1.
    """

    name: ClassVar[str]
    # The objects that a prompt names; each is the name of a body, whose origin and axes are the object's pose.
    object_names: ClassVar[tuple[str, ...]]
    # Combinations that demonstrations show, and those that only tests ask for; one variation each, see `combination`.
    SHOWN: ClassVar[tuple[Any, ...]] = ()
    ASKED: ClassVar[tuple[Any, ...]] = ()
    # What demonstrations show: variations 0..variations - 1.
    variations: ClassVar[int] = 1
    # Variations numbered on from these, which no demonstration shows; tests ask for them, see `test_variation`.
    test_only_variations: ClassVar[int] = 0
    # How many ways of solving a scene the expert knows, where a second one comes naturally; see `way`.
    ways: ClassVar[int] = 1
    # The turn about its own z axis, in degrees, that leaves an object unchanged: 90 for a cube, 0 for a round object
    # (its yaw means nothing). An object that is not listed has no such symmetry.
    yaw_symmetry_deg: ClassVar[Mapping[str, float]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.SHOWN:
            cls.variations, cls.test_only_variations = len(cls.SHOWN), len(cls.ASKED)

    def __init__(self, seed: int, variation: int | None = None) -> None:
        self.variation = seed % self.variations if variation is None else variation
        self.events: list[str] = []
        self.way = 0
        self._spec = base_spec()
        self.build(np.random.default_rng(seed))
        self.model: mujoco.MjModel = self._spec.compile()
        self.data: mujoco.MjData = mujoco.MjData(self.model)
        self._reset()

    @classmethod
    def test_variation(cls, seed: int) -> int:
        """The variation for a test on the scene of a seed: in turn those for tests only, if the task has any."""
        if cls.test_only_variations:
            return cls.variations + seed % cls.test_only_variations
        return seed % cls.variations

    @property
    def combination(self) -> Any:  # noqa: ANN401 - each task has combinations of its own type
        """The element of `SHOWN` and `ASKED` that the variation selects."""
        return (*self.SHOWN, *self.ASKED)[self.variation]

    def _reset(self) -> None:
        place_arm(self.model, self.data)
        self.after_reset()
        mujoco.mj_step(self.model, self.data, round(SETTLE_S / self.model.opt.timestep))
        self.data.time = 0.0
        mujoco.mj_forward(self.model, self.data)

    @abstractmethod
    def build(self, random: np.random.Generator) -> None:
        """Add the task's bodies by `add_part`, drawing places from `random`."""

    def after_reset(self) -> None:  # noqa: B027 - a hook that most tasks leave empty
        """Set joints that do not start at 0, look up what `latch` needs; `model` and `data` stand."""

    def latch(self) -> None:  # noqa: B027 - most tasks have nothing to do here
        """Note what happens in passing in `events`; called after every simulation step, so cheap."""

    @property
    @abstractmethod
    def instruction(self) -> str:
        """The instruction for the robot."""

    @abstractmethod
    def expert(self) -> list[Move]:
        """Moves that solve the scene as it stands now."""

    @abstractmethod
    def succeeded(self) -> bool:
        """Whether the task is solved as the scene stands now (criteria: the paper's supplement)."""

    def add_part(
        self,
        name: str,
        position_m: npt.ArrayLike,
        rotation: Rotation = NO_TURN,
        *,
        free: bool = False,
        parent: SceneBody | None = None,
    ) -> SceneBody:
        """A new body, of the world or of another part, which it then does not collide with; for use in `build`."""
        if parent is not None:
            self._spec.add_exclude(bodyname1=parent.body.name, bodyname2=name)
        return SceneBody(self._spec.worldbody if parent is None else parent.body, name, position_m, rotation, free=free)

    def add_cube(
        self,
        name: str,
        color: str,
        center_m: npt.ArrayLike,
        half_m: float,
        yaw_rad: float = 0.0,
        *,
        mass_kg: float,
        friction: float = 0.6,
    ) -> None:
        """A cube that moves freely, upright, its center (3,) in the world frame; for use in `build`."""
        cube = self.add_part(name, center_m, about_z(yaw_rad), free=True)
        cube.box((half_m,) * 3, color, mass_kg=mass_kg, friction=friction)

    def object_poses(self) -> tuple[ObjectPose, ...]:
        """The true poses of the objects, in the world frame."""
        return tuple(
            ObjectPose(name, self.position_m(name), self.rotation(name).as_quat(canonical=True))
            for name in self.object_names
        )

    def mask_ids(self) -> dict[str, tuple[int, ...]]:
        """For each object the ids by which segmentation masks show it: its body and those that it carries."""
        return {name: self._subtree(self.model.body(name).id) for name in self.object_names}

    def _subtree(self, body_id: int) -> tuple[int, ...]:
        children = np.flatnonzero(self.model.body_parentid == body_id).tolist()
        return (body_id, *(i for child in children if child != body_id for i in self._subtree(child)))

    def position_m(self, body: str | int) -> Array:
        """(3,) of a body's origin in the world frame; the body by name or id."""
        position: Array = self.data.body(body).xpos.copy()
        return position

    def rotation(self, body: str | int) -> Rotation:
        """From a body's axes to the world's; the body by name or id."""
        return Rotation.from_matrix(self.data.body(body).xmat.reshape(3, 3))

    def yaw_rad(self, body: str) -> float:
        """The heading of a body's x axis."""
        matrix = self.data.body(body).xmat
        return float(np.arctan2(matrix[3], matrix[0]))

    def nearest_yaw_rad(self, body: str) -> float:
        """The heading of a body's x axis; under a symmetry of the body, the equivalent one nearest to 0."""
        symmetry_deg = self.yaw_symmetry_deg.get(body)
        return nearest_yaw_rad(self.yaw_rad(body), np.radians(symmetry_deg)) if symmetry_deg else self.yaw_rad(body)

    def tool_over(self, body: str) -> Rotation:
        """The tool pointing down, in line with a body's `nearest_yaw_rad`."""
        return tool_down(self.nearest_yaw_rad(body))

    def grasp(self, body: str) -> tuple[Array, Rotation]:
        """Where a body's origin is (3,), and the tool over it."""
        return self.position_m(body), self.tool_over(body)

    def body_to_world(self, body: str, points_m: npt.ArrayLike) -> Array:
        """Points (3,) or (N, 3) in a body's frame -> the world frame."""
        points: Array = self.position_m(body) + self.rotation(body).apply(points_m)
        return points

    def world_to_body(self, body: str, points_m: npt.ArrayLike) -> Array:
        """Points (3,) or (N, 3) in the world frame -> a body's frame."""
        points: Array = self.rotation(body).inv().apply(np.asarray(points_m) - self.position_m(body))
        return points

    def joint_position(self, joint: str) -> float:
        """Of a joint of one degree of freedom, m or rad."""
        return float(self.data.joint(joint).qpos[0])

    def gripper_holds_nothing(self) -> bool:
        """Whether the gripper is commanded open and at most one of its pads touches an object."""
        if self.data.ctrl[panda.GRIPPER_CTRL] < OPEN_FINGER_M:
            return False
        pads = {self.model.geom(name).id for name in panda.PAD_NAMES}
        pairs = self.data.contact.geom[: self.data.ncon]
        touching = {
            pad
            for pair in pairs.tolist()
            for pad, other in (pair, pair[::-1])
            if pad in pads and self.model.geom_contype[other] == OBJECT_CONTACT["contype"]
        }
        return len(touching) < len(pads)
