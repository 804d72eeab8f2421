"""Arrays as bytes: `.npy` files, and maps inside MessagePack."""

import io

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from npy_files import HOSTILE, npy, npy_that_claims

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.npy import DTYPES, array_from_npy, is_packed_array, npy_from_packed, packed_array


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


IMAGE = {"__ndarray__": True, "data": bytes(6), "dtype": "|u1", "shape": [1, 2, 3]}


@given(st.sampled_from(DTYPES).flatmap(lambda dtype: arrays(dtype, array_shapes(max_dims=3, max_side=4))))
def test_there_and_back(array):
    sent = msgpack.unpackb(msgpack.packb(packed_array(array)))
    back = array_from_npy("depth_front", npy_from_packed("depth_front", sent), "")
    assert back.dtype == array.dtype
    np.testing.assert_array_equal(back, array)


def test_other_byte_orders_and_views_are_straightened():
    array = np.arange(12, dtype=">u2").reshape(3, 4)[:, ::2]
    back = array_from_npy("rgb_front", npy_from_packed("rgb_front", packed_array(array)), "")
    np.testing.assert_array_equal(back, array)


def test_keys_of_openpi_are_read():
    openpi = {key.encode(): value for key, value in IMAGE.items()} | {b"dtype": b"|u1"}
    assert is_packed_array(openpi)
    assert npy_from_packed("rgb_front", openpi) == npy_from_packed("rgb_front", IMAGE)


@pytest.mark.parametrize(
    "fault",
    [
        {"dtype": "|O"},
        {"dtype": "<U4"},
        {"dtype": [["a", "<f4"]]},
        {"dtype": None},
        {"shape": [1, 2, 4]},
        {"shape": [2**40, 2**40, 0]},
        {"shape": [-1, -2, 3]},
        {"shape": [1, 2, 3.0]},
        {"shape": [True, 2, 3]},
        {"shape": [1, 1, 2, 3]},
        {"shape": 6},
        {"data": "text"},
        {"data": None},
    ],
    ids=str,
)
def test_what_is_no_array_is_refused(fault):
    with pytest.raises(InvalidInputError) as refused:
        npy_from_packed("rgb_front", {**IMAGE, **fault})
    assert refused.value.field == "rgb_front"
