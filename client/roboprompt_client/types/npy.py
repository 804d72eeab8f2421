"""Arrays in `.npy` files from untrusted senders; a pickle is never loaded."""

import io
import math
import re

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError

# Version 3.0 differs from 2.0 in the encoding of field names only.
_READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
    (3, 0): np.lib.format.read_array_header_2_0,
}


def array_from_npy(field: str, data: bytes, valid: str) -> npt.NDArray[np.generic]:
    """Return the array in `data`, of any shape and type but objects; read-only, because it is a view of `data`.

    Args:
        field: the field that an error names.
        valid: what an error says would be accepted.

    Raises:
        InvalidInputError: if the file is damaged, contains a pickle, or has another size than its header says.
    """
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        shape, by_columns, dtype = _READ_HEADER[version](stream)
        if dtype.hasobject:
            raise InvalidInputError(field, "contains a pickle, which is never loaded", valid)
        claimed, size = math.prod(shape) * dtype.itemsize, len(data) - stream.tell()
        if claimed != size:  # before numpy allocates what is claimed
            raise InvalidInputError(field, f"claims {claimed} bytes of numbers, has {size}", valid)
        flat = np.frombuffer(data, dtype, offset=stream.tell())
        array: npt.NDArray[np.generic] = flat.reshape(shape, order="F" if by_columns else "C")
    except InvalidInputError:
        raise
    except Exception as error:  # for a hostile header numpy raises any error of Python's parser
        said = re.sub(r" at 0x[0-9a-f]+", "", str(error))[:200]  # without memory addresses
        raise InvalidInputError(field, f"is a damaged .npy array: {said}", valid) from None
    return array
