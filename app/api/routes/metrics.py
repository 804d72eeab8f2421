"""Figures for Prometheus."""

from fastapi import APIRouter, Response

from app.api.routes import Wired

router = APIRouter(tags=["health"])


@router.get("/metrics", operation_id="metrics", responses={200: {"content": {"text/plain": {}}}})
def metrics(services: Wired) -> Response:
    """Requests, predictions by stage, tokens (cached among them), parse failures and outcomes, of this process."""
    return Response(services.metrics.text(), media_type=services.metrics.content_type)
