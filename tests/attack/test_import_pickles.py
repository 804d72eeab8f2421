"""A prepared pickle used to end the importer with a pointer of its author's choice (SIGSEGV)."""

import numpy as np
import pytest

from app.datasets.apart import open_apart
from app.datasets.bounds import Budget, DamagedError, ReadLimits
from app.datasets.options import ImportOptions, KnownObjects
from app.datasets.parcel import ObjectEntry
from app.datasets.rlbench_pickle import load_demo
from tests.attack import hostile_pickles as pickles
from tests.datasets import peract_folder as peract
from tests.episodes import pick_trajectory

OPTIONS = ImportOptions(
    instruction="x", objects=KnownObjects((ObjectEntry("drawer", (0.0, 0.0, 0.0)),)), limits=ReadLimits(50_000_000, 60)
)


def written(tmp_path, data):
    path = tmp_path / "low_dim_obs.pkl"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", pickles.ATTACKS)
def test_a_prepared_pickle_is_a_damaged_file(tmp_path, name):
    assert pickles.readable(pickles.ATTACKS[name])
    path = written(tmp_path, pickles.ATTACKS[name])
    with pytest.raises(DamagedError, match=r"low_dim_obs\.pkl"):
        load_demo(tmp_path, path, Budget(path, OPTIONS.limits))


def test_a_number_that_is_written_as_the_attacks_write_theirs_is_read(tmp_path):
    """So that the attacks above fail for what they ask, not for their form."""
    vector = np.array([1.5, -2.0])
    good = pickles.observation(
        gripper_pose=pickles.array((2,), pickles.dtype("f8", pickles.PLAIN), pickles.octets(vector.tobytes())),
        gripper_open=pickles.call(
            pickles.SCALAR, pickles.dtype("f8", pickles.PLAIN), pickles.octets(vector[:1].tobytes())
        ),
    )
    (seen,) = load_demo(tmp_path, written(tmp_path, good), Budget(tmp_path, OPTIONS.limits))
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
        load_demo(tmp_path, path, Budget(path, OPTIONS.limits))


def test_one_hostile_episode_does_not_hold_up_the_others(tmp_path):
    for number in range(2):
        peract.write_episode(tmp_path / f"episodes/episode{number}", pick_trajectory(peract.DRAWER_M))
    (tmp_path / "episodes/episode0/low_dim_obs.pkl").write_bytes(
        pickles.ATTACKS["memo of a gigabyte"]
    )  # 50 MB unpacked: 600 MB of memory
    with open_apart(tmp_path, OPTIONS) as dataset:
        first, second = dataset.entries
        with pytest.raises(DamagedError, match="needs more memory"):
            first.read()
        assert second.read().metadata["extra"]["variation"] == 1
