"""robosuite's simulated Panda in the scene of a seed: where its hand and objects are, and how the hand is moved.

Positions are in meters in robosuite's world frame; quaternions are xyzw. The hand's frame is robosuite's grip site: z
points out of the fingers, which close along x.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from roboprompt_client.types.poses import ObjectPose

Floats = NDArray[np.float64]
CONTROL_HZ = 20.0
STEP_M, STEP_RAD = 0.05, 0.5  # the motions that OSC_POSE makes of a command of 1
OPEN, CLOSE = -1.0, 1.0  # the gripper's command
MAX_STEPS = 1500
AFTER_SUCCESS_STEPS = 12  # so long the arm goes on
SETTLING_STEPS = 10  # in which the objects fall onto the table


@dataclass(frozen=True)
class Body:
    """An object of a scene: `name` for people, `body` in robosuite's model.

    Attributes:
        visible: whether cameras see it; robosuite marks the place in the bin by a body that is not there.
    """

    name: str
    body: str
    visible: bool = True


@dataclass(frozen=True)
class Task:
    """One of robosuite's tasks, with the objects that a perception system would report.

    Attributes:
        scripted: whether `expert` can demonstrate it.
        looked_at_m: (3,) the point of the table at which cameras look.
    """

    env: str
    instruction: str
    bodies: tuple[Body, ...]
    scripted: bool = True
    looked_at_m: tuple[float, float, float] = (0.0, 0.0, 0.8)


TASKS: dict[str, Task] = {
    "lift": Task("Lift", "lift the cube", (Body("cube", "cube_main"),)),
    "stack": Task(
        "Stack",
        "stack the red cube on the green cube",
        (Body("red cube", "cubeA_main"), Body("green cube", "cubeB_main")),
    ),
    **{
        name: Task(
            f"PickPlace{name.title()}",
            f"put the {name} into the bin",
            (Body(name, f"{name.title()}_main"), Body("bin", f"Visual{name.title()}_main", visible=False)),
            looked_at_m=(0.1, -0.25, 0.8),
        )
        for name in ("can", "milk", "bread", "cereal")
    },
    "square_nut": Task(
        "NutAssemblySquare",
        "put the square nut on the peg",
        (Body("square nut", "SquareNut_main"), Body("peg", "peg1")),
        looked_at_m=(0.0, 0.0, 0.82),
    ),
    "round_nut": Task(
        "NutAssemblyRound",
        "put the round nut on the peg",
        (Body("round nut", "RoundNut_main"), Body("peg", "peg2")),
        looked_at_m=(0.0, 0.0, 0.82),
    ),
    "door": Task("Door", "open the door by its handle", (Body("door handle", "Door_latch"),)),
    "both_nuts": Task(
        "NutAssembly",
        "put the square nut on the square peg and the round nut on the round peg",
        (
            Body("square nut", "SquareNut_main"),
            Body("round nut", "RoundNut_main"),
            Body("square peg", "peg1"),
            Body("round peg", "peg2"),
        ),
        scripted=False,
    ),
    "four_objects": Task(
        "PickPlace",
        "put the milk, the bread, the cereal and the can into the bin",
        (
            Body("milk", "Milk_main"),
            Body("bread", "Bread_main"),
            Body("cereal", "Cereal_main"),
            Body("can", "Can_main"),
            Body("bin", "bin2"),
        ),
        scripted=False,
    ),
}


def gripper_open(widths_m: Floats) -> NDArray[np.bool_]:
    """(T,) whether the gripper is open: its fingers are farther apart than in the middle of the recording's extremes.

    Args:
        widths_m: (T,) between the fingers.
    """
    return np.asarray(widths_m > (widths_m.min() + widths_m.max()) / 2)


@lru_cache(maxsize=1)
def _environment(task: str) -> Any:  # noqa: ANN401
    import robosuite
    from robosuite.controllers import load_composite_controller_config

    return robosuite.make(
        TASKS[task].env,
        robots="Panda",
        controller_configs=load_composite_controller_config(controller="BASIC", robot="Panda"),
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        use_object_obs=True,
        control_freq=CONTROL_HZ,
        ignore_done=True,
        horizon=10 * MAX_STEPS,
        hard_reset=False,
    )


class Scene:
    """The scene of a task and a seed, under way; what happens follows from these and the commands."""

    def __init__(self, task: str, seed: int) -> None:
        self.task = TASKS[task]
        self._env = _environment(task)
        random = np.random.default_rng(seed)
        self._env.rng = random
        sampler = self._env.placement_initializer
        for each in (sampler, *getattr(sampler, "samplers", {}).values()):
            each.rng = random
        self._env.reset()
        self.steps = 0
        self.done = False
        self._after = 0
        for _ in range(SETTLING_STEPS):
            self._env.step(np.array([0, 0, 0, 0, 0, 0, OPEN]))

    @property
    def ended(self) -> bool:
        """Whether nothing moves any more."""
        return self._after >= AFTER_SUCCESS_STEPS or self.steps >= MAX_STEPS

    @property
    def hand_m(self) -> Floats:
        """(3,) where the grip site is."""
        return np.array(self._env.sim.data.site_xpos[self._site])

    @property
    def hand(self) -> Rotation:
        """How the grip site is turned."""
        return Rotation.from_matrix(self._env.sim.data.site_xmat[self._site].reshape(3, 3))

    @property
    def _site(self) -> int:
        return int(self._env.robots[0].eef_site_id["right"])

    @property
    def width_m(self) -> float:
        """Between the fingers."""
        qpos = self._env.sim.data.qpos[self._env.robots[0]._ref_gripper_joint_pos_indexes["right"]]
        return float(qpos[0] - qpos[1])

    @property
    def joint_velocities_rad_s(self) -> Floats:
        """(7,)."""
        return np.array(self._env.sim.data.qvel[self._env.robots[0]._ref_joint_vel_indexes[:7]])

    @property
    def model(self) -> Any:  # noqa: ANN401
        """MuJoCo's own model."""
        return self._env.sim.model._model

    @property
    def data(self) -> Any:  # noqa: ANN401
        """MuJoCo's own data."""
        return self._env.sim.data._data

    def objects(self) -> tuple[ObjectPose, ...]:
        """The true poses of the task's objects."""
        return tuple(ObjectPose(item.name, *self._pose(item.body)) for item in self.task.bodies)

    def _pose(self, body: str) -> tuple[Floats, Floats]:
        data, number = self._env.sim.data, self._env.sim.model.body_name2id(body)
        wxyz = np.array(data.body_xquat[number])
        return np.array(data.body_xpos[number]), wxyz[[1, 2, 3, 0]]

    def step(self, target_m: Floats, target: Rotation, gripper: float, fastest: float = 1.0) -> None:
        """One control step towards a pose; soon after success, or after too many steps, nothing moves.

        Args:
            target_m: (3,).
            fastest: the share of the controller's fastest motion.
        """
        if self.ended:
            return
        way = (target_m - self.hand_m) / STEP_M
        turn = (target * self.hand.inv()).as_rotvec() / STEP_RAD
        limited = [part * min(1.0, fastest / max(float(np.abs(part).max()), 1e-9)) for part in (way, turn)]
        self._env.step(np.concatenate([*limited, [gripper]]))
        self.steps += 1
        self.done = self.done or bool(self._env._check_success())
        self._after += self.done

    def off(self, target_m: Floats, target: Rotation) -> tuple[float, float]:
        """How far the hand is from a pose, in meters and radians."""
        return float(np.linalg.norm(target_m - self.hand_m)), float((target * self.hand.inv()).magnitude())
