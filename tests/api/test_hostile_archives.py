"""Trajectories that claim to be what they are not are refused as such, before they cost anything."""

import io
import struct
import zipfile

import numpy as np
import pytest

from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.errors import InvalidInputError
from tests.episodes import arrays, npz, pick_trajectory

RECORDED = arrays(pick_trajectory((0.1, 0.1, 0.78)))


def npy(header, data=b"", version=(1, 0)):
    """A `.npy` file with this text as its header."""
    length = struct.pack("<H" if version == (1, 0) else "<I", len(header) % (65_536 if version == (1, 0) else 2**32))
    return b"\x93NUMPY" + bytes(version) + length + header + data


def described(descr="'<f8'", shape="(22,)", by_columns="False", data=b""):
    """A `.npy` file whose header says so; its values are Python text."""
    header = f"{{'descr': {descr}, 'fortran_order': {by_columns}, 'shape': {shape}, }}\n"
    return npy(header.encode(), data)


def with_member(member, name="gripper_open.npy", drop="gripper_open"):
    """The archive of a good trajectory with a member of one's own in the place of one array."""
    stream = io.BytesIO(npz(**{key: array for key, array in RECORDED.items() if key != drop}))
    with zipfile.ZipFile(stream, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, member)
    return stream.getvalue()


def gripper(member):
    """A trajectory in which this is the gripper's array."""
    return with_member(member)


def patched(data, signature, offset, value):
    """The archive with bytes changed in each record that begins with the signature."""
    changed, start = bytearray(data), data.find(signature)
    while start >= 0:
        changed[start + offset : start + offset + len(value)] = value
        start = data.find(signature, start + 4)
    return bytes(changed)


def flagged(bit):
    """The archive of a good trajectory with a flag set in each of its entries."""
    local = patched(npz(**RECORDED), b"PK\3\4", 6, struct.pack("<H", bit))
    return patched(local, b"PK\1\2", 8, struct.pack("<H", bit))


def twice():
    """An archive with two members of one name."""
    stream = io.BytesIO(npz(**RECORDED))
    with zipfile.ZipFile(stream, "a") as archive:
        archive.filelist[0].filename = "gripper_open.npy"
        archive.filelist[0].orig_filename = "gripper_open.npy"
        archive._didModify = True
    return stream.getvalue()


def zip64(size):
    """An archive whose directory says in 64 bits how large its first member is."""
    whole = npz(**RECORDED)
    start = whole.index(b"PK\1\2")
    name, extra = struct.unpack_from("<HH", whole, start + 28)
    record = bytearray(whole[start : start + 46 + name])
    record[20:28] = b"\xff" * 8
    record[30:32] = struct.pack("<H", 20)
    field = struct.pack("<HHQQ", 1, 16, size, size)
    rest = whole[start + 46 + name + extra :]
    end = rest.rindex(b"PK\5\6")
    directory = bytes(record) + field + rest[:end]
    tail = bytearray(rest[end:])
    tail[12:20] = struct.pack("<II", len(directory), start)
    return whole[:start] + directory + bytes(tail)


GOOD = npz(**RECORDED)
FRAMES = len(RECORDED["gripper_open"])
ONES = np.ones(FRAMES).tobytes()
ARCHIVES = {
    "encrypted": flagged(1),
    "of patches": flagged(0x20),
    "two members of one name": twice(),
    "a member of 100 GB": zip64(10**11),
    "an unknown compression": patched(patched(GOOD, b"PK\3\4", 8, b"\x63\0"), b"PK\1\2", 10, b"\x63\0"),
    "a wrong checksum": patched(GOOD, b"PK\1\2", 16, b"\1\2\3\4"),
    "half of it": GOOD[: len(GOOD) // 2],
    "an absolute name": with_member(b"x", "/etc/passwd"),
    "a name of 60 kB": with_member(b"x", "n" * 60_000),
    "a header of a megabyte": gripper(npy(b"{" + b" " * 1_000_000 + b"}\n", version=(2, 0))),
    "a header that claims 4 GB": gripper(b"\x93NUMPY\2\0\xff\xff\xff\xff{}"),
    "a header of nested brackets": gripper(npy(b"(" * 9_000 + b")" * 9_000)),
    "a header that calls": gripper(described(shape="__import__('os').getcwd()")),
    "a negative length": gripper(described(shape="(-22,)", data=ONES)),
    "a length beyond 64 bits": gripper(described(shape=f"({2**64},)", data=ONES)),
    "lengths whose product is beyond 64 bits": gripper(described(shape=f"({2**32}, {2**32})", data=ONES)),
    "a length of zero beside one beyond 64 bits": gripper(described(shape=f"(0, {2**70})")),
    "objects": gripper(described(descr="'|O'", data=ONES)),
    "a structure": gripper(described(descr="[('a', '<f8')]", data=ONES)),
    "a type of no bytes": gripper(described(descr="'|V0'")),
    "text": gripper(described(descr="'<U2'", data=ONES)),
    "numbers that are not finite": gripper(described(shape=f"({FRAMES},)", data=b"\xff" * 8 * FRAMES)),
    "columns first, of a wrong shape": gripper(described(shape=f"({FRAMES}, 1)", by_columns="True", data=ONES)),
}


def test_the_archive_that_they_were_made_from_is_read():
    assert len(trajectory_from_npz(GOOD)) > 1


@pytest.mark.parametrize("name", ARCHIVES)
def test_a_hostile_archive_is_refused(name):
    with pytest.raises(InvalidInputError) as caught:
        trajectory_from_npz(ARCHIVES[name])
    assert caught.value.field.startswith("trajectory")
