"""Arrays inside MessagePack, as openpi packs them."""

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from app.api.body import DTYPES, npy_from_packed, packed_image
from app.untrusted_arrays import array_from_npy
from roboprompt_client.errors import InvalidInputError

IMAGE = {"__ndarray__": True, "data": bytes(6), "dtype": "|u1", "shape": [1, 2, 3]}


def pack_array(value):
    """As openpi's `msgpack_numpy.pack_array`."""
    if not isinstance(value, np.ndarray):
        return value
    return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}


@given(st.sampled_from(DTYPES).flatmap(lambda dtype: arrays(dtype, array_shapes(max_dims=3, max_side=4))))
def test_arrays_survive_packing(array):
    sent = msgpack.unpackb(msgpack.packb(array, default=pack_array))
    back = array_from_npy("depth_front", npy_from_packed("depth_front", sent), "")
    assert back.dtype == array.dtype
    np.testing.assert_array_equal(back, array)


def test_keys_of_openpi_are_read():
    openpi = {key.encode(): value for key, value in IMAGE.items()} | {b"dtype": b"|u1"}
    assert packed_image("rgb_front", openpi) == packed_image("rgb_front", IMAGE)


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
def test_invalid_arrays_are_refused(fault):
    with pytest.raises(InvalidInputError) as refused:
        npy_from_packed("rgb_front", {**IMAGE, **fault})
    assert refused.value.field == "rgb_front"
