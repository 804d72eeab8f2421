"""Upload by drag and drop; the scripts of the page send what they find to POST /episodes."""

from fastapi import APIRouter, Request
from starlette.responses import Response

from app.web.page import PageRoute, render

router = APIRouter(route_class=PageRoute)


@router.get("/ui/upload")
def upload_page(request: Request) -> Response:
    """Where demonstrations are dropped."""
    return render(request, "upload.html")
