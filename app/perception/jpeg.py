"""What a JPEG's markers say before anything is decoded: its size, and how often a decoder goes over all of it."""

import re
import struct

# libjpeg's own progressive script has 10 for colour and 18 for four components; others have fewer than 16.
# Each takes a third of the time of a whole baseline image, also where it is empty.
MAX_SCANS = 18
MAX_SEGMENTS = 1000  # a colour profile may fill 255
SIGNATURE = b"\xff\xd8\xff"
END = b"\xff\xd9"
_START_OF_SCAN = b"\xff\xda"
# As libjpeg finds the next one: fill bytes before it, and none of those that stand alone (TEM, RST0 to RST7).
_MARKER = re.compile(rb"\xff+([^\x00\x01\xd0-\xd7\xff])", re.DOTALL)
_MAX_GAP = 1024  # bytes between segments, of which there should be none
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # ITU-T T.81, table B.1: these give the size
_WITHOUT_LENGTH = frozenset({0xD8, 0xD9})


def size(data: bytes) -> tuple[int, int]:
    """Width and height; no pixels if the data ends before them."""
    if (position := _frame(data)) is None:
        return 0, 0
    height, width = struct.unpack_from(">HH", data, position + 3)
    return width, height


def num_scans(data: bytes) -> int:
    """At most how many scans a decoder finds: the marker's bytes after the size. Compressed data cannot hold them."""
    position = _frame(data)
    return 0 if position is None else data.count(_START_OF_SCAN, position)


def _frame(data: bytes) -> int | None:
    """Where the segment begins that gives the size."""
    position = 2
    for _ in range(MAX_SEGMENTS):
        match = _MARKER.search(data, position, position + _MAX_GAP)
        if match is None or match.end() + 7 > len(data):
            break
        marker, position = match[1][0], match.end()
        if marker in _FRAMES:
            return position
        if marker not in _WITHOUT_LENGTH:
            position += int.from_bytes(data[position : position + 2])
    return None
