import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.pipeline.workspace import (
    POSITION_BINS,
    RLBENCH_MAX_M,
    RLBENCH_MIN_M,
    ROTATION_BINS,
    Workspace,
    bin_center,
    discretize_actions,
    position_bins,
    rotation_bins,
    rotation_from_bins,
    undiscretize_actions,
    yaw_bin,
)
from roboprompt_client.errors import InvalidInputError

from .scenes import WORKSPACE, action, angle_deg, positions, rotated, rotations

TABLE = Workspace(np.array([-1.0, 0.2, 0.0]), np.array([0.5, 0.9, 0.3]))
ANY_ROTATION_BINS = st.tuples(*[st.integers(0, ROTATION_BINS - 1)] * 3)


def test_the_specs_action():
    bins = (46, 74, 55, 54, 36, 37)
    seen, closed = undiscretize_actions([(*bins, 1), (*bins, 0)], WORKSPACE)
    np.testing.assert_allclose(seen.position_m, [0.165, 0.245, 1.155])
    assert angle_deg(seen.quaternion_xyzw, rotated(90, 0, 5).as_quat()) < 1e-6
    assert (seen.gripper_open, closed.gripper_open) == (True, False)
    assert discretize_actions([seen], WORKSPACE)[0].bins == (*bins, 1)


@given(positions())
def test_a_position_comes_back_within_half_a_bin(position_m):
    back_m = bin_center(position_bins(position_m, WORKSPACE), WORKSPACE)
    assert (np.abs(back_m - position_m) <= WORKSPACE.bin_size_m / 2 + 1e-9).all()


@given(rotations())
def test_a_rotation_loses_at_most_seven_and_a_half_degrees(rotation):
    back = rotation_from_bins(rotation_bins(rotation))
    assert angle_deg(rotation.as_quat(), back.as_quat()) <= 7.5


@given(ANY_ROTATION_BINS)
def test_bins_stand_for_the_same_rotation_after_a_second_binning(bins):
    rotation = rotation_from_bins(bins)
    again = rotation_from_bins(rotation_bins(rotation))
    assert angle_deg(rotation.as_quat(), again.as_quat()) < 1e-4


@pytest.mark.parametrize("workspace", [WORKSPACE, TABLE], ids=["rlbench", "table"])
def test_an_exact_edge_falls_into_the_lower_bin(workspace):
    for k in range(1, POSITION_BINS + 1):
        assert position_bins(workspace.min_m + k * workspace.bin_size_m, workspace).tolist() == [k - 1] * 3
    assert position_bins(workspace.min_m, workspace).tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    ("position_m", "bins", "clamped"),
    [
        ((-0.31, 0.005, 1.105), (0, 50, 50), True),
        ((-9.0, -9.0, -9.0), (0, 0, 0), True),
        ((0.205, 0.51, 1.105), (50, 99, 50), True),
        ((1e9, 1e9, 1e9), (99, 99, 99), True),
        ((0.205, 0.005, 1.605), (50, 50, 99), True),
        ((-0.3, -0.5, 0.6), (0, 0, 0), False),
        ((0.7, 0.5, 1.6), (99, 99, 99), False),
        ((0.205, 0.005, 1.105), (50, 50, 50), False),
    ],
)
def test_a_position_outside_is_clamped_and_says_so(position_m, bins, clamped):
    (discrete,) = discretize_actions([action(position_m)], WORKSPACE)
    assert discrete.bins[:3] == bins
    assert discrete.clamped is clamped


@pytest.mark.parametrize(
    ("yaw_deg", "expected"),
    [(-180, 0), (180, 0), (178, 0), (177.4, 71), (-175, 1), (0, 36), (5, 37), (90, 54), (-2.4, 36), (-2.6, 35),
     (-177.5, 0), (-172.5, 2), (-2.5, 36), (2.5, 36), (7.5, 38), (177.5, 0)],
)  # fmt: skip
def test_yaw_bins_whose_halves_round_to_even(yaw_deg, expected):
    assert rotation_bins(rotated(0, 0, yaw_deg)).tolist() == [36, 36, expected]
    assert yaw_bin(math.radians(yaw_deg)) == expected


def test_angles_are_roll_pitch_yaw_about_fixed_axes():
    rotation = (
        Rotation.from_euler("z", 40, degrees=True)
        * Rotation.from_euler("y", 20, degrees=True)
        * Rotation.from_euler("x", -30, degrees=True)
    )
    assert rotation_bins(rotation).tolist() == [30, 40, 44]


def test_gimbal_lock_is_silent_and_keeps_the_rotation():
    locked = rotated(30, 90, 10)
    assert angle_deg(rotation_from_bins(rotation_bins(locked)).as_quat(), locked.as_quat()) <= 7.5


@pytest.mark.parametrize(
    ("low", "high", "field"),
    [
        ((0, 0, 0), (1, 0, 1), "workspace"),
        ((0, 0, 2), (1, 1, 1), "workspace"),
        ((0, 0), (1, 1, 1), "workspace.min"),
        ((0, 0, 0), (1, 1, math.nan), "workspace.max"),
        ((0, 0, -1e308), (1, 1, 1e308), "workspace"),
    ],
)
def test_a_box_without_volume_or_of_infinite_size_is_refused(low, high, field):
    with pytest.raises(InvalidInputError) as caught:
        Workspace(np.array(low), np.array(high))
    assert caught.value.field == field


PLACES = st.lists(positions((-2, -2, -1), (2, 2, 2)), min_size=1, max_size=6).map(np.array)


@given(PLACES)
def test_a_box_around_demonstrations_holds_them_with_a_margin(places_m):
    box = Workspace.around(places_m)
    assert (box.min_m <= places_m.min(axis=0) - [0.1, 0.1, 0.05] + 1e-6).all()
    assert (box.max_m >= places_m.max(axis=0) + 0.1 - 1e-6).all()
    assert (box.max_m - box.min_m >= 1 - 1e-9).all()
    for corner_m in (box.min_m, box.max_m):
        np.testing.assert_allclose(corner_m, np.round(corner_m / 0.05) * 0.05, atol=1e-9)


@given(PLACES)
def test_a_box_around_demonstrations_is_no_wider_than_it_must_be(places_m):
    box = Workspace.around(places_m)
    wanted_m = np.maximum(np.add(np.ptp(places_m, axis=0), [0.2, 0.2, 0.15]), 1.0)
    assert (box.max_m - box.min_m <= wanted_m + 0.1 + 1e-9).all()


@given(PLACES, PLACES)
def test_it_grows_only(first_m, more_m):
    before = Workspace.around(first_m)
    after = Workspace.around(more_m, grown_from=before)
    assert (after.min_m <= before.min_m).all()
    assert (after.max_m >= before.max_m).all()
    again = Workspace.around(np.concatenate([first_m, more_m]), grown_from=after)
    assert (again.min_m.tolist(), again.max_m.tolist()) == (after.min_m.tolist(), after.max_m.tolist())


def test_what_stands_on_a_table_gets_most_of_its_room_above():
    box = Workspace.around(np.array([[0.4, 0.0, 0.02], [0.5, 0.1, 0.2]]))
    assert (box.min_m.tolist(), box.max_m.tolist()) == ([-0.05, -0.45, -0.05], [0.95, 0.55, 1.0])


def box(*places_m):
    found = Workspace.of_demonstrations([np.array([place_m]) for place_m in places_m])
    return found.min_m.tolist(), found.max_m.tolist()


def test_a_workspace_is_what_demonstrations_span_at_least_a_meter_wide():
    assert box((0.3, 0.1, 0.02)) == ([-0.2, -0.4, -0.05], [0.8, 0.6, 1.0])
    assert box((0.3, 0.1, 0.02), (1.5, 0.1, 0.02)) == ([-0.2, -0.4, -0.05], [1.6, 0.6, 1.0])
    assert box() == (list(RLBENCH_MIN_M), list(RLBENCH_MAX_M))


def test_demonstrations_far_beyond_the_others_are_left_apart():
    near = [(0.3 + 0.01 * k, 0.1, 0.02) for k in range(4)]
    for far in ([(300.0, 0.1, 0.02)], [(0.3, -3.0, 0.02), (0.3, -50.0, 0.02)], [(9.0, 0.1, 0.02), (0.3, 0.1, 9.0)]):
        for places in (near + far, far + near):
            assert box(*places) == box(*near)


def test_no_demonstration_is_odd_beside_half_of_them_or_in_a_wide_task():
    for wide in ([(0.0, 0.0, 0.0), (9.0, 0.0, 0.0)], [(float(k), 0.0, 0.0) for k in range(9)]):
        low_m, high_m = box(*wide)
        assert (low_m[0] < 0.0, high_m[0] > wide[-1][0]) == (True, True)
