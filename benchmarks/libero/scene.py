"""LIBERO's tasks, and the scene of one and a seed: where its objects are, and how far they reach.

Test scenes are LIBERO's own 50 initial states of a task; demonstrations are given in scenes that it samples itself.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, ClassVar

import numpy as np

from benchmarks.robosuite.arm import CONTROL_HZ, MAX_STEPS, ControlledScene, Floats
from roboprompt_client.types.poses import ObjectPose

FIRST_TEST_SEED = 1000
SUITES = {"object": "libero_object", "spatial": "libero_spatial", "goal": "libero_goal", "long": "libero_10"}
# What instructions call objects whose names in LIBERO differ.
CALLED = {
    "akita black bowl": "black bowl",
    "glazed rim porcelain ramekin": "ramekin",
    "cookies": "cookie box",
    "porcelain mug": "white mug",
    "white yellow mug": "yellow and white mug",
}
CORNERS = np.array(list(product((-1, 1), repeat=3)))


@dataclass(frozen=True)
class Extent:
    """How far an object's parts that touch others reach, in the world frame.

    Attributes:
        points_m: (N, 3) the corners of their boxes.
    """

    points_m: Floats

    @property
    def bottom_m(self) -> float:
        return float(self.points_m[:, 2].min())

    @property
    def top_m(self) -> float:
        return float(self.points_m[:, 2].max())

    @property
    def middle_m(self) -> Floats:
        """(2,) of the box around it."""
        low_m, high_m = self.points_m[:, :2].min(axis=0), self.points_m[:, :2].max(axis=0)
        return np.asarray((low_m + high_m) / 2)

    def widths_m(self, yaws_rad: Floats) -> Floats:
        """Return its horizontal width (Y,) in each direction (Y,)."""
        along_m = self.points_m[:, :2] @ np.array([np.cos(yaws_rad), np.sin(yaws_rad)])
        return np.asarray(np.ptp(along_m, axis=0))


class Scene(ControlledScene):
    """The scene of a task and a seed, under way.

    The arm goes on after success: something may be on a plate before the hand has let go of it.
    """

    after_success_steps: ClassVar[int] = MAX_STEPS

    def __init__(self, task: str, seed: int) -> None:
        self.task = task
        wrapped = _environment(task)
        self.instruction = str(_task_of(task).language)
        wrapped.seed(seed)
        wrapped.reset()
        if seed >= FIRST_TEST_SEED:
            states = _initial_states(task)
            wrapped.set_init_state(states[(seed - FIRST_TEST_SEED) % len(states)])
        env = wrapped.env
        robot = env.robots[0]
        super().__init__(env, robot.eef_site_id, robot._ref_gripper_joint_pos_indexes, robot._ref_joint_vel_indexes)

    @property
    def goals(self) -> Sequence[Sequence[str]]:
        """The relations that solve it, e.g. ``("on", "akita_black_bowl_1", "plate_1")``."""
        goals: Sequence[Sequence[str]] = self.env.parsed_problem["goal_state"]
        return goals

    def objects(self) -> dict[str, ObjectPose]:
        """Return the true poses of all objects, by LIBERO's names."""
        return {id_: ObjectPose(called(id_), *self.pose_of(self.body_of(id_))) for id_ in self.env.obj_body_id}

    def body_of(self, id_: str) -> str:
        """Return the name of an object's body."""
        return str(self.env.sim.model.body_id2name(self.env.obj_body_id[id_]))

    def place_m(self, id_: str) -> Floats:
        """Return where something is put that goes to an object, or to a region of one: (3,) its middle and height."""
        if id_ in self.env.obj_body_id:
            extent = self.extent(id_)
            return np.append(extent.middle_m, extent.top_m)
        return np.array(self.env.sim.data.get_site_xpos(id_))

    def extent(self, id_: str) -> Extent:
        """Return how far an object reaches."""
        model, data = self.model, self.data
        root = self.env.obj_body_id[id_]
        own = [body for body in range(model.nbody) if body == root or model.body_rootid[body] == root]
        touches = np.isin(model.geom_bodyid, own) & (model.geom_contype > 0)
        boxes = model.geom_aabb[touches]
        local_m = boxes[:, None, :3] + CORNERS * boxes[:, None, 3:]
        axes = data.geom_xmat[touches].reshape(-1, 3, 3)
        points_m = np.einsum("gij,gcj->gci", axes, local_m) + data.geom_xpos[touches][:, None]
        return Extent(points_m.reshape(-1, 3))


def called(id_: str) -> str:
    """Return what people call an object of LIBERO, e.g. ``akita_black_bowl_1``."""
    kind = re.sub(r"_\d+$", "", id_).replace("_", " ")
    return CALLED.get(kind, kind)


@lru_cache
def tasks_of(suite: str) -> Any:  # noqa: ANN401
    """Return LIBERO's own list of a suite's tasks."""
    from libero.libero import benchmark

    return benchmark.get_benchmark_dict()[SUITES[suite]]()


def _task_of(task: str) -> Any:  # noqa: ANN401
    tasks, number = _numbered(task)
    return tasks.get_task(number)


def _numbered(task: str) -> tuple[Any, int]:
    suite, _, number = task.partition("_")
    return tasks_of(suite), int(number)


@lru_cache(maxsize=1)
def _environment(task: str) -> Any:  # noqa: ANN401
    from libero.libero import get_libero_path
    from libero.libero.envs.env_wrapper import ControlEnv

    found = _task_of(task)
    path = os.path.join(get_libero_path("bddl_files"), found.problem_folder, found.bddl_file)
    return ControlEnv(
        bddl_file_name=path,
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        control_freq=CONTROL_HZ,
        ignore_done=True,
        horizon=10 * MAX_STEPS,
    )


@lru_cache(maxsize=1)
def _initial_states(task: str) -> Floats:
    tasks, number = _numbered(task)
    return np.asarray(tasks.get_task_init_states(number))
