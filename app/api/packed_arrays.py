"""Arrays inside MessagePack, in openpi's convention (`msgpack_numpy.py`) -> `.npy` files.

An array is the map ``{"__ndarray__": true, "data": bytes, "dtype": "|u1", "shape": [480, 640, 3]}``; openpi packs the
keys as bytes, other programs as text, and both are read.
"""

import io
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from roboprompt_client.errors import InvalidInputError

MARK = "__ndarray__"
MAX_DIMENSIONS = 3
DTYPES = ("|b1", "|u1", "<u2", "<u4", "<i4", "<i8", "<f2", "<f4", "<f8")
_VALID = f"a map of {MARK}, data, dtype ({', '.join(DTYPES)}) and shape (at most {MAX_DIMENSIONS} lengths)"


def is_packed_array(value: object) -> bool:
    """Whether `value` claims to be an array."""
    return isinstance(value, Mapping) and (MARK in value or MARK.encode() in value)


def npy_from_packed(field: str, value: Mapping[Any, Any]) -> bytes:
    """The array as a `.npy` file: its header, then the bytes as they came.

    Args:
        field: what an error names.

    Raises:
        InvalidInputError: if type or shape are not allowed, or do not fit the number of bytes.
    """
    named = {_text(key): item for key, item in value.items()}
    data, dtype, shape = named.get("data"), _text(named.get("dtype")), _shape(named.get("shape"))
    if not isinstance(data, bytes) or dtype not in DTYPES or shape is None:
        given = f"dtype {dtype!r:.40}, shape {named.get('shape')!r:.80}"
        raise InvalidInputError(field, f"is not an array ({given})", _VALID)
    claimed = math.prod(shape) * np.dtype(dtype).itemsize
    if claimed != len(data):
        raise InvalidInputError(field, f"claims {claimed} bytes of numbers, has {len(data)}", _VALID)
    stream = io.BytesIO()
    header = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue() + data


def _text(value: object) -> object:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _shape(value: object) -> tuple[int, ...] | None:
    """The lengths, if that is what `value` is."""
    if not isinstance(value, list) or len(value) > MAX_DIMENSIONS:
        return None
    return tuple(value) if all(type(length) is int and length >= 0 for length in value) else None
