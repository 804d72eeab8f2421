"""Fetch as a world, as far as it is ours: experts, what is recorded, and the way of the arm."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.fetch import world
from roboprompt_client.types.poses import EndEffectorAction

HOME_M = np.array([1.34, 0.75, 0.53])
REACH_M = 0.045  # from the hand to a block's center: nearer, the block gives way


class Table:
    """A small stand-in for Fetch: a hand that goes where it is sent, and a block that it pushes, or holds."""

    model = SimpleNamespace(joint=lambda name: SimpleNamespace(dofadr=[len(name) % 7]))
    data = SimpleNamespace(qvel=np.full(7, 0.1))

    def __init__(self, name, apart_m=0.2):
        self._name, self._apart_m = name, apart_m

    def reset(self, *, seed):
        random = np.random.default_rng(seed)
        angle_rad = random.uniform(-np.pi, np.pi)
        self._hand_m, self._width_m, self._held = HOME_M.copy(), 0.0, False
        self._block_m = np.array([*(HOME_M[:2] + random.uniform(-0.1, 0.1, 2)), 0.42])
        self._target_m = self._block_m + self._apart_m * np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])
        return self._seen(), {}

    def step(self, action):
        before_m, self._hand_m = self._hand_m.copy(), self._hand_m + world.STEP_M * action[:3]
        self._width_m = float(np.clip(self._width_m + 0.02 * action[3], 0.0, 0.1))
        off_m = self._block_m - self._hand_m
        if self._name == "FetchPickAndPlace-v4":
            self._held = 0 < self._width_m < 0.06 and (self._held or np.linalg.norm(off_m) < 0.01)
            self._width_m = max(self._width_m, 0.05 if self._held else 0.0)
            self._block_m += self._hand_m - before_m if self._held else 0.0
        elif np.linalg.norm(off_m) < REACH_M:
            self._block_m[:2] += (off_m * (REACH_M / np.linalg.norm(off_m) - 1))[:2]
        return self._seen(), 0.0, False, False, {}

    def _seen(self):
        reaches = self._name == "FetchReach-v4"
        fingers = np.full(2, self._width_m / 2)
        others = fingers if reaches else np.concatenate([self._block_m, np.zeros(3), fingers, np.zeros(14)])
        moved_m = self._hand_m if reaches else self._block_m
        observation = np.concatenate([self._hand_m, others])
        return {"observation": observation, "achieved_goal": moved_m.copy(), "desired_goal": self._target_m}


@pytest.fixture(autouse=True)
def table(monkeypatch):
    monkeypatch.setattr(world, "_environment", Table)


@pytest.mark.parametrize("task", world.TASKS)
@pytest.mark.parametrize("seed", range(3))
def test_experts_solve_their_tasks(task, seed):
    shown = world.WORLD.demonstrate(task, seed)
    assert (shown.succeeded, shown.failure) == (True, "")
    assert shown.trajectory.num_joints == len(world.JOINTS)
    closes = np.count_nonzero(np.diff(shown.trajectory.gripper_open.astype(int)) < 0)
    assert closes == (1 if task == "fetch_place" else 0)


def test_a_block_that_starts_at_its_target_is_no_demonstration(monkeypatch):
    monkeypatch.setattr(world, "_environment", lambda name: Table(name, apart_m=0.04))
    shown = world.WORLD.demonstrate("fetch_push", 0)
    assert (shown.succeeded, shown.failure) == (False, "it was solved from the start")


def test_predicted_actions_are_carried_out_one_after_the_other():
    scene = world.WORLD.view("fetch_place", 5)
    block_m, target_m = (pose.position_m for pose in scene.objects)
    ways = [(block_m + world.ABOVE_M, True), (block_m, True), (block_m, False), (target_m, False)]
    actions = [EndEffectorAction(at_m, np.array(world.DOWNWARD_XYZW), is_open) for at_m, is_open in ways]
    assert world.WORLD.execute(scene, actions).succeeded
    failed = world.WORLD.execute(scene, actions[:3])
    assert (failed.succeeded, failed.failure) == (False, "20 cm from the target in the end")


def test_it_is_recorded_at_the_rate_of_its_control():
    assert world.WORLD.recorded_at(world.CONTROL_HZ) is world.WORLD
    with pytest.raises(ValueError, match="recorded at 25 Hz"):
        world.WORLD.recorded_at(10.0)
