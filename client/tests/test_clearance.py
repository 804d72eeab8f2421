import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roboprompt_client.motion.guard import clearance_m, passes_through

LOW, HIGH = (0.0, 0.0, 0.0), (1.0, 2.0, 3.0)
PLACES = st.tuples(*[st.floats(-4, 6, allow_subnormal=False).map(lambda value: round(value, 3))] * 3)


def sampled_m(start_m, end_m):
    """The distance of the nearest of many places on the way."""
    places_m = np.linspace(start_m, end_m, 4001)
    return np.linalg.norm(places_m - np.clip(places_m, LOW, HIGH), axis=1).min()


@given(PLACES, PLACES)
def test_the_clearance_is_the_distance_of_the_nearest_place(start_m, end_m):
    step_m = np.linalg.norm(np.subtract(end_m, start_m)) / 4000
    assert sampled_m(start_m, end_m) - step_m - 1e-9 <= clearance_m(start_m, end_m, LOW, HIGH)
    assert clearance_m(start_m, end_m, LOW, HIGH) <= sampled_m(start_m, end_m) + 1e-9


@given(PLACES, PLACES)
def test_a_way_through_has_places_inside(start_m, end_m):
    places_m = np.linspace(start_m, end_m, 4001)
    inside = ((places_m > LOW) & (places_m < HIGH)).all(axis=1)
    if inside.any():
        assert passes_through(start_m, end_m, LOW, HIGH)
    if passes_through(start_m, end_m, LOW, HIGH):
        assert sampled_m(start_m, end_m) <= np.linalg.norm(np.subtract(end_m, start_m)) / 4000


@pytest.mark.parametrize(
    ("start_m", "end_m", "through"),
    [
        ((-1, 1, 1), (2, 1, 1), True),
        ((-1, 1, 3), (2, 1, 3), False),  # along its top
        ((0.5, 1, 4), (0.5, 1, 3), False),  # down to its top
        ((0.5, 1, 1), (0.5, 1, 1), True),  # no way at all, inside
        ((0, 1, 1), (0, 1, 1), False),
        ((-2, 1, 1), (-1, 1, 1), False),  # ends before it
        ((3, 1, 1), (2, 1, 1), False),
        ((1.5, -0.5, 1), (-0.5, 1.5, 1), True),  # across an edge
    ],
)
def test_faces_do_not_count(start_m, end_m, through):
    assert passes_through(start_m, end_m, LOW, HIGH) is through


def test_past_a_corner():
    assert clearance_m((2, 2, 4), (2, 2, 4), LOW, HIGH) == pytest.approx(2**0.5)
    assert clearance_m((1, 3, 5), (1, 5, 3), LOW, HIGH) == pytest.approx(2**0.5 * 1.5)
    assert clearance_m((2, 0, 1), (2, 9, 1), LOW, HIGH) == 1


def test_the_least_step_of_a_float_is_a_way_too():
    assert clearance_m((5e-324, 9, 9), (0, 9, 9), LOW, HIGH) > 0
