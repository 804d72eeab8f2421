"""Arrays as bytes, never a pickle: `.npy` files, and maps inside MessagePack in openpi's convention.

In MessagePack an array is the map ``{"__ndarray__": true, "data": bytes, "dtype": "|u1", "shape": [480, 640, 3]}``
(openpi's ``msgpack_numpy.py``, which packs the keys as bytes; both are read).
"""

import io
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError

MARK = "__ndarray__"
MAX_DIMENSIONS = 3
DTYPES = ("|b1", "|u1", "<u2", "<u4", "<i4", "<i8", "<f2", "<f4", "<f8")
_VALID = f"a map of {MARK}, data, dtype ({', '.join(DTYPES)}) and shape (at most {MAX_DIMENSIONS} lengths)"
# Version 3.0 differs from 2.0 in the encoding of field names only.
_READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
    (3, 0): np.lib.format.read_array_header_2_0,
}


def array_from_npy(field: str, data: bytes, valid: str) -> npt.NDArray[np.generic]:
    """The array in `data`, of any shape and type but objects; read-only, because it is a view of `data`.

    Args:
        field: what an error names.
        valid: what an error says would be accepted.

    Raises:
        InvalidInputError: if it is damaged, contains a pickle, or its header claims another size than it has.
    """
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        shape, by_columns, dtype = _READ_HEADER[version](stream)
        if dtype.hasobject:
            raise InvalidInputError(field, "contains a pickle, which is never loaded", valid)
        claimed, size = math.prod(shape) * dtype.itemsize, len(data) - stream.tell()
        if claimed != size:  # before numpy makes room for what is claimed
            raise InvalidInputError(field, f"claims {claimed} bytes of numbers, has {size}", valid)
        flat = np.frombuffer(data, dtype, offset=stream.tell())
        array: npt.NDArray[np.generic] = flat.reshape(shape, order="F" if by_columns else "C")
    except InvalidInputError:
        raise
    except Exception as error:  # on a hostile header numpy raises whatever Python's own parser does
        said = re.sub(r" at 0x[0-9a-f]+", "", str(error))[:200]  # without the addresses of Python's objects
        raise InvalidInputError(field, f"is a damaged .npy array: {said}", valid) from None
    return array


def packed_array(array: npt.NDArray[Any]) -> dict[str, Any]:
    """The map that stands for `array`."""
    little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    return {MARK: True, "data": little.tobytes(), "dtype": little.dtype.str, "shape": list(little.shape)}


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
