"""What a task's demonstrations make of each other: a page of its own, because it takes seconds to work out."""

from fastapi import APIRouter, Request
from starlette.responses import Response

from app.api.routes import Wired
from app.web.page import PageRoute, render

router = APIRouter(route_class=PageRoute)


@router.get("/ui/tasks/{name}/check")
def check_page(request: Request, services: Wired, name: str) -> Response:
    """Each demonstration, predicted from the others."""
    return render(request, "check.html", checked=services.check_task.without_model(name))
