"""Arrays in `.npy` and `.npz` files from untrusted senders; a pickle is never loaded."""

import io
import lzma
import math
import re
import struct
import zipfile
import zlib

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import FIELDS, VALID, Trajectory, trajectory_from_arrays

MAX_UNPACKED_BYTES = 100_000_000  # 600,000 frames; a .npz of 0.3 MB can claim 300 MB
ARRAY = "a plain array of numbers"
# What zipfile raises for damaged archives; RuntimeError: encrypted, ValueError: offsets before the file's beginning.
_OF_ZIPFILE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error)
_UNREADABLE = (*_OF_ZIPFILE, EOFError, OSError, RuntimeError, ValueError, OverflowError)
# Version 3.0 differs from 2.0 in the encoding of field names only.
_READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
    (3, 0): np.lib.format.read_array_header_2_0,
}


def trajectory_from_npz(data: bytes, max_unpacked_bytes: int = MAX_UNPACKED_BYTES) -> Trajectory:
    """Return the trajectory of a .npz file.

    Raises:
        InvalidInputError: naming the array and what is wrong with it.
    """
    if not data:
        raise InvalidInputError("trajectory", "is empty", VALID)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = _unpack(archive, max_unpacked_bytes)
    except InvalidInputError:
        raise
    except _UNREADABLE as error:
        raise InvalidInputError("trajectory", f"is not a readable .npz file: {error}", VALID) from None
    arrays = {name: array_from_npy(f"trajectory.{name}", data, ARRAY) for name, data in members.items()}
    return trajectory_from_arrays(arrays)


def _unpack(archive: zipfile.ZipFile, max_unpacked_bytes: int) -> dict[str, bytes]:
    members = archive.infolist()
    # an archive may list one array many times, and each entry is unpacked
    if len(members) > len(FIELDS):
        raise InvalidInputError("trajectory", f"has {len(members)} arrays", VALID)
    unpacked = sum(member.file_size for member in members)
    if unpacked > max_unpacked_bytes:
        raise InvalidInputError("trajectory", f"unpacks to {unpacked} bytes", f"at most {max_unpacked_bytes}")
    return {member.filename.removesuffix(".npy"): archive.read(member) for member in members}


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
