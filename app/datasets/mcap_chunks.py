"""The messages of an MCAP file, unpacked chunk by chunk within a budget.

mcap's own reader unpacks a chunk to whatever size it has, and makes an object of each of its records at once.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from app.datasets.bounds import Budget, DamagedError, MissingPackageError

MAX_MESSAGE_BYTES = 1_000_000  # of joints, a pose or a number; images are never decoded
OBJECT_BYTES = 500  # what Python needs for a message beside its numbers
GROWTH = 4  # a number of 8 bytes takes 32 in a list


@dataclass(frozen=True)
class Message:
    """A message that is still encoded.

    Attributes:
        schema, channel: mcap's records; a channel without a schema is left out.
    """

    schema: Any
    channel: Any
    log_time_ns: int
    data: bytes


def read_messages(file: Path, wanted: Callable[[str], bool], budget: Budget) -> Iterator[Message]:
    """The messages whose schema's name is `wanted`, in the file's order.

    Raises:
        DamagedError: if the file unpacks to more than the budget allows.
        mcap's errors, OSError, EOFError, ValueError, struct.error: if it is damaged.
    """
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    for record in _records(file, budget):
        match type(record).__name__:
            case "Schema":
                schemas[record.id] = record
            case "Channel":
                channels[record.id] = record
            case "Message" if record.channel_id in channels:
                channel = channels[record.channel_id]
                schema = schemas.get(channel.schema_id)
                if schema is not None and wanted(schema.name):
                    _check(file, channel.topic, len(record.data), budget)
                    yield Message(schema, channel, record.log_time, record.data)


def _check(file: Path, topic: str, num_bytes: int, budget: Budget) -> None:
    if num_bytes > MAX_MESSAGE_BYTES:
        raise DamagedError(file, f"{topic} has a message of {num_bytes} bytes, expected at most {MAX_MESSAGE_BYTES}")
    budget.take(OBJECT_BYTES + GROWTH * num_bytes)


def _records(file: Path, budget: Budget) -> Iterator[Any]:
    """Schemas, channels and messages, those in chunks and those beside them."""
    try:
        from mcap.records import Chunk
        from mcap.stream_reader import StreamReader
    except ImportError as error:
        raise MissingPackageError("MCAP files", "mcap-ros2-support") from error
    size = file.stat().st_size
    with file.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True, record_size_limit=size).records:
            if isinstance(record, Chunk):
                yield from _within(unpacked(record, budget))
            else:
                yield record


def _within(data: bytes) -> Iterator[Any]:
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Message, Schema

    stream = ReadDataStream(BytesIO(data))
    while stream.count < len(data):
        opcode, length = stream.read1(), stream.read8()
        if length > len(data) - stream.count:
            raise EOFError(f"a record of {length} bytes goes beyond its chunk")
        match opcode:
            case Opcode.SCHEMA:
                yield Schema.read(stream)
            case Opcode.CHANNEL:
                yield Channel.read(stream)
            case Opcode.MESSAGE:
                yield Message.read(stream, length)
            case _:
                stream.read(length)


def unpacked(chunk: Any, budget: Budget) -> bytes:  # noqa: ANN401
    """A chunk's records, which must be as many bytes as it says.

    Raises:
        DamagedError: if the budget does not allow them.
        ValueError: if they are more or fewer.
    """
    import lz4.frame
    import zstandard

    size = chunk.uncompressed_size if chunk.compression else len(chunk.data)
    budget.take(size)
    match chunk.compression:
        case "":
            data = chunk.data
        case "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        case "zstd":
            data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
        case _:
            raise ValueError(f"compression {chunk.compression!r:.20} is not known")
    if len(data) != size:
        raise ValueError(f"a chunk unpacks to other than the {size} bytes that it says")
    return bytes(data)
