"""The addresses of the service, by subject."""

from typing import Annotated

from fastapi import Depends, Header, Query, Request

from app.api.problems import CONTENT
from app.services.container import Services

Limit = Annotated[int, Query(ge=1, le=200, description="at most so many")]
Cursor = Annotated[int | None, Query(ge=1, le=2**63 - 1, description="next_cursor of the page before")]
IdempotencyKey = Annotated[
    str | None,
    Header(max_length=200, description="a repeated request with the same key is answered as the first was"),
]


async def get_services(request: Request) -> Services:
    """The application's services; asynchronous, because FastAPI calls every other dependency in a thread."""
    services: Services = request.app.state.services
    return services


Wired = Annotated[Services, Depends(get_services)]


def problems(**meanings: str) -> dict[int | str, dict[str, object]]:
    """Documentation of error responses: `problems(_404="no such task")`."""
    return {int(name[1:]): {"description": meaning, "content": CONTENT} for name, meaning in meanings.items()}
