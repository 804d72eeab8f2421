"""A prepared pickle used to end the importer with a pointer of its author's choice (SIGSEGV)."""

import numpy as np
import pytest

from app.datasets.bounds import Budget, DamagedError
from app.datasets.rlbench_pickle import load_demo
from tests.datasets import hostile_pickles as pickles


def written(tmp_path, data):
    path = tmp_path / "low_dim_obs.pkl"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", pickles.ATTACKS)
def test_a_prepared_pickle_is_a_damaged_file(tmp_path, name):
    assert pickles.readable(pickles.ATTACKS[name])
    path = written(tmp_path, pickles.ATTACKS[name])
    with pytest.raises(DamagedError, match=r"low_dim_obs\.pkl"):
        load_demo(tmp_path, path, Budget(path))


def test_a_number_that_is_written_as_the_attacks_write_theirs_is_read(tmp_path):
    """So that the attacks above fail for what they ask, not for their form."""
    vector = np.array([1.5, -2.0])
    good = pickles.observation(
        gripper_pose=pickles.array((2,), pickles.dtype("f8", pickles.PLAIN), pickles.octets(vector.tobytes())),
        gripper_open=pickles.call(
            pickles.SCALAR, pickles.dtype("f8", pickles.PLAIN), pickles.octets(vector[:1].tobytes())
        ),
    )
    (seen,) = load_demo(tmp_path, written(tmp_path, good), Budget(tmp_path))
    np.testing.assert_array_equal(seen.get("gripper_pose"), vector)
    assert seen.get("gripper_open") == 1.5


def test_numbers_cannot_be_changed_after_they_were_made(tmp_path):
    """An array's or a type's own `__setstate__` is out of reach: a second state is checked like the first."""
    array = pickles.array((1,), pickles.dtype("f8", pickles.PLAIN), pickles.POINTER)
    state = pickles.tuple_of(
        pickles.number(1), pickles.tuple_of(pickles.number(9)), pickles.dtype("f8"), b"\x89", pickles.POINTER
    )
    path = written(tmp_path, pickles.observation(gripper_pose=array + state + b"b"))
    with pytest.raises(DamagedError, match="other bytes than that takes"):
        load_demo(tmp_path, path, Budget(path))
