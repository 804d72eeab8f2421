"""Messages between the importer and its readers: a length, then MessagePack."""

import struct
from typing import IO, Any

import msgpack

_LENGTH = struct.Struct(">Q")


def write_frame(stream: IO[bytes], message: object) -> None:
    """Send bytes as they are, anything else in MessagePack; raises OSError."""
    data = message if isinstance(message, bytes) else msgpack.packb(message)
    stream.write(_LENGTH.pack(len(data)))
    stream.write(data)
    stream.flush()


def read_bytes(stream: IO[bytes], max_bytes: int) -> bytes:
    """What `write_frame` has sent.

    Raises:
        EOFError: if the other side has ended.
        ValueError: if it is larger than `max_bytes`.
    """
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    if length > max_bytes:
        raise ValueError(f"a message of {length} bytes, expected at most {max_bytes}")
    data = stream.read(length)
    if len(data) < length:
        raise EOFError
    return data


def read_frame(stream: IO[bytes], max_bytes: int) -> dict[str, Any]:
    """A message in MessagePack.

    Raises:
        EOFError, ValueError: as `read_bytes`, or if it is no such message.
    """
    message = msgpack.unpackb(read_bytes(stream, max_bytes))
    if not isinstance(message, dict):
        raise ValueError("a message that is no mapping")
    return message
