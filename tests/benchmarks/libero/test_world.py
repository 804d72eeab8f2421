"""LIBERO as a world, as far as it is ours: names, how far objects reach, and the expert's poses."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.libero import expert
from benchmarks.libero.scene import Extent, called
from benchmarks.libero.world import WORLD

HOME = Rotation.from_euler("z", np.pi / 2) * expert.DOWN
PLATE_M = np.array([0.1, 0.2, 0.02])


def box(size_m, middle_m=(0.0, 0.0, 0.05), yaw_deg=0.0):
    corners = np.array(list(product((-0.5, 0.5), repeat=3))) * size_m
    return Extent(Rotation.from_euler("z", yaw_deg, degrees=True).apply(corners) + middle_m)


def round_bowl(radius_m=0.055, height_m=0.05):
    turns = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rim_m = radius_m * np.column_stack([np.cos(turns), np.sin(turns)])
    return Extent(np.concatenate([np.column_stack([rim_m, np.full(60, z_m)]) for z_m in (0.0, height_m)]))


class Table:
    """One object and a plate, seen from a hand at home."""

    hand = HOME

    def __init__(self, extent, relation="on"):
        self._extent, self.goals = extent, [[relation, "thing_1", "plate_1"]]

    def extent(self, id_):
        return self._extent

    def place_m(self, id_):
        return PLATE_M


def closing_deg(action):
    """The direction in which the fingers close, 0 to 180."""
    x_axis = Rotation.from_quat(action.quaternion_xyzw).apply([1, 0, 0])
    return np.degrees(np.arctan2(x_axis[1], x_axis[0])) % 180


@pytest.mark.parametrize("yaw_deg", [-80, -30, 0, 45, 120])
def test_a_box_is_taken_over_its_narrow_side_with_the_least_turn(yaw_deg):
    grasp = expert.plan(Table(box((0.04, 0.12, 0.1), yaw_deg=yaw_deg)))[1]
    assert abs((closing_deg(grasp) - yaw_deg + 90) % 180 - 90) <= 3
    assert (Rotation.from_quat(grasp.quaternion_xyzw) * HOME.inv()).magnitude() <= np.pi / 2 + 1e-6
    np.testing.assert_allclose(grasp.position_m, [0, 0, 0.1 - expert.DEPTH_M], atol=1e-9)


def test_a_bowl_is_taken_by_its_rim_and_its_middle_put_over_the_plate():
    actions = expert.plan(Table(round_bowl()))
    grasp, released = actions[1], actions[6]
    aside_m = grasp.position_m[:2]
    assert np.linalg.norm(aside_m) == pytest.approx(0.055 - expert.RIM_M, abs=0.001)
    assert abs((closing_deg(grasp) - np.degrees(np.arctan2(*aside_m[::-1])) + 90) % 180 - 90) < 1e-6
    np.testing.assert_allclose(released.position_m[:2] - aside_m, PLATE_M[:2], atol=1e-9)
    assert [action.gripper_open for action in actions] == [True, True, False, False, False, False, True, True]


def test_a_flat_thing_is_held_above_the_table():
    flat = box((0.05, 0.08, 0.02), (0, 0, 0.01))
    assert expert.plan(Table(flat))[1].position_m[2] == pytest.approx(expert.LEAST_HEIGHT_M)


def test_a_task_that_needs_more_is_refused():
    with pytest.raises(NotImplementedError, match="turnon"):
        expert.plan(Table(round_bowl(), "turnon"))


@pytest.mark.parametrize(
    ("id_", "name"),
    [("akita_black_bowl_2", "black bowl"), ("cookies_1", "cookie box"), ("wooden_cabinet_1", "wooden cabinet")],
)
def test_objects_are_called_as_instructions_call_them(id_, name):
    assert called(id_) == name


def test_its_tasks_are_named_by_suite_and_number():
    assert {name.partition("_")[0] for name in WORLD.tasks} == {"object", "spatial", "goal", "long"}
