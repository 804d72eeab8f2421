"""JSON -> a document, with each key once in its object. Numbers that are not finite are refused where they stand."""

import json
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from pydantic_core import from_json
from starlette.exceptions import HTTPException

MAX_KEY_CHARS = 80  # shown of a key that appears twice
_KINDS = {list: "a list", str: "a text", bool: "a truth value", type(None): "null"}


def unique_members(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
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


class StrictJsonRoute(APIRoute):
    """Reads JSON bodies as `json_object` does."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The route's handler, called with a request that reads JSON so."""
        handle = super().get_route_handler()

        async def handle_strictly(request: Request) -> Response:
            return await handle(_Request(request.scope, request.receive))

        return handle_strictly


class _Request(Request):
    async def json(self) -> Any:  # noqa: ANN401
        return json_object(await self.body())
