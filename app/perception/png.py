"""A PNG's chunks, looked at before anything is decoded."""

import struct
from collections.abc import Iterator

SIGNATURE = b"\x89PNG\r\n\x1a\n"
END = b"IEND\xaeB`\x82"
MAX_CHUNKS = 100_000  # writers put 8 kB and more of an image into each
# What pixels are made of, and the orientation. Others are left out: libpng unpacks texts and colour profiles, of which
# 2 MB can become 2 GB.
_OF_PIXELS = frozenset({b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"eXIf"})
_FRAME_BYTES = 12  # length and type before the data, checksum after it


def size(data: bytes) -> tuple[int, int]:
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
    if kept == [(len(SIGNATURE), len(data))]:
        return data
    return SIGNATURE + b"".join(data[start:end] for start, end in kept)


def _chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """The type of each chunk up to the last, and where it begins and ends, which may be after the data."""
    start = len(SIGNATURE)
    while start + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, start)
        end = start + length + _FRAME_BYTES
        yield kind, start, end
        if kind == b"IEND":
            return
        start = end
