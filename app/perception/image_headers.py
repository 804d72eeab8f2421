"""The size of a PNG or JPEG and the cost of decoding it, read from PNG chunks and JPEG markers without decoding.

A decoder may go over all of a JPEG as often as it has scans.
"""

import re
import struct
from collections.abc import Iterator

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
PNG_END = b"IEND\xaeB`\x82"
MAX_CHUNKS = 100_000  # writers put 8 kB and more of an image into each
# What pixels are made of, and the orientation. Others are left out: libpng unpacks texts and color profiles, of which
# 2 MB can become 2 GB.
_OF_PIXELS = frozenset({b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"eXIf"})
_FRAME_BYTES = 12  # length and type before the data, checksum after it
# libjpeg's own progressive script has 10 for color and 18 for four components; others have fewer than 16.
# Each takes a third of the time of a whole baseline image, also where it is empty.
MAX_SCANS = 18
MAX_SEGMENTS = 1000  # a color profile may fill 255
JPEG_SIGNATURE = b"\xff\xd8\xff"
JPEG_END = b"\xff\xd9"
_START_OF_SCAN = b"\xff\xda"
# As libjpeg finds the next one: fill bytes before it, and none of those that stand alone (TEM, RST0 to RST7).
_MARKER = re.compile(rb"\xff+([^\x00\x01\xd0-\xd7\xff])", re.DOTALL)
_MAX_GAP = 1024  # bytes between segments, of which there should be none
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # ITU-T T.81, table B.1: these give the size
_WITHOUT_LENGTH = frozenset({0xD8, 0xD9})


def png_size(data: bytes) -> tuple[int, int]:
    """Width and height; no pixels if the data ends before them."""
    return struct.unpack_from(">II", data, 16) if len(data) >= 24 else (0, 0)


def pixels_only(data: bytes) -> bytes | None:
    """The file without the chunks that its pixels do not need; None if it has too many to be a picture.

    Also None if a chunk claims more bytes than there are: the decoder would make room for all of them, up to 4 GB.
    """
    kept: list[tuple[int, int]] = []
    for number, (kind, start, end) in enumerate(_chunks(data)):
        if number == MAX_CHUNKS or end > len(data):
            return None
        if kind in _OF_PIXELS:
            if kept and kept[-1][1] == start:
                start = kept.pop()[0]
            kept.append((start, end))
    if kept == [(len(PNG_SIGNATURE), len(data))]:
        return data
    return PNG_SIGNATURE + b"".join(data[start:end] for start, end in kept)


def _chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """The type of each chunk up to the last, and where it begins and ends, which may be after the data."""
    start = len(PNG_SIGNATURE)
    while start + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, start)
        end = start + length + _FRAME_BYTES
        yield kind, start, end
        if kind == b"IEND":
            return
        start = end


def jpeg_size(data: bytes) -> tuple[int, int]:
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
