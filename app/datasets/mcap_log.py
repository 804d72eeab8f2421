"""ROS 2 recordings in MCAP: a file is an episode, a folder of files a dataset.

Topics become columns: a JointState gives `TOPIC.velocity` and `TOPIC.position`, a pose `TOPIC.position` and
`TOPIC.quaternion`, a number or Boolean `TOPIC`. Frames have the times of the joint states and the latest message of
every other topic. Without a mapping, topics are recognized by their types if that is unambiguous.

Chunks are unpacked here, within the budget: mcap's own reader unpacks a chunk of any size at once.
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import numpy as np

from app.datasets.bounds import Budget, DamagedError, MissingPackageError, inside
from app.datasets.columns import ColumnEpisode
from app.datasets.options import FeatureMap, ImportOptions, as_name
from app.datasets.parcel import Dataset, Entry, Parcel
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.arrays import Array

SUFFIX = ".mcap"
JOINTS = "sensor_msgs/msg/JointState"
NANOSECONDS = 1e-9
MAX_MESSAGE_BYTES = 1_000_000  # of joints, a pose or a number; images are never decoded
OBJECT_BYTES = 500  # Python's overhead of a message
GROWTH = 4  # a number of 8 bytes takes 32 bytes in a list
ARM_JOINTS = 7  # further joints of a JointState are usually fingers; other arms need a mapping


@dataclass
class Track:
    """One topic's messages as numbers."""

    times_s: list[float] = field(default_factory=list)
    values: dict[str, list[list[float]]] = field(default_factory=dict)

    def add(self, time_s: float, numbers: dict[str, list[float]]) -> None:
        self.times_s.append(time_s)
        for name, value in numbers.items():
            self.values.setdefault(name, []).append(value)

    def in_order(self) -> "Track":
        """Return the messages sorted by time; recorders write late messages out of order."""
        order = np.argsort(self.times_s, kind="stable").tolist()
        complete = {name: rows for name, rows in self.values.items() if len(rows) == len(order)}
        values = {name: [rows[k] for k in order] for name, rows in complete.items()}
        return Track([self.times_s[k] for k in order], values)


def looks_like(path: Path) -> bool:
    """Return whether it is an MCAP file, or a folder with some."""
    return path.suffix == SUFFIX if path.is_file() else any(path.glob(f"*{SUFFIX}"))


def open_mcap(path: Path, options: ImportOptions) -> Dataset:
    """Return one episode for each file, by name; raises DamagedError if a file is a link out of the folder."""
    files = [path] if path.is_file() else sorted(inside(path.resolve(), file.name) for file in path.glob(f"*{SUFFIX}"))
    return Dataset("MCAP", tuple(Entry(file.stem, partial(_read, file, path, options)) for file in files))


def _read(file: Path, root: Path, options: ImportOptions) -> Parcel:
    tracks, joints = _tracks(file, Budget(file, options.limits))
    if len(joints) != 1:
        listed = ", ".join(joints) or "none"
        raise InvalidInputError(
            file.name, f"has {len(joints)} topics of joint states: {listed}", "exactly one: the clock"
        )
    clock_s = np.array(tracks[joints[0]].times_s)
    columns, start_s = _on_clock(tracks, clock_s)
    times_s = clock_s[clock_s >= start_s]
    steps_s = np.diff(times_s)
    if len(steps_s) == 0 or steps_s.min() <= 0:
        raise DamagedError(file, f"has {len(times_s)} frames in which every topic is known, or their times do not grow")
    columns["time"] = times_s - times_s[0]

    def image(topic: str) -> bytes:
        raise DamagedError(file, f"images of topic {topic} cannot be read from MCAP files")

    return ColumnEpisode(
        name=file.stem,
        source="MCAP",
        task=as_name(root.resolve().stem),
        instruction=None,
        columns=columns,
        frequency_hz=float(1 / np.median(steps_s)),
        image=image,
    ).parcel(_mapping(columns, joints[0], options), options)


def _tracks(file: Path, budget: Budget) -> tuple[dict[str, Track], list[str]]:
    """Return the numeric topics, and the names of those with joint states."""
    tracks: dict[str, Track] = {}
    joints: list[str] = []
    for kind, topic, time_s, message in _messages(file, budget):
        if topic not in tracks and kind == JOINTS:
            joints.append(topic)
        tracks.setdefault(topic, Track()).add(time_s, _NUMBERS[kind](message))
    return {topic: track.in_order() for topic, track in tracks.items()}, joints


def _messages(file: Path, budget: Budget) -> Iterator[tuple[str, str, float, Any]]:
    """Yield type, topic, time (s) and content of numeric messages; images are not decoded."""
    try:
        from mcap.exceptions import McapError
        from mcap_ros2.decoder import DecoderFactory
    except ImportError as error:
        raise MissingPackageError("MCAP files", "mcap-ros2-support") from error
    decoders, schemas, channels = DecoderFactory(), {}, {}
    try:
        with file.open("rb") as stream:
            for record in _records(stream, file.stat().st_size, budget):
                match type(record).__name__:
                    case "Schema":
                        schemas[record.id] = record
                    case "Channel":
                        channels[record.id] = record
                    case "Message" if record.channel_id in channels:
                        channel = channels[record.channel_id]
                        schema = schemas.get(channel.schema_id)
                        if schema is None or schema.name not in _NUMBERS:
                            continue
                        _check_size(file, channel.topic, len(record.data), budget)
                        if (decode := decoders.decoder_for(channel.message_encoding, schema)) is None:
                            encoding = channel.message_encoding
                            raise DamagedError(file, f"{channel.topic} is in {encoding}, not in ROS 2's encoding")
                        yield schema.name, channel.topic, record.log_time * NANOSECONDS, decode(record.data)
    except (OSError, McapError, ValueError, EOFError, struct.error, IndexError, RuntimeError) as error:
        raise DamagedError(file, f"cannot be read: {str(error) or type(error).__name__}") from error


def _check_size(file: Path, topic: str, num_bytes: int, budget: Budget) -> None:
    if num_bytes > MAX_MESSAGE_BYTES:
        raise DamagedError(file, f"{topic} has a message of {num_bytes} bytes, expected at most {MAX_MESSAGE_BYTES}")
    budget.take(OBJECT_BYTES + GROWTH * num_bytes)


def _records(stream: IO[bytes], size: int, budget: Budget) -> Iterator[Any]:
    """Yield a file's records, also those in chunks; raises mcap's errors for a damaged file."""
    from mcap.exceptions import EndOfFile
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader

    for record in StreamReader(stream, emit_chunks=True, record_size_limit=size).records:
        if not isinstance(record, Chunk):
            yield record
            continue
        data = _unpacked(record, budget)
        within = StreamReader(BytesIO(data), skip_magic=True, emit_chunks=True, record_size_limit=len(data))
        with suppress(EndOfFile):  # a chunk has no footer to end at
            yield from within.records


def _unpacked(chunk: Any, budget: Budget) -> bytes:  # noqa: ANN401
    """Return a chunk's unpacked bytes; ValueError if their number is not as stated, DamagedError beyond the budget."""
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
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("a chunk does not match its checksum")
    return bytes(data)


def _on_clock(tracks: dict[str, Track], clock_s: Array) -> tuple[dict[str, Array], float]:
    """Return columns with a row for each clock time at which every topic has a message, and the first such time."""
    start_s = max(track.times_s[0] for track in tracks.values())
    clock_s = clock_s[clock_s >= start_s]
    columns = {}
    for topic, track in tracks.items():
        latest = np.searchsorted(np.array(track.times_s), clock_s, side="right") - 1
        for name, rows in track.values.items():
            if len({len(row) for row in rows}) == 1:
                values = np.array(rows)[latest]
                columns[f"{topic}.{name}" if name else topic] = values
    return columns, start_s


def _mapping(columns: dict[str, Array], joints: str, options: ImportOptions) -> FeatureMap:
    found = {"timestamps": "time"}
    arm = f"[0:{ARM_JOINTS}]"
    for part, name in (("joint_velocities", "velocity"), ("joint_positions", "position")):
        if f"{joints}.{name}" in columns:
            found[part] = f"{joints}.{name}{arm}"
    poses = [name.removesuffix(".quaternion") for name in columns if name.endswith(".quaternion")]
    if len(poses) == 1:
        found.update(end_effector_positions=f"{poses[0]}.position", end_effector_rotations=f"{poses[0]}.quaternion")
    single = [name for name, values in columns.items() if name != "time" and values.shape[1:] == (1,)]
    if len(single) == 1:
        found["gripper"] = single[0]
    return FeatureMap(gripper_open_above=0.5).changed(found).changed(options.features)


def _joint_numbers(message: Any) -> dict[str, list[float]]:  # noqa: ANN401
    """Return velocities and positions in the order of the joints' names, fingers last."""
    order = sorted(range(len(message.name)), key=lambda k: ("finger" in message.name[k], message.name[k]))
    named = {"velocity": message.velocity, "position": message.position}
    return {name: [float(values[k]) for k in order] for name, values in named.items() if len(values) == len(order)}


def _pose_numbers(pose: Any) -> dict[str, list[float]]:  # noqa: ANN401
    p, q = pose.position, pose.orientation
    return {"position": [p.x, p.y, p.z], "quaternion": [q.x, q.y, q.z, q.w]}


_NUMBERS: dict[str, Callable[[Any], dict[str, list[float]]]] = {
    JOINTS: _joint_numbers,
    "geometry_msgs/msg/Pose": _pose_numbers,
    "geometry_msgs/msg/PoseStamped": lambda message: _pose_numbers(message.pose),
    **{
        f"std_msgs/msg/{kind}": lambda message: {"": [float(message.data)]}
        for kind in ("Bool", "Float32", "Float64", "Int32", "UInt8")
    },
}
