"""What became of an upload, for whoever goes on with an import that was cut off."""

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse

from app.api.routes import Wired, problems
from app.api.schemas.responses import UploadOut
from app.services.teach.upload import SCOPE
from app.store import episodes, idempotency
from app.store.errors import NotFoundError

router = APIRouter(tags=["episodes"])


@router.get(
    "/uploads/{idempotency_key}",
    operation_id="get_upload",
    response_model=UploadOut,
    responses=problems(_404="nothing was uploaded with this key, or it was deleted since"),
)
def get_upload(services: Wired, idempotency_key: str) -> Response:
    """The episode that an upload with this `Idempotency-Key` made."""
    with services.store.read() as connection:
        stored = idempotency.answered(connection, SCOPE, idempotency_key)
        if stored is None or not episodes.exist(connection, stored.response["id"]):
            raise NotFoundError("upload", idempotency_key)
    return JSONResponse({"episode_id": stored.response["id"]})
