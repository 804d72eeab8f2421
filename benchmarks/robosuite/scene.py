"""robosuite's tasks, and the scene of one and a seed: where its objects are."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.robosuite.arm import CONTROL_HZ, MAX_STEPS, ControlledScene
from roboprompt_client.types.poses import ObjectPose


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


class Scene(ControlledScene):
    """The scene of a task and a seed, under way; what happens follows from these and the commands."""

    def __init__(self, task: str, seed: int) -> None:
        self.task = TASKS[task]
        env = _environment(task)
        random = np.random.default_rng(seed)
        env.rng = random
        sampler = env.placement_initializer
        for each in (sampler, *getattr(sampler, "samplers", {}).values()):
            each.rng = random
        env.reset()
        robot = env.robots[0]
        fingers, joints = robot._ref_gripper_joint_pos_indexes["right"], robot._ref_joint_vel_indexes[:7]
        super().__init__(env, int(robot.eef_site_id["right"]), fingers, joints)

    def objects(self) -> tuple[ObjectPose, ...]:
        """The true poses of the task's objects."""
        return tuple(ObjectPose(item.name, *self.pose_of(item.body)) for item in self.task.bodies)
