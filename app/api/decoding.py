"""JSON and MessagePack -> a document: bounded in values and levels, and with each key once in its object.

The values of a JSON document are counted in its bytes before anything is decoded: a megabyte of `[],[],[]` becomes
60 MB of objects, and the event loop stands still meanwhile. MessagePack is bounded while it is unpacked.
"""

import json
import re
from collections.abc import Callable, Coroutine, Iterable, Sequence
from itertools import accumulate
from typing import Any

import msgpack
from fastapi import Request, Response
from fastapi.routing import APIRoute
from pydantic_core import from_json
from starlette.exceptions import HTTPException

from roboprompt_client.errors import InvalidInputError

MAX_VALUES = 20_000  # 64 objects with 64 mask ids have 9,000
MAX_DEPTH = 64
MAX_ITEMS = 4096  # of a MessagePack list or map, which is made as long as it claims to be before its items are read
MAX_KEY_CHARS = 80  # shown of a key that appears twice
_ESCAPED = re.compile(rb"\\.", re.DOTALL)
_NOT_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_STEP = {ord("["): 1, ord("{"): 1, ord("]"): -1, ord("}"): -1}


class JsonBudget:
    """Counts the signs that separate values, outside of strings; whether the text is JSON is the parser's matter.

    Args:
        max_values: a key counts as a value.
    """

    def __init__(self, max_values: int = MAX_VALUES, max_depth: int = MAX_DEPTH) -> None:
        self._max_values, self._max_depth = max_values, max_depth
        self._values = self._opened = self._depth = 0
        self._in_string = False
        self._half_escape = b""  # a backslash whose other half is in the next piece

    def feed(self, piece: bytes) -> None:
        """Count the document's next piece.

        Raises:
            HTTPException: as soon as there are too many values (413), or they lie too deep (400).
        """
        if b"\0" in piece:  # only in UTF-16 and UTF-32, where other characters hold the bytes that are counted
            raise HTTPException(400, "a JSON document is written in UTF-8")
        text = self._half_escape + piece
        if b"\\" in text:
            text = _ESCAPED.sub(b"", text)
        self._half_escape = b"\\" if text.endswith(b"\\") else b""
        between_quotes = text.split(b'"')
        outside = b"".join(between_quotes[self._in_string :: 2])
        if len(between_quotes) % 2 == 0:
            self._in_string = not self._in_string
        opened = outside.count(b"[") + outside.count(b"{")
        self._measure(outside, opened)
        self._values += outside.count(b",") + outside.count(b":") + opened
        if self._values > self._max_values:
            raise HTTPException(413, f"a JSON document may have at most {self._max_values} values here")

    def _measure(self, outside: bytes, opened: int) -> None:
        self._opened += opened
        if self._opened <= self._max_depth:  # too few to lie too deep
            self._depth += opened - outside.count(b"]") - outside.count(b"}")
            return
        brackets = outside.translate(None, _NOT_BRACKETS)
        depths = list(accumulate(map(_STEP.__getitem__, brackets), initial=self._depth))
        self._depth = depths[-1]
        if max(depths) > self._max_depth:
            raise HTTPException(400, f"a JSON document may have at most {self._max_depth} levels")


def unique_members(pairs: Sequence[tuple[Any, Any]]) -> dict[Any, Any]:
    """The object of these members: of a key that is given twice it is unknown which value was meant.

    Raises:
        HTTPException: 400 for a key that appears twice.
    """
    members = dict(pairs)
    if len(members) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for number, key in enumerate(keys) if key in keys[:number])
        raise HTTPException(400, f"the key {twice[:MAX_KEY_CHARS]!a} appears twice in one object: name each once")
    return members


_KINDS = {list: "a list", str: "a text", bool: "a truth value", type(None): "null"}
_DECODER = json.JSONDecoder(object_pairs_hook=unique_members)


def json_object(data: bytes, where: str = "body") -> dict[str, Any]:
    """The JSON object in `data`.

    Raises:
        HTTPException: 400 for what is not JSON, no object, or one that has the same key twice, at any depth.
    """
    try:
        value = _DECODER.decode(data.decode())
        if b"\\u" in data:
            from_json(data)  # unlike Python's decoder it refuses half of a surrogate pair, which nothing can store
    except ValueError as error:
        raise HTTPException(400, f"{where} is not JSON: {error}") from None
    if not isinstance(value, dict):
        kind = _KINDS.get(type(value), "a number")
        raise HTTPException(400, f"{where} is {kind}, expected a JSON object")
    return value


class UniqueKeysRoute(APIRoute):
    """Answers 400 to a JSON object, at any depth, that has the same key twice."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The route's handler, called with a request that reads JSON so."""
        handle = super().get_route_handler()

        async def handle_unique(request: Request) -> Response:
            return await handle(_Request(request.scope, request.receive))

        return handle_unique


class _Request(Request):
    async def json(self) -> Any:  # noqa: ANN401
        return json_object(await self.body())


class _Counter:
    """Counts the values of each list and map that is complete; within one that is not, `MAX_ITEMS` are the most."""

    def __init__(self) -> None:
        self._left = MAX_VALUES

    def __call__(self, container: Any) -> Any:  # noqa: ANN401
        self._left -= 1 + len(container)
        if self._left < 0:
            raise HTTPException(413, f"a MessagePack document may have at most {MAX_VALUES} values")
        return container

    def members(self, pairs: Sequence[tuple[Any, Any]]) -> dict[Any, Any]:
        """A map that is complete, as a dictionary."""
        return unique_members(self(pairs))


def msgpack_object(data: bytes) -> dict[str, Any]:
    """The MessagePack map in `data`, its arrays as maps and its bytes as they are.

    Raises:
        HTTPException: 413 for too many values, 400 for what is not MessagePack, no map, or has a key twice.
        InvalidInputError: for a key that is no text.
    """
    counted = _Counter()
    try:
        document = msgpack.unpackb(
            data,
            max_array_len=MAX_ITEMS,
            max_map_len=MAX_ITEMS,
            max_ext_len=0,
            strict_map_key=True,
            list_hook=counted,
            object_pairs_hook=counted.members,
        )
    except HTTPException:
        raise
    except Exception as error:  # msgpack's own errors have no common class; some are ValueError, some are not
        raise HTTPException(400, f"body is not MessagePack: {str(error)[:200] or type(error).__name__}") from None
    if not isinstance(document, dict):
        raise HTTPException(400, f"body is a MessagePack {type(document).__name__}, expected a map")
    for key in document:
        if not isinstance(key, str):
            raise InvalidInputError("body", f"has the key {key!r:.40}", "keys that are text")
    return document


def check_only_json_types(document: dict[str, Any]) -> None:
    """Refuse bytes and other values that JSON does not have: the document is stored as JSON.

    Raises:
        InvalidInputError: naming the place.
    """
    if (fault := _fault(document, 0)) is not None:
        path, message, valid = fault
        place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in reversed(path))
        raise InvalidInputError(place.removeprefix(".") or "body", message, valid)


def _fault(value: object, depth: int) -> tuple[list[str | int], str, str] | None:
    """Return the path, innermost first, of a value that JSON cannot hold, what it is, and what is valid; or None."""
    if depth > MAX_DEPTH:
        return [], "lies too deep", f"at most {MAX_DEPTH} levels"
    items: Iterable[tuple[Any, Any]]
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    elif isinstance(value, str | int | float | bool | None):
        return None
    else:
        return [], f"is of the type {type(value).__name__}", "what JSON can say"
    for key, item in items:
        if isinstance(value, dict) and not isinstance(key, str):
            return [], f"has the key {key!r:.40}", "keys that are text"
        # the place is put together only where there is a fault: keys may be long, and items many
        if (fault := _fault(item, depth + 1)) is not None:
            fault[0].append(key)
            return fault
    return None
