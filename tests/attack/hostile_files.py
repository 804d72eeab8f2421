"""Archives, arrays and images that claim to be what they are not."""

import io
import json
import struct
import zipfile
import zlib

import cv2
import numpy as np

from tests.attack.hostile import Attack, form, part
from tests.attack.payloads import QUESTION, png_chunk
from tests.episodes import arrays, camera, metadata, npz, pick_trajectory

PLACE_M = (0.1, 0.1, 0.78)
WIDTH, HEIGHT = 64, 48
PIXELS, SHAPE = WIDTH * HEIGHT, f"({HEIGHT}, {WIDTH})"
RECORDED = arrays(pick_trajectory(PLACE_M))
GREY = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
PNG = cv2.imencode(".png", GREY)[1].tobytes()
JPEG = cv2.imencode(".jpg", np.random.default_rng(0).integers(0, 255, GREY.shape, np.uint8))[1].tobytes()
END = b"\0\0\0\0IEND\xaeB`\x82"
SIGNATURE = PNG[:8]
# A segment of EXIF with the orientation 6.
_ORIENTATION = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
ON_ITS_SIDE = b"\xff\xe1" + struct.pack(">H", len(_ORIENTATION) + 2) + _ORIENTATION


def recording(data):
    """An upload of this trajectory."""
    document = part(b"metadata", json.dumps(metadata("hostile", {"cube": PLACE_M})).encode(), b"m.json")
    body, headers = form(document, part(b"trajectory", data, b"t.npz"))
    return Attack("POST", "/episodes", 422, "trajectory", body, headers)


def picture(data, kind="rgb", field=None):
    """An upload of a good trajectory and this image."""
    document = {**metadata("hostile", {"cube": PLACE_M}), "cameras": [camera("c", WIDTH, HEIGHT)]}
    parts = [part(b"metadata", json.dumps(document).encode(), b"m.json")]
    parts += [part(b"trajectory", npz(**RECORDED), b"t.npz"), part(f"{kind}_c".encode(), data, b"i")]
    body, headers = form(*parts)
    return Attack("POST", "/episodes", 422, field or f"{kind}_c", body, headers)


def shown(data):
    """A dry run with this image."""
    document = {**QUESTION, "dry_run": True, "cameras": [camera("c", WIDTH, HEIGHT)]}
    body, headers = form(part(b"metadata", json.dumps(document).encode(), b"m.json"), part(b"rgb_c", data, b"i"))
    return Attack("POST", "/predict", 200, None, body, headers)


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


def header_of(width, height, depth=8, colors=2, interlaced=0):
    """A PNG's first chunk."""
    return png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colors, 0, 0, interlaced))


def png_of(header, data=b"\0" * 1000, *chunks):
    """A PNG of this header and these pixels."""
    return SIGNATURE + header + b"".join(chunks) + png_chunk(b"IDAT", zlib.compress(data)) + END


GOOD = npz(**RECORDED)
FRAMES = len(RECORDED["gripper_open"])
ONES = np.ones(FRAMES).tobytes()
# Of trajectories: tests/client/test_hostile_archives.py has all of them refused, an attack a few.
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
LARGE_CLAIMS = ("a member of 100 GB", "a header of nested brackets", "lengths whose product is beyond 64 bits")
IMAGES = {
    "PNG with a wrong checksum of its header": picture(PNG[:29] + b"\0\0\0\0" + PNG[33:]),
    "PNG of 2^31 columns and rows": picture(png_of(header_of(2**31, 2**31)), field="images"),
    "PNG of no columns": picture(png_of(header_of(0, HEIGHT))),
    "PNG whose header comes last": picture(SIGNATURE + PNG[33:-12] + PNG[8:33] + END, field="images"),
    "PNG without pixels": picture(SIGNATURE + header_of(WIDTH, HEIGHT) + END),
    "PNG whose chunk claims 4 GB": picture(PNG[:33] + b"\xff\xff\xff\xffIDAT" + END),
    "PNG of another size than the other image": picture(png_of(header_of(1, 1), b"\0" * 4), "depth"),
    "PNG in colors as a mask": picture(PNG, "mask"),
    "PNG with an archive behind it": picture(PNG + GOOD),
    "TIFF": picture(b"II*\0\x08\0\0\0" + b"\0" * 64),
    "WebP": picture(cv2.imencode(".webp", GREY)[1].tobytes()),
    "SVG with an entity": picture(b'<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]><svg>&x;</svg>'),
    "JPEG of codes that are none": picture(patched(JPEG, b"\xff\xc4", 5, b"\xff" * 16)),
    "JPEG of 65,535 columns and rows": picture(patched(JPEG, b"\xff\xc0", 5, b"\xff\xff\xff\xff"), field="images"),
    "JPEG of twelve bits": picture(patched(JPEG, b"\xff\xc0", 4, b"\x0c")),
    "array of negative depth": picture(described("'<f4'", SHAPE, data=b"\0\0\x80\xbf" * PIXELS), "depth"),
    "array of ids beyond 32 bits": picture(described("'<i8'", SHAPE, data=b"\xff\xff\xff\x7f" * 2 * PIXELS), "mask"),
    "array of 2^31 rows of nothing": picture(described("'|u1'", f"({2**31}, 0, 3)")),
}
# Uncommon, and images all the same.
ODD_IMAGES = {
    "PNG interlaced": png_of(header_of(WIDTH, HEIGHT, interlaced=1), b"\0" * 20_000),
    "PNG of 16 bits a channel": png_of(header_of(WIDTH, HEIGHT, 16, 6), b"\0" * HEIGHT * (1 + WIDTH * 8)),
    "PNG of one bit": png_of(header_of(WIDTH, HEIGHT, 1, 0), b"\0" * HEIGHT * (1 + WIDTH // 8)),
    "PNG that moves": PNG[:33] + png_chunk(b"acTL", struct.pack(">II", 2**31 - 1, 0)) + PNG[33:],
    "PNG whose profile is none": PNG[:33] + png_chunk(b"iCCP", b"x" * 200) + PNG[33:],
    "JPEG that lies on its side": JPEG[:2] + ON_ITS_SIDE + JPEG[2:],
    "array with its columns first": described("'|u1'", f"({HEIGHT}, {WIDTH}, 3)", "True", b"\0" * 3 * PIXELS),
}
