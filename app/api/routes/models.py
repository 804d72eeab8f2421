"""The LLMs that can be asked."""

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse

from app.api.documents import model_document
from app.api.routes import Wired
from app.api.schemas.responses import ModelList

router = APIRouter(tags=["models"])


@router.get("/models", operation_id="list_models", response_model=ModelList)
def list_models(services: Wired) -> Response:
    """Every LLM that the service knows, whether it can be used here, and the prompt that suits it."""
    known = services.models.profiles()
    documents = [model_document(item.profile, item.available, item.reason, services.default_model) for item in known]
    return JSONResponse({"models": documents})
