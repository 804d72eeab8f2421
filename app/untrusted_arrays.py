"""Arrays in `.npy` and `.npz` files from untrusted senders; a pickle is never loaded."""

import io
import lzma
import math
import re
import struct
import zipfile
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import FIELDS, VALID, Trajectory, trajectory_from_arrays

MAX_UNPACKED_BYTES = 100_000_000  # 600,000 frames; a .npz of 0.3 MB can claim 300 MB
MAX_DIRECTORY_BYTES = 131_072  # of the archive's directory, whose comment alone may have 64 kB
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
    return trajectory_from_arrays(_arrays("trajectory", data, len(FIELDS), max_unpacked_bytes, VALID))


def _arrays(
    field: str, data: bytes, max_arrays: int, max_unpacked_bytes: int, valid: str
) -> dict[str, npt.NDArray[Any]]:
    if not data:
        raise InvalidInputError(field, "is empty", valid)
    try:
        file = _ShortDirectory(data)
        with zipfile.ZipFile(file) as archive:
            file.opened = True
            members = _unpack(field, archive, max_arrays, max_unpacked_bytes, valid)
    except InvalidInputError:
        raise
    except _UNREADABLE as error:
        raise InvalidInputError(field, f"is not a readable .npz file: {error}", valid) from None
    return {name: array_from_npy(f"{field}.{name}", it, "a plain array of numbers") for name, it in members.items()}


class _ShortDirectory(io.BytesIO):
    """A file that cannot be opened as an archive with a long directory: `zipfile` would read every entry at once."""

    opened = False

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes; raises BadZipFile for many at once while the archive is being opened."""
        if not self.opened and size is not None and size > MAX_DIRECTORY_BYTES:
            raise zipfile.BadZipFile(f"its directory has {size} bytes, at most {MAX_DIRECTORY_BYTES} are read")
        return super().read(size)


def _unpack(
    field: str, archive: zipfile.ZipFile, max_arrays: int, max_unpacked_bytes: int, valid: str
) -> dict[str, bytes]:
    members = archive.infolist()
    # an archive may list one array many times, and each entry is unpacked
    if len(members) > max_arrays:
        raise InvalidInputError(field, f"has {len(members)} arrays", valid)
    unpacked = sum(member.file_size for member in members)
    if unpacked > max_unpacked_bytes:
        raise InvalidInputError(field, f"unpacks to {unpacked} bytes", f"at most {max_unpacked_bytes}")
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
