"""Routes whose JSON bodies name each member once: of a bound that is given twice, nobody knows which one was meant."""

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

MAX_SHOWN = 80


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
        return json.loads(await self.body(), object_pairs_hook=_unique)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members: dict[str, Any] = {}
    for key, value in pairs:
        if key in members:
            raise HTTPException(400, f"the key {key[:MAX_SHOWN]!a} appears twice in one object: name each once")
        members[key] = value
    return members
