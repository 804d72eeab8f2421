import numpy as np
import pytest

from benchmarks.metaworld.demonstrate import (
    AFTER_SUCCESS_STEPS,
    RATES_HZ,
    Demonstration,
    DemonstrationCache,
    demonstrate,
    gripper_open,
    thinning,
    trajectory,
)
from tests.benchmarks.metaworld.button_world import ButtonWorld


@pytest.fixture
def world():
    return ButtonWorld(hopeless_from=5)


def test_a_demonstration_ends_shortly_after_the_task_is_done(world):
    made = demonstrate(world, 1)
    world.reset(1)
    observation, done, steps = world.reset(1), False, 0
    while not done:
        observation, done = world.step(world.policy(observation))
        steps += 1
    assert len(made.hand_m) == len(made.fingers) == len(made.joint_velocities_rad_s) == steps + AFTER_SUCCESS_STEPS
    np.testing.assert_array_equal(made.observation, world.reset(1))
    np.testing.assert_array_equal(made.hand_m[0], made.observation[:3])


def test_a_policy_that_does_not_succeed_demonstrates_nothing(world):
    assert demonstrate(world, 5) is None
    assert len(world.commands) == world.max_steps


@pytest.mark.parametrize(("record_hz", "every"), list(zip(RATES_HZ, (8, 4, 3, 2, 1), strict=True)))
def test_thinning_comes_nearest_to_the_rate(record_hz, every):
    assert thinning(80.0, record_hz) == every
    assert 80.0 / every == pytest.approx(record_hz, rel=0.02)


def test_a_trajectory_has_every_so_many_steps(world):
    made = demonstrate(world, 1)
    arrays = trajectory(made, 3)
    np.testing.assert_array_equal(arrays["end_effector_positions"], made.hand_m[::3])
    np.testing.assert_array_equal(arrays["joint_velocities"], made.joint_velocities_rad_s[::3])
    assert arrays["end_effector_quaternions_xyzw"].tolist() == [[1, 0, 0, 0]] * len(made.hand_m[::3])
    assert len(arrays["gripper_open"]) == len(made.hand_m[::3])
    assert len(trajectory(made, 1)["gripper_open"]) == len(made.hand_m)


def test_the_gripper_is_closed_when_its_fingers_are():
    commanded_at, fingers = 2, np.array([1.0, 1.0, 1.0, 0.9, 0.8, 0.6, 0.5, 0.5, 0.7, 0.9, 1.0])
    is_open = gripper_open(fingers)
    assert is_open.tolist() == [True] * 5 + [False] * 3 + [False] + [True] * 2
    assert np.flatnonzero(~is_open)[0] > commanded_at


def test_fingers_that_hardly_move_are_open():
    assert gripper_open(np.array([0.95, 1.0, 0.91])).all()
    assert not gripper_open(np.array([0.95, 1.0, 0.89])).all()


class Unmoved(ButtonWorld):
    def step(self, command):
        raise AssertionError("the cache has what this would find out")


@pytest.mark.parametrize("seed", [1, 5], ids=["succeeds", "fails"])
def test_the_cache_runs_a_policy_once(tmp_path, world, seed):
    cache = DemonstrationCache(tmp_path)
    made, kept = cache.get(world, "push", seed), DemonstrationCache(tmp_path).get(Unmoved(), "push", seed)
    assert (made is None) == (kept is None) == (seed == 5)
    for name in Demonstration.__dataclass_fields__ if made else ():
        np.testing.assert_array_equal(getattr(made, name), getattr(kept, name))
    assert [path.name for path in tmp_path.rglob("*.*")] == [f"{seed}.npz"]


def test_without_a_folder_nothing_is_kept(world):
    cache = DemonstrationCache(None)
    assert cache.get(world, "push", 1) is not None
    with pytest.raises(AssertionError, match="the cache has"):
        cache.get(Unmoved(), "push", 1)
