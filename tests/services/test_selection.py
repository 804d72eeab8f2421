import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.services.predict.task_reading import most_diverse, nearest_last

LINE_M = np.array([[[x, 0.0, 0.0]] for x in (0.0, 0.1, 0.5, 1.0, 0.52)])
SCENES = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(2), st.just(3)), elements=st.floats(-1, 1))


def test_nearest_scene_comes_last():
    assert nearest_last(LINE_M, np.array([[0.49, 0.0, 0.0]]), 3) == [1, 4, 2]


def test_every_object_counts():
    scenes_m = np.array([[[0.0, 0, 0], [1.0, 0, 0]], [[0.2, 0, 0], [0.3, 0, 0]]])
    assert nearest_last(scenes_m, np.array([[0.0, 0, 0], [0.3, 0, 0]]), 1) == [1]


def test_diverse_scenes_begin_with_the_first_and_go_to_the_farthest():
    assert most_diverse(LINE_M, 1) == [0]
    assert most_diverse(LINE_M, 2) == [0, 3]
    assert most_diverse(LINE_M, 3) == [0, 2, 3]


def test_equal_scenes_are_taken_once_each():
    assert most_diverse(np.zeros((4, 1, 3)), 3) == [0, 1, 2]


@given(SCENES, st.integers(1, 15))
def test_diverse_indices_are_different_and_as_many_as_there_can_be(scenes_m, number):
    chosen = most_diverse(scenes_m, number)
    assert len(set(chosen)) == len(chosen) == min(number, len(scenes_m))
    assert chosen == sorted(chosen)


@given(SCENES)
def test_no_scene_that_was_left_out_is_farther_than_the_chosen_are_from_each_other(scenes_m):
    number = min(3, len(scenes_m))
    chosen = most_diverse(scenes_m, number)
    distance_m = np.linalg.norm(scenes_m[:, None] - scenes_m[None], axis=3).sum(axis=2)
    covered_m = distance_m[:, chosen].min(axis=1).max()
    between = [distance_m[a, b] for a in chosen for b in chosen if a < b]
    assert not between or covered_m <= min(between) + 1e-9


@pytest.mark.parametrize("number", [1, 4])
def test_diverse_choice_is_the_same_every_time(number):
    scenes_m = np.random.default_rng(3).uniform(size=(50, 2, 3))
    assert most_diverse(scenes_m, number) == most_diverse(scenes_m.copy(), number)
