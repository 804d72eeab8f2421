"""How long requests take."""

import time
from http import HTTPMethod

from fastapi import FastAPI
from starlette.types import ASGIApp, Message, Receive, Scope, Send

METHODS = frozenset(HTTPMethod)


class ObserveRequests:
    """ASGI middleware that tells the services' metrics of every answer.

    Args:
        owner: whose `state.services` has them.
    """

    def __init__(self, app: ASGIApp, owner: FastAPI) -> None:
        self._app = app
        self._owner = owner

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        started = time.perf_counter()
        status = 500

        async def watched_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self._app(scope, receive, watched_send)
        finally:
            # What nobody has foreseen must not become a label: anyone could invent any number of them.
            method = scope["method"] if scope["method"] in METHODS else "other"
            route = getattr(scope.get("route"), "path", "none")
            metrics = self._owner.state.services.metrics
            metrics.observe_request(method, route, status, time.perf_counter() - started)
