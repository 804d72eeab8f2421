"""Reads the parts of a GGUF file and writes them again: as much of the format as leaving out tokens needs.

The `gguf` package knows the whole format, and takes ten times as long for a vocabulary of 262,144 tokens.
The format, version 3: https://github.com/ggml-org/ggml/blob/master/docs/gguf.md
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from mmap import mmap
from pathlib import Path
from typing import BinaryIO

MAGIC = b"GGUF"
VERSION = 3
ALIGNMENT = 32  # bytes, of every tensor's begin
STRING, ARRAY = 8, 9
SCALAR_SIZES = {0: 1, 1: 1, 2: 2, 3: 2, 4: 4, 5: 4, 6: 4, 7: 1, 10: 8, 11: 8, 12: 8}
Q8_0 = 8
Q8_0_BLOCK = (32, 34)  # numbers, and the bytes that they take


@dataclass(frozen=True)
class Array:
    """The items of one type that belong to a key, each as its bytes in the file."""

    kind: int
    items: Sequence[bytes]

    def head(self) -> bytes:
        """Return what is before the items in the file."""
        return struct.pack("<IIQ", ARRAY, self.kind, len(self.items))

    def texts(self) -> list[str]:
        """The items of an array of strings; bytes that are not UTF-8 are replaced."""
        return [item[8:].decode("utf-8", "replace") for item in self.items]

    def take(self, indices: Sequence[int]) -> "Array":
        """The items at `indices`."""
        return Array(self.kind, [self.items[index] for index in indices])


def string(text: str) -> bytes:
    """Return a string as an array's item."""
    encoded = text.encode()
    return struct.pack("<Q", len(encoded)) + encoded


def string_value(text: str) -> bytes:
    """Return a string as the value of a key."""
    return struct.pack("<I", STRING) + string(text)


@dataclass(frozen=True)
class Tensor:
    """A matrix or vector."""

    shape: tuple[int, ...]  # the innermost dimension first
    kind: int  # ggml's number of the element type
    data: bytes  # its bytes, padded to `ALIGNMENT`

    def take_rows(self, indices: Sequence[int]) -> "Tensor":
        """The rows of a Q8_0 matrix at `indices`; raises ValueError if it has another element type."""
        if self.kind != Q8_0:
            raise ValueError(f"rows of a tensor of type {self.kind} cannot be taken (valid: {Q8_0}, Q8_0)")
        numbers, size = Q8_0_BLOCK
        row = self.shape[0] // numbers * size
        kept = b"".join(self.data[index * row : (index + 1) * row] for index in indices)
        return Tensor((self.shape[0], len(indices)), self.kind, kept + bytes(-len(kept) % ALIGNMENT))


@dataclass(frozen=True)
class GgufFile:
    """The parts of a file by name, in the file's order; of values that are no arrays, the bytes in the file."""

    values: dict[str, Array | bytes]
    tensors: dict[str, Tensor]

    def array(self, name: str) -> Array:
        """The array of that name; raises ValueError."""
        if not isinstance(found := self.values.get(name), Array):
            raise ValueError(f"the GGUF file has no array {name!r}")
        return found


def is_gguf(path: Path) -> bool:
    """Whether the file begins as one; raises OSError."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read(data: bytes | mmap) -> GgufFile:
    """The parts of a file; raises ValueError unless it is version 3, little endian, with the usual alignment."""
    reader = _Reader(data)
    if reader.take(4) != MAGIC or reader.number(4) != VERSION:
        raise ValueError(f"not a GGUF file of version {VERSION}")
    num_tensors, num_values = reader.number(8), reader.number(8)
    values = {reader.text(): reader.value() for _ in range(num_values)}
    if "general.alignment" in values:
        raise ValueError("a GGUF file with an alignment of its own is not supported")
    heads = [(reader.text(), reader.shape(), reader.number(4), reader.number(8)) for _ in range(num_tensors)]
    body = reader.rest()
    ends = [*(offset for *_, offset in heads[1:]), len(body)]
    tensors = {
        name: Tensor(shape, kind, body[offset:end])
        for (name, shape, kind, offset), end in zip(heads, ends, strict=True)
    }
    return GgufFile(values, tensors)


def write(parts: GgufFile, file: BinaryIO) -> None:
    """Write the parts as a file; equal parts give equal bytes."""
    head = bytearray(MAGIC + struct.pack("<IQQ", VERSION, len(parts.tensors), len(parts.values)))
    for name, value in parts.values.items():
        head += string(name) + (value if isinstance(value, bytes) else value.head() + b"".join(value.items))
    offset = 0
    for name, tensor in parts.tensors.items():
        head += string(name) + struct.pack(f"<I{len(tensor.shape)}Q", len(tensor.shape), *tensor.shape)
        head += struct.pack("<IQ", tensor.kind, offset)
        offset += len(tensor.data)
    file.write(head + bytes(-len(head) % ALIGNMENT))
    for tensor in parts.tensors.values():
        file.write(tensor.data)


class _Reader:
    """Takes one value after another from the head of a file."""

    def __init__(self, data: bytes | mmap) -> None:
        self._data, self._at = data, 0

    def take(self, size: int) -> bytes:
        begin, self._at = self._at, self._at + size
        if self._at > len(self._data):
            raise ValueError("the GGUF file ends within its head")
        return self._data[begin : self._at]

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        return self.take(self.number(8)).decode()

    def shape(self) -> tuple[int, ...]:
        return tuple(self.number(8) for _ in range(self.number(4)))

    def value(self) -> Array | bytes:
        if (kind := self.number(4)) != ARRAY:
            return struct.pack("<I", kind) + self._item(kind)
        kind, count = self.number(4), self.number(8)
        return Array(kind, [self._item(kind) for _ in range(count)])

    def _item(self, kind: int) -> bytes:
        if kind == STRING:
            length = self.take(8)
            return length + self.take(int.from_bytes(length, "little"))
        if kind not in SCALAR_SIZES:
            raise ValueError(f"a GGUF value of type {kind} is not known")
        return self.take(SCALAR_SIZES[kind])

    def rest(self) -> bytes:
        """Return the bytes after the next boundary: the tensors."""
        return self._data[self._at + -self._at % ALIGNMENT :]
