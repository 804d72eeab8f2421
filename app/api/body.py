"""Request bodies -> metadata and named parts, whether multipart, JSON or MessagePack; nothing is interpreted yet."""

import base64
import hashlib
import io
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from fastapi import Request
from python_multipart.multipart import parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app.api.decoding import JsonBudget, check_only_json_types, json_object, msgpack_object
from app.api.middleware import JSON, MSGPACK, MULTIPART, content_type_of
from roboprompt_client.errors import InvalidInputError

IMAGE_PREFIXES = ("rgb_", "depth_", "mask_")
FILM_PREFIX = "film_"
CAMERA_PREFIXES = (*IMAGE_PREFIXES, FILM_PREFIX)
TRAJECTORY = "trajectory"
MAX_PARTS = 64
UTF_8 = ("utf-8", "utf8", "us-ascii")
TINY_BYTES = 16_384  # takes less time to decode than a change of thread
_BASE64_PIECE = 4 * 262_144  # whole groups of four, 1 MB: other threads have their turn after each
MARK = "__ndarray__"
MAX_DIMENSIONS = 3
DTYPES = ("|b1", "|u1", "<u2", "<u4", "<i4", "<i8", "<f2", "<f4", "<f8")
_VALID = f"a map of {MARK}, data, dtype ({', '.join(DTYPES)}) and shape (at most {MAX_DIMENSIONS} lengths)"


@dataclass(frozen=True)
class Body:
    """A request's content.

    Attributes:
        document: the JSON document, or that of the part `metadata`.
        parts: images, films, and the trajectory of a multipart upload, by name.
    """

    document: dict[str, Any]
    parts: Mapping[str, bytes]

    def digest(self) -> str:
        """SHA-256 of the content, whatever multipart boundary or key order it came with."""
        digest = hashlib.sha256(json.dumps(self.document, sort_keys=True).encode())
        for name in sorted(self.parts):
            digest.update(f"\0{name}\0".encode() + hashlib.sha256(self.parts[name]).digest())
        return digest.hexdigest()


async def read_body(request: Request, *, packed: bool = False) -> Body:
    """Read a multipart or JSON body.

    Args:
        packed: read MessagePack, too.

    Raises:
        HTTPException: 415 for another content type, 413 if it is too large, 400 if it is damaged.
        InvalidInputError: for a part that cannot be read as what its name says.
    """
    content_type = content_type_of(request.scope["headers"])
    most = request.app.state.body_limits.document
    if content_type == MULTIPART:
        return await _read_multipart(request, most)
    if content_type == JSON or (content_type == MSGPACK and packed):
        read = _read_json if content_type == JSON else _read_packed
        data = await request.body()
        return read(data, most) if len(data) <= TINY_BYTES else await run_in_threadpool(read, data, most)
    known = ", ".join([JSON, MULTIPART, *([MSGPACK] if packed else [])])
    raise HTTPException(415, f"content type {content_type or '(none)'!r:.100}: send one of {known}")


async def _read_multipart(request: Request, most: int) -> Body:
    _check_charset(request.headers["content-type"])
    parts: dict[str, bytes] = {}
    async with request.form(max_files=MAX_PARTS, max_fields=MAX_PARTS, max_part_size=most) as form:
        for name, value in form.multi_items():
            if _is_unfilled(name, value):
                continue
            if name in parts:
                raise InvalidInputError(name, "appears twice", "each part once")
            parts[name] = await value.read() if isinstance(value, UploadFile) else value.encode()
    if "metadata" not in parts:
        raise InvalidInputError("metadata", "is missing", "a part named metadata with a JSON document")
    metadata = parts.pop("metadata")
    _check_document(len(metadata), most)
    document = await run_in_threadpool(_metadata, metadata) if len(metadata) > TINY_BYTES else _metadata(metadata)
    return Body(document, parts)


def _is_unfilled(name: str, value: UploadFile | str) -> bool:
    """Whether it is a camera's field of a form, Swagger UI's for one, in which no file was chosen."""
    if not name.startswith(CAMERA_PREFIXES):
        return False
    return not value.filename and not value.size if isinstance(value, UploadFile) else not value


def _check_charset(content_type: str) -> None:
    """Refuse other charsets than UTF-8: of Python's codecs some raise what no form expects, some take very long."""
    charset = parse_options_header(content_type)[1].get(b"charset", b"utf-8").decode("latin-1")
    if charset.lower() not in UTF_8:
        raise HTTPException(415, f"charset {charset!r:.100}: write the form in UTF-8")


def _metadata(data: bytes) -> dict[str, Any]:
    """A part's document; that of a whole body is counted while it comes."""
    try:
        JsonBudget().feed(data)
    except HTTPException as error:
        raise HTTPException(error.status_code, f"metadata: {error.detail}") from None
    return json_object(data, "metadata")


def _read_json(data: bytes, most: int) -> Body:
    document = json_object(data)
    names = [name for name in document if name.startswith(CAMERA_PREFIXES)]
    # a label's `mask_ids` are no image
    images = {name: document.pop(name) for name in names if name != "mask_ids" or not isinstance(document[name], list)}
    if TRAJECTORY not in document:
        _check_document(len(data) - sum(len(value) for value in images.values() if isinstance(value, str)), most)
    return Body(document, {name: _base64(name, value) for name, value in images.items()})


def _read_packed(data: bytes, most: int) -> Body:
    """The document of a JSON body, its images as arrays or as encoded files."""
    document = msgpack_object(data)
    names = [name for name in document if name.startswith(CAMERA_PREFIXES)]
    parts = {name: packed_image(name, document.pop(name)) for name in names}
    _check_document(len(data) - sum(map(len, parts.values())), most)
    check_only_json_types(document)
    return Body(document, parts)


def _check_document(size: int, most: int) -> None:
    if size > most:
        raise HTTPException(413, f"a document, its images aside, may have at most {most} bytes; this has {size}")


def packed_image(name: str, value: object) -> bytes:
    """An image of MessagePack as the file that it is, or as a `.npy` file of its array."""
    if isinstance(value, bytes):
        return value
    if isinstance(value, dict) and (MARK in value or MARK.encode() in value):
        return npy_from_packed(name, value)
    raise InvalidInputError(name, f"is a {type(value).__name__}", "an array, or the image file's bytes")


def npy_from_packed(field: str, value: Mapping[Any, Any]) -> bytes:
    """An array as openpi's `msgpack_numpy.py` packs it, as a `.npy` file: its header, then the bytes as they came.

    It is the map ``{"__ndarray__": true, "data": bytes, "dtype": "|u1", "shape": [480, 640, 3]}``; openpi packs the
    keys as bytes, other programs as text, and both are read.

    Args:
        field: what an error names.

    Raises:
        InvalidInputError: if type or shape are not allowed, or do not fit the number of bytes.
    """
    named = {_text(key): item for key, item in value.items()}
    data, dtype, shape = named.get("data"), _text(named.get("dtype")), _shape(named.get("shape"))
    if not isinstance(data, bytes) or dtype not in DTYPES or shape is None:
        given = f"dtype {dtype!r:.40}, shape {named.get('shape')!r:.80}"
        raise InvalidInputError(field, f"is not an array ({given})", _VALID)
    claimed = math.prod(shape) * np.dtype(dtype).itemsize
    if claimed != len(data):
        raise InvalidInputError(field, f"claims {claimed} bytes of numbers, has {len(data)}", _VALID)
    stream = io.BytesIO()
    header = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue() + data


def _text(value: object) -> object:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _shape(value: object) -> tuple[int, ...] | None:
    """The lengths, if that is what `value` is."""
    if not isinstance(value, list) or len(value) > MAX_DIMENSIONS:
        return None
    return tuple(value) if all(type(length) is int and length >= 0 for length in value) else None


def _base64(name: str, value: object) -> bytes:
    if not isinstance(value, str):
        raise InvalidInputError(name, f"is a {type(value).__name__}", "the image file in base64")
    try:
        if value.find("=", 0, -2) >= 0:  # a piece of it could end there
            raise ValueError("padding before its end")
        pieces = (value[at : at + _BASE64_PIECE] for at in range(0, len(value), _BASE64_PIECE))
        return b"".join(base64.b64decode(piece, validate=True) for piece in pieces)
    except ValueError as error:  # binascii.Error is one; so is what is said of letters beyond ASCII
        raise InvalidInputError(name, f"is not base64: {error}", "the image file in base64") from None
