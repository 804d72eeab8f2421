import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from app.services.predict.scenes import Scenes
from roboprompt_client.types.poses import ObjectPose

LINE_M = np.array([[[x, 0.0, 0.0]] for x in (0.0, 0.1, 0.5, 1.0, 0.52)])
SCENES = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(2), st.just(3)), elements=st.floats(-1, 1))


def scenes(positions_m):
    """With their places in the list as ids."""
    return Scenes(tuple(range(len(positions_m))), tuple("ab"[: positions_m.shape[1]]), positions_m)


def test_the_nearest_scene_comes_last_and_every_object_counts():
    assert scenes(LINE_M).nearest_last([ObjectPose("a", np.array([0.49, 0, 0]))], 3) == (1, 4, 2)
    two_m = np.array([[[0.0, 0, 0], [1.0, 0, 0]], [[0.2, 0, 0], [0.3, 0, 0]]])
    observed = [ObjectPose("b", np.array([0.3, 0, 0])), ObjectPose("a", np.zeros(3))]
    assert scenes(two_m).nearest_last(observed, 1) == (1,)


def test_diverse_scenes_begin_with_the_first_and_go_to_the_farthest():
    assert [scenes(LINE_M).most_diverse(number) for number in (1, 2, 3)] == [(0,), (0, 3), (0, 2, 3)]
    assert scenes(np.zeros((4, 1, 3))).most_diverse(3) == (0, 1, 2)


@given(SCENES, st.integers(1, 15))
def test_diverse_scenes_are_different_and_no_other_is_farther_than_they_are_from_each_other(positions_m, number):
    chosen = list(scenes(positions_m).most_diverse(number))
    assert len(set(chosen)) == len(chosen) == min(number, len(positions_m))
    assert chosen == sorted(chosen)
    distance_m = np.linalg.norm(positions_m[:, None] - positions_m[None], axis=3).sum(axis=2)
    covered_m = distance_m[:, chosen].min(axis=1).max()
    between = [distance_m[a, b] for a in chosen for b in chosen if a < b]
    assert not between or covered_m <= min(between) + 1e-9
