"""The ASGI application: its routes, and what every request passes before them."""

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager

from fastapi import FastAPI
from fastapi_offline import FastAPIOffline

from app.api.access import Access, AccessControl
from app.api.body_limits import BodyLimit, BodyLimits
from app.api.image_work import ImageWork
from app.api.middleware import OuterMiddleware
from app.api.openapi import install_openapi
from app.api.problems import install_problem_handlers
from app.api.routes import episodes, labels, login, operations, plans, poses, predict, predictions, runs, tasks
from app.services.container import Services

DESCRIPTION = """Robot skills that an off-the-shelf LLM learns from a handful of demonstrations
([RoboPrompt](https://arxiv.org/abs/2410.12782)). Upload episodes, then send what the robot sees now: the service writes
the demonstrations and the observation as text, asks an LLM to continue the pattern, and answers with
end-effector actions.

Metres, radians and seconds; world frame; quaternions x y z w; cameras with OpenCV axes. Errors are
`application/problem+json`.
"""

OpenServices = Callable[[], AbstractAsyncContextManager[Services]]


def create_app(
    open_services: OpenServices, version: str, body_limits: BodyLimits | None = None, access: Access | None = None
) -> FastAPI:
    """The application.

    Args:
        open_services: entered at start-up, left at shutdown.
        body_limits: None: the defaults.
        access: None: no keys, no rate limit.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with open_services() as services:
            app.state.services = services
            yield

    app = FastAPIOffline(
        title="RoboPrompt", version=version, description=DESCRIPTION, lifespan=lifespan, redoc_url=None
    )
    # A robot waits for predictions. Overlays come before episodes, whose kinds of images would take their addresses.
    for subject in (predict, plans, poses, episodes, labels, tasks, predictions, runs, operations, login):
        app.include_router(subject.router)
    app.include_router(labels.learn_router)
    install_problem_handlers(app)
    install_openapi(app)
    app.state.body_limits = body_limits or BodyLimits()
    app.state.image_work = ImageWork()
    app.add_middleware(BodyLimit, limits=app.state.body_limits)
    app.add_middleware(AccessControl, owner=app, access=access or Access())
    app.add_middleware(OuterMiddleware, owner=app)
    return app
