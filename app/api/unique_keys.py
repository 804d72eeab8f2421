"""Each object of a body names its members once: of a value that is given twice, nobody knows which one was meant."""

import json
from collections.abc import Callable, Coroutine, Iterable
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

MAX_SHOWN = 80


def unique_members(pairs: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """The object of these members.

    Raises:
        HTTPException: 400 for a key that appears twice.
    """
    members: dict[Any, Any] = {}
    for key, value in pairs:
        if key in members:
            raise HTTPException(400, f"the key {key[:MAX_SHOWN]!a} appears twice in one object: name each once")
        members[key] = value
    return members


_DECODER = json.JSONDecoder(object_pairs_hook=unique_members)


def check_unique_keys(document: bytes) -> None:
    """Refuse a JSON document in which an object, at any depth, has the same key twice.

    Raises:
        HTTPException: 400, naming the key.
        ValueError: for what is not JSON in UTF-8.
    """
    _DECODER.decode(document.decode())


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
        return json.loads(await self.body(), object_pairs_hook=unique_members)
