"""The ASGI application: its routes, what every request passes before them, and how OpenAPI describes it."""

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic.json_schema import models_json_schema

from app.api.access import Access, AccessControl
from app.api.access_rules import HEALTH, scope_for
from app.api.middleware import BodyLimit, OuterMiddleware
from app.api.problems import CONTENT, install_problem_handlers
from app.api.routes import episodes, objects, operations, predict, predictions, tasks
from app.api.schemas.objects import LabelBody, PosesBody
from app.api.schemas.requests import EpisodeJson, EpisodeMetadata, PredictBody
from app.api.schemas.responses import Problem
from app.services.container import Services

DESCRIPTION = """Robot skills that an off-the-shelf LLM learns from a handful of demonstrations
([RoboPrompt](https://arxiv.org/abs/2410.12782)). Upload episodes, then send what the robot sees now: the service writes
the demonstrations and the observation as text, asks an LLM to continue the pattern, and answers with
end-effector actions.

Meters, radians and seconds; world frame; quaternions x y z w; cameras with OpenCV axes. Errors are
`application/problem+json`.
"""

# In the order in which a robot needs them.
TAGS = [
    {"name": "episodes", "description": "demonstrations: upload, correct, leave out, delete"},
    {"name": "predictions", "description": "actions for what the robot sees now, and how it went"},
    {"name": "tasks", "description": "settings of a task, checks of its demonstrations, statistics"},
    {"name": "poses", "description": "poses of objects in images"},
    {"name": "labels", "description": "objects marked in images, from which the estimator `registered` learns them"},
    {"name": "models", "description": "the LLMs that can be asked"},
    {"name": "health", "description": "probes and metrics"},
]
# Bodies that routes read themselves, and the form of errors: FastAPI does not know them.
_HAND_READ = (EpisodeJson, EpisodeMetadata, LabelBody, PosesBody, PredictBody, Problem)
_SCHEMES: dict[str, Any] = {
    "bearer": {"type": "http", "scheme": "bearer", "description": "a key of `roboprompt keys add`"},
    "basic": {"type": "http", "scheme": "basic", "description": "any user; the key is the password"},
}
_OTHER_SITE = "the key lacks the scope, or the request comes from a page of another website"
_TOO_MANY = "too many requests of this key or address; Retry-After says when to try again"
# What every operation but health checks may answer, what every one may, and what every one with a body may.
_OF_ACCESS = {
    "401": ("Unauthenticated", "an API key is required, and it is missing or not valid"),
    "403": ("Forbidden", _OTHER_SITE),
    "414": ("AddressTooLong", "the address's query is too long"),
    "429": ("TooManyRequests", _TOO_MANY),
}
_REFUSALS = {name: {"description": meaning, "content": CONTENT} for name, meaning in _OF_ACCESS.values()}
_OF_ALL = {"422": "a value is not valid", "503": "the store does not answer"}
_OF_BODIES = {"400": "the body cannot be read", "413": "the body is too large"}
OpenServices = Callable[[], AbstractAsyncContextManager[Services]]


def create_app(open_services: OpenServices, version: str, max_body_bytes: int, access: Access) -> FastAPI:
    """The application.

    Args:
        open_services: entered at start-up, left at shutdown.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with open_services() as services:
            app.state.services = services
            yield

    app = FastAPI(
        title="RoboPrompt",
        version=version,
        description=DESCRIPTION,
        openapi_tags=TAGS,
        lifespan=lifespan,
        docs_url=None,  # a page of `app.web`
        redoc_url=None,
        generate_unique_id_function=lambda route: route.name,
    )
    # A robot waits for predictions. Overlays come before episodes, whose kinds of images would take their addresses.
    for subject in (predict, objects, episodes, tasks, predictions, operations):
        app.include_router(subject.router)
    install_problem_handlers(app)
    install_openapi(app)
    app.add_middleware(BodyLimit, largest=max_body_bytes)
    app.add_middleware(AccessControl, access=access)
    app.add_middleware(OuterMiddleware)
    return app


def install_openapi(app: FastAPI) -> None:
    """Add the bodies that routes read themselves to the OpenAPI document of `app`."""

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            document = get_openapi(
                title=app.title,
                version=app.version,
                description=app.description,
                routes=app.routes,
                tags=app.openapi_tags,
            )
            _, definitions = models_json_schema(
                [(model, "validation") for model in _HAND_READ], ref_template="#/components/schemas/{model}"
            )
            for path, item in document["paths"].items():
                for method, operation in item.items():
                    _describe_operation(path, method, operation)
            document["paths"] = dict(sorted(document["paths"].items(), key=lambda path: path[0].count("/")))
            document.setdefault("components", {}).setdefault("schemas", {}).update(definitions["$defs"])
            document["components"] |= {"securitySchemes": _SCHEMES, "responses": _REFUSALS}
            app.openapi_schema = document
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def _describe_operation(path: str, method: str, operation: dict[str, Any]) -> None:
    """Add the scopes and the refusals that every route has, and replace FastAPI's 422 by the service's."""
    responses = operation["responses"]
    for status, meaning in (_OF_ALL | (_OF_BODIES if "requestBody" in operation else {})).items():
        named = responses.get(status)
        if named is None or ("application/json" in named["content"] and status == "422"):
            responses[status] = {"description": meaning, "content": CONTENT}
    if scope := scope_for(method.upper(), path):
        # The empty requirement stands for services that require no keys.
        operation["security"] = [{}, *({scheme: [scope]} for scheme in _SCHEMES)]
        operation["description"] = f"{operation['description']}\n\nScope: {scope}."
    if path not in HEALTH:
        named = {status: {"$ref": f"#/components/responses/{name}"} for status, (name, _) in _OF_ACCESS.items()}
        operation["responses"] = {**named, **responses}
