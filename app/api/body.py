"""Request bodies -> metadata and named parts, whether multipart or JSON; nothing is interpreted yet."""

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from fastapi import Request
from python_multipart.multipart import parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException

from app.api.decoding import json_object
from app.api.middleware import MAX_DOCUMENT_BYTES
from roboprompt_client.errors import InvalidInputError

MULTIPART, JSON = "multipart/form-data", "application/json"
IMAGE_PREFIXES = ("rgb_", "depth_", "mask_")
MAX_PARTS = 64
UTF_8 = ("utf-8", "utf8", "us-ascii")
TINY_BYTES = 16_384  # takes less time to decode than a change of thread


@dataclass(frozen=True)
class Body:
    """A request's content.

    Attributes:
        document: the JSON document, or that of the part `metadata`.
        parts: images, and the trajectory of a multipart upload, by name.
    """

    document: dict[str, Any]
    parts: Mapping[str, bytes]

    def digest(self) -> str:
        """SHA-256 of the content, whatever multipart boundary or key order it came with."""
        digest = hashlib.sha256(json.dumps(self.document, sort_keys=True).encode())
        for name in sorted(self.parts):
            digest.update(f"\0{name}\0".encode() + hashlib.sha256(self.parts[name]).digest())
        return digest.hexdigest()


async def read_body(request: Request) -> Body:
    """Read a multipart or JSON body.

    Raises:
        HTTPException: 415 for another content type, 413 if it is too large, 400 if it is damaged.
        InvalidInputError: for a part that cannot be read as what its name says.
    """
    content_type = _content_type(request.scope["headers"])
    if content_type == MULTIPART:
        return await _read_multipart(request)
    if content_type == JSON:
        data = await request.body()
        return _read_json(data) if len(data) <= TINY_BYTES else await run_in_threadpool(_read_json, data)
    raise HTTPException(415, f"content type {content_type or '(none)'!r:.100}: send one of {JSON}, {MULTIPART}")


def _content_type(headers: Iterable[tuple[bytes, bytes]]) -> str:
    """Return the content type without parameters, or an empty text. Of several headers the first counts."""
    first = next((value for name, value in headers if name == b"content-type"), b"")
    return first.decode("latin-1").partition(";")[0].strip().lower()


async def _read_multipart(request: Request) -> Body:
    _check_charset(request.headers["content-type"])
    parts: dict[str, bytes] = {}
    async with request.form(max_files=MAX_PARTS, max_fields=MAX_PARTS, max_part_size=MAX_DOCUMENT_BYTES) as form:
        for name, value in form.multi_items():
            if _is_unfilled(name, value):
                continue
            if name in parts:
                raise InvalidInputError(name, "appears twice", "each part once")
            parts[name] = await value.read() if isinstance(value, UploadFile) else value.encode()
    if "metadata" not in parts:
        raise InvalidInputError("metadata", "is missing", "a part named metadata with a JSON document")
    metadata = parts.pop("metadata")
    if len(metadata) > MAX_DOCUMENT_BYTES:
        raise HTTPException(413, f"metadata has {len(metadata)} bytes, at most {MAX_DOCUMENT_BYTES} are read")
    return Body(json_object(metadata, "metadata"), parts)


def _is_unfilled(name: str, value: UploadFile | str) -> bool:
    """Whether it is a camera's field of a form, Swagger UI's for one, in which no file was chosen."""
    if not name.startswith(IMAGE_PREFIXES):
        return False
    return not value.filename and not value.size if isinstance(value, UploadFile) else not value


def _check_charset(content_type: str) -> None:
    """Refuse other charsets than UTF-8: of Python's codecs some raise what no form expects, some take very long."""
    charset = parse_options_header(content_type)[1].get(b"charset", b"utf-8").decode("latin-1")
    if charset.lower() not in UTF_8:
        raise HTTPException(415, f"charset {charset!r:.100}: write the form in UTF-8")


def _read_json(data: bytes) -> Body:
    document = json_object(data)
    names = [name for name in document if name.startswith(IMAGE_PREFIXES)]
    # a label's `mask_ids` are no image
    images = {name: document.pop(name) for name in names if name != "mask_ids" or not isinstance(document[name], list)}
    return Body(document, {name: _base64(name, value) for name, value in images.items()})


def _base64(name: str, value: object) -> bytes:
    if not isinstance(value, str):
        raise InvalidInputError(name, f"is a {type(value).__name__}", "the image file in base64")
    try:
        return base64.b64decode(value, validate=True)
    except ValueError as error:  # binascii.Error is one; so is what is said of letters beyond ASCII
        raise InvalidInputError(name, f"is not base64: {error}", "the image file in base64") from None
