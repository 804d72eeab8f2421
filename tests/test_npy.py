"""`.npy` files from untrusted senders."""

import io

import numpy as np
import pytest

from app.untrusted_arrays import array_from_npy
from roboprompt_client.errors import InvalidInputError
from tests.npy_files import HOSTILE, npy, npy_that_claims


@pytest.mark.parametrize(
    "array",
    [
        np.arange(24.0).reshape(4, 6),
        np.asfortranarray(np.arange(24).reshape(4, 6)),
        np.zeros((0, 7)),
        np.array(3, np.uint8),
        np.array([True, False]),
        np.ones(3, ">f4"),
    ],
)
def test_arrays_come_as_they_were_saved(array):
    seen = array_from_npy("depth", npy(array), "numbers")
    np.testing.assert_array_equal(seen, array)
    assert seen.dtype == array.dtype


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_every_version_of_the_format(version):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.ones((2, 3)), version=version)
    np.testing.assert_array_equal(array_from_npy("depth", stream.getvalue(), "numbers"), np.ones((2, 3)))


@pytest.mark.parametrize(("data", "message"), HOSTILE.items(), ids=range(len(HOSTILE)))
def test_hostile_files_are_refused_by_name(data, message):
    with pytest.raises(InvalidInputError) as caught:
        array_from_npy("trajectory.gripper_open", data, "numbers")
    assert caught.value.field == "trajectory.gripper_open"
    assert caught.value.valid == "numbers"
    assert message in caught.value.message
    assert " at 0x" not in caught.value.message
    assert len(caught.value.message) < 300


def test_an_honest_header_passes():
    # the twin of the hostile ones above: their helper writes what numpy reads
    assert array_from_npy("a", npy_that_claims("<f8", (4, 6), b"\0" * 192), "numbers").shape == (4, 6)
