"""The ASGI application, and what every answer tells browsers unless its route has said it already."""

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager

from fastapi import FastAPI
from fastapi_offline import FastAPIOffline
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.access import Access, AccessControl
from app.api.body_limits import BodyLimit, BodyLimits
from app.api.image_work import ImageWork
from app.api.observation import ObserveRequests
from app.api.openapi import install_openapi
from app.api.problems import install_problem_handlers
from app.api.routes import episodes, login, operations, poses, predict, predictions, tasks
from app.services.container import Services

NOTHING = "default-src 'none'; frame-ancestors 'none'"
# Swagger UI's page starts by an inline script, and sets styles.
DOCUMENTATION = "; ".join((
    "default-src 'none'",
    "script-src 'self' 'unsafe-inline'",
    "style-src 'self' 'unsafe-inline'",
    "img-src 'self' data:",
    "connect-src 'self'",
    "base-uri 'none'",
    "form-action 'none'",
    "frame-ancestors 'none'",
))  # fmt: skip
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
DESCRIPTION = """Robot skills that an off-the-shelf LLM learns from a handful of demonstrations
([RoboPrompt](https://arxiv.org/abs/2410.12782)). Upload episodes, then send what the robot sees now: the service writes
the demonstrations and the observation as text, asks an LLM to continue the pattern, and answers with
end-effector actions.

Metres, radians and seconds; world frame; quaternions x y z w; cameras with OpenCV axes. Errors are
`application/problem+json`.
"""

OpenServices = Callable[[], AbstractAsyncContextManager[Services]]


class SecurityHeaders:
    """ASGI middleware. There is no CORS: no other website's script reads an answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
                is_docs = scope["path"].endswith("/docs")
                headers.setdefault("Content-Security-Policy", DOCUMENTATION if is_docs else NOTHING)
            await send(message)

        await self._app(scope, receive, send_with_headers)


def create_app(
    open_services: OpenServices, version: str, body_limits: BodyLimits | None = None, access: Access | None = None
) -> FastAPI:
    """The application.

    Args:
        open_services: entered at start-up, left at shutdown.
        body_limits: None: the defaults.
        access: None: anybody may do anything.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with open_services() as services:
            app.state.services = services
            yield

    app = FastAPIOffline(
        title="RoboPrompt", version=version, description=DESCRIPTION, lifespan=lifespan, redoc_url=None
    )
    # Overlays come before episodes, whose image kinds would take their addresses; a robot waits for predictions.
    for router in (
        predict.router,
        poses.overlays_router,
        episodes.router,
        tasks.router,
        operations.jobs_router,
        poses.router,
        predictions.router,
        operations.models_router,
        operations.health_router,
        login.router,
    ):
        app.include_router(router)
    install_problem_handlers(app)
    install_openapi(app)
    app.state.body_limits = body_limits or BodyLimits()
    app.state.image_work = ImageWork()
    app.add_middleware(BodyLimit, limits=app.state.body_limits)
    app.add_middleware(AccessControl, owner=app, access=access or Access())
    app.add_middleware(SecurityHeaders)
    app.add_middleware(ObserveRequests, owner=app)
    return app
